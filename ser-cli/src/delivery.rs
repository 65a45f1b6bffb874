//! The destination of deliveries: events and losses go to standard output, losses also to standard
//! error, and progress to the bar.

use std::fmt::Display;
use std::time::Duration;

use ser_client::{Clock, Delivery, RealTime};
use ser_evidence::record::EntryRecord;
use ser_proto::Model;

use crate::error::{Failure, Result, warn};
use crate::output::{self, Annotator, Before, EventWriter, Format, Life, Loss, Points, Record};
use crate::progress::Progress;

/// Gaps and invalid entries that are reported one by one; further ones are only counted.
const TOLD: u32 = 3;

/// Writes the deliveries of a reading.
pub(crate) struct Outlet {
    writer: Box<dyn EventWriter>,
    annotator: Annotator,
    progress: Progress,
    gaps: u32,
    not_valid: u32,
    new: NewEntries,
}

/// An entry and when it had arrived here, by this computer's monotonic clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Arrived {
    pub(crate) record: EntryRecord,
    pub(crate) at: Duration,
}

/// The entries since somebody asked for them the last time.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct NewEntries {
    pub(crate) first: Option<Arrived>,
    pub(crate) last: Option<Arrived>,
    /// The recorder's model, as the entries show it.
    pub(crate) model: Option<Model>,
}

impl Outlet {
    /// To standard output, with a bar if the download is long; for a log of this life.
    pub(crate) fn new(format: Format, recorder: &str, life: Life, before: Before) -> Outlet {
        Outlet::with_progress(format, recorder, life, before, Progress::new())
    }

    /// To standard output, without a bar, because there is no end.
    pub(crate) fn endless(format: Format, recorder: &str, life: Life, before: Before) -> Outlet {
        Outlet::with_progress(format, recorder, life, before, Progress::none())
    }

    fn with_progress(
        format: Format,
        recorder: &str,
        life: Life,
        before: Before,
        progress: Progress,
    ) -> Outlet {
        let writer = output::to_stdout(format, recorder);
        let (annotator, new) = (Annotator::new(life, before), NewEntries::default());
        Outlet { writer, annotator, progress, gaps: 0, not_valid: 0, new }
    }

    /// The entries since the last call.
    pub(crate) fn take_new(&mut self) -> NewEntries {
        std::mem::take(&mut self.new)
    }

    /// Whether the format has a place for what is known besides entries and losses.
    pub(crate) fn holds_evidence(&self) -> bool {
        self.writer.holds_evidence()
    }

    /// Writes what else is known, where the format has a place for it.
    pub(crate) fn evidence(&mut self, record: &ser_evidence::record::Record) -> Result<()> {
        Ok(self.writer.evidence(record)?)
    }

    /// Gives inputs their names, where they are for people.
    pub(crate) fn name_points(&mut self, points: Points) {
        self.writer.name_points(points);
    }

    /// The life of the log that is being read.
    pub(crate) fn life(&self) -> Life {
        self.annotator.life()
    }

    /// Writes deliveries and passes them on; `pending` more events are about to come. `remember`
    /// gets the life of the log before anything is passed on.
    pub(crate) fn take(
        &mut self,
        deliveries: &[Delivery],
        pending: u32,
        remember: &mut dyn FnMut(Life) -> Result<()>,
    ) -> Result<()> {
        let at = RealTime.now();
        self.progress.advance(deliveries, pending);
        let Outlet { writer, annotator, progress, gaps, not_valid, new } = self;
        new.model = deliveries.iter().find_map(model).or(new.model);
        progress.around(|| {
            for (position, delivery) in deliveries.iter().enumerate() {
                for record in annotator.write(delivery, writer.as_mut())? {
                    if let Record::Event(event) = &record {
                        let arrived = Arrived { record: event.into(), at };
                        new.first.get_or_insert(arrived);
                        new.last = Some(arrived);
                    }
                    match record {
                        Record::Event(event) if event.is_odd() => {
                            *not_valid += 1;
                            if *not_valid <= TOLD {
                                let why = event.note().unwrap_or_default();
                                warn(format_args!("entry {} is not valid: {why}", event.number));
                            }
                        }
                        Record::Event(_) => {}
                        Record::Loss(loss) => {
                            *gaps += 1;
                            if *gaps <= TOLD {
                                tell(&loss, &deliveries[position..]);
                            }
                        }
                    }
                }
            }
            if deliveries.is_empty() {
                return Ok(());
            }
            remember(annotator.life())?;
            Ok(writer.flush()?)
        })
    }

    /// Says how the next life of the log is called, unless a name was drawn before.
    pub(crate) fn name_next_life(&mut self, name: Option<Life>) {
        self.annotator.name_next_life(name);
    }

    /// Says that the following entries are unrelated to those before.
    pub(crate) fn begin_anew(&mut self) {
        self.annotator.begin_anew();
    }

    /// Passes on what is due even when nothing was delivered, such as the header of a file.
    pub(crate) fn flush(&mut self) -> Result<()> {
        Ok(self.writer.flush()?)
    }

    /// Passes on what is due at the end, and reports what was only counted.
    pub(crate) fn finish(&mut self) -> Result<()> {
        self.progress.finish();
        if let Some(more) = self.not_valid.checked_sub(TOLD).filter(|&more| more > 0) {
            let entries = if more == 1 { "entry is" } else { "entries are" };
            warn(format_args!("{more} more {entries} not valid; all are delivered, with a note"));
        }
        if let Some(more) = self.gaps.checked_sub(TOLD).filter(|&more| more > 0) {
            let gaps = if more == 1 { "gap" } else { "gaps" };
            warn(format_args!("{more} more {gaps}; each is in the output where it belongs"));
        }
        self.flush()
    }

    /// Counts a place where events may be missing without a delivery that reports it.
    pub(crate) fn miss(&mut self) {
        self.gaps += 1;
    }

    /// Fails if events are known to be missing in what was delivered.
    pub(crate) fn require_complete(&self) -> Result<()> {
        match self.gaps {
            0 => Ok(()),
            1 => Err(Failure::incomplete("the output has a gap")),
            gaps => Err(Failure::incomplete(format_args!("the output has {gaps} gaps"))),
        }
    }

    /// Whether events are known to be missing in what was delivered.
    pub(crate) fn has_gaps(&self) -> bool {
        self.gaps > 0
    }
}

fn model(delivery: &Delivery) -> Option<Model> {
    match delivery {
        Delivery::Event { model, .. } => Some(*model),
        Delivery::Lost { .. } => None,
    }
}

/// Reports a loss, together with the entry after it.
fn tell(loss: &Loss, after: &[Delivery]) {
    match place(after) {
        Some(entry) => warn(format_args!("lost ahead of entry {entry}: {}", loss.sentence())),
        None => warn(loss.sentence()),
    }
}

/// The first entry after a loss.
fn place(deliveries: &[Delivery]) -> Option<impl Display> {
    deliveries.iter().find_map(|delivery| match delivery {
        Delivery::Event { entry_number, .. } => Some(*entry_number),
        Delivery::Lost { .. } => None,
    })
}
