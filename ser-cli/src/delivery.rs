//! Where deliveries go: events and losses to standard output, losses also to standard error, the rest to the progress
//! bar.

use std::fmt::Display;

use ser_client::Delivery;

use crate::error::{Failure, Result, warn};
use crate::output::{self, Annotator, EventWriter, Format, Life, Record};
use crate::progress::Progress;

/// Entries that cannot be and are told of one by one; more are only counted.
const ODD_TOLD: u32 = 3;

/// Writes what a reading brings.
pub(crate) struct Outlet {
    writer: Box<dyn EventWriter>,
    annotator: Annotator,
    progress: Progress,
    losses: u32,
    odd: u32,
}

impl Outlet {
    /// On standard output, with a bar if the download is long; for a log of this life.
    pub(crate) fn new(format: Format, life: Life) -> Outlet {
        Outlet::with_progress(format, life, Progress::new())
    }

    /// On standard output, without a bar: there is no end to wait for.
    pub(crate) fn endless(format: Format, life: Life) -> Outlet {
        Outlet::with_progress(format, life, Progress::none())
    }

    fn with_progress(format: Format, life: Life, progress: Progress) -> Outlet {
        let (writer, annotator) = (output::to_stdout(format), Annotator::new(life));
        Outlet { writer, annotator, progress, losses: 0, odd: 0 }
    }

    /// The life of the log that is being read.
    pub(crate) fn life(&self) -> Life {
        self.annotator.life()
    }

    /// Writes deliveries and passes them on; `pending` more events are about to come.
    pub(crate) fn take(&mut self, deliveries: &[Delivery], pending: u32) -> Result<()> {
        self.progress.advance(deliveries, pending);
        let Outlet { writer, annotator, progress, losses, odd } = self;
        progress.around(|| {
            for (position, delivery) in deliveries.iter().enumerate() {
                match annotator.write(delivery, writer.as_mut())? {
                    Record::Event(event) if event.is_odd() => {
                        *odd += 1;
                        if *odd <= ODD_TOLD {
                            let why = event.note().unwrap_or_default();
                            warn(format_args!("entry {} cannot be as it was read: {why}", event.number));
                        }
                    }
                    Record::Event(_) => {}
                    Record::Loss(loss) => {
                        *losses += 1;
                        let place = place(&deliveries[position..]);
                        warn(place.map_or(loss.sentence(), |entry| {
                            format!("before entry {entry}: {}", loss.sentence())
                        }));
                    }
                }
            }
            if !deliveries.is_empty() {
                writer.flush()?;
            }
            Ok(())
        })
    }

    /// Passes on what is due also when nothing was delivered, such as the header of a file.
    pub(crate) fn flush(&mut self) -> Result<()> {
        Ok(self.writer.flush()?)
    }

    /// The same at the end, and tells what was only counted.
    pub(crate) fn finish(&mut self) -> Result<()> {
        self.progress.finish();
        if let Some(more) = self.odd.checked_sub(ODD_TOLD).filter(|&more| more > 0) {
            let entries = if more == 1 { "entry" } else { "entries" };
            warn(format_args!("{more} more {entries} cannot be as read; all are delivered, with a note"));
        }
        self.flush()
    }

    /// Counts a place at which something may be missing that no delivery tells of.
    pub(crate) fn miss(&mut self) {
        self.losses += 1;
    }

    /// Fails if something is known to be missing in what was delivered.
    pub(crate) fn require_complete(&self) -> Result<()> {
        match self.losses {
            0 => Ok(()),
            losses => {
                let places = if losses == 1 { "at 1 place" } else { &format!("at {losses} places") };
                Err(Failure::incomplete(format_args!("events are missing {places}")))
            }
        }
    }
}

/// The entry that comes first after a loss.
fn place(deliveries: &[Delivery]) -> Option<impl Display> {
    deliveries.iter().find_map(|delivery| match delivery {
        Delivery::Event { entry_number, .. } => Some(*entry_number),
        Delivery::Lost { .. } => None,
    })
}
