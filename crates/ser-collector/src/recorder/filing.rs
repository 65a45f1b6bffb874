//! From deliveries to batches: what is archived, under which life, and with which bookmark.
//!
//! A new log of a recorder that says which it has is not filed at once. Between the question and
//! the reading it may have been erased, and then its name would be that of another life. So its
//! first reading is held back until the recorder has said the same again.
//!
//! So is a reading that does not begin with the last entry that was read: nothing in the log was
//! read yet, or what was read is overwritten. What is there now may be of another log or, where
//! somebody has exchanged two cables behind a terminal server, of another recorder.

use std::time::Duration;

use ser_archive::{Batch, Bookmark};
use ser_client::{Clock, Cursor, Delivery, Lost, RealTime, Step, Unit};
use ser_evidence::record::{EntryRecord, Life, LifeRecord, Record};
use ser_observer::{LogIdentity, gap, host_reading};
use ser_proto::Model;

use super::Task;
use super::meet::{Met, draw};
use crate::trouble::Trouble;

/// The most records that are held back before the recorder is asked.
const HELD: usize = 500;

/// An entry, and when it had arrived here by this computer's monotonic clock.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arrived {
    pub(super) record: EntryRecord,
    pub(super) at: Duration,
}

/// The entries of a reading.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Arrivals {
    pub(super) first: Option<Arrived>,
    pub(super) last: Option<Arrived>,
}

/// Files what is read of a recorder.
pub(super) struct Filing<'t> {
    task: &'t Task,
    /// The life of the log that is read.
    life: Life,
    /// How the next life is called, if that is known.
    next: Option<(Life, bool)>,
    /// Whether everybody gives the life its name.
    is_told: bool,
    /// Which log the recorder says that it has.
    log: Option<LogIdentity>,
    /// Whether the recorder has said that since the log was read.
    is_confirmed: bool,
    held: Option<Vec<Record>>,
    /// Whether the next reading begins with an entry by which the log is known again.
    has_anchor: bool,
    cursor: Option<Cursor>,
    size: u16,
    model: Option<Model>,
    /// What is known of the life.
    known: Option<LifeRecord>,
    /// What of that is archived.
    told: Option<LifeRecord>,
    arrivals: Arrivals,
}

impl<'t> Filing<'t> {
    /// Begins at a bookmark, or with a log that nobody has read.
    pub(super) fn new(
        task: &'t Task,
        met: &Met,
        bookmark: Option<&Bookmark>,
        told: Option<LifeRecord>,
    ) -> Filing<'t> {
        let is_new = met.is_another || bookmark.is_none();
        let new = (met.new_life, met.is_told);
        let (life, next, is_told) = match bookmark {
            Some(bookmark) => (bookmark.life, met.is_another.then_some(new), is_told(bookmark)),
            None => (new.0, None, new.1),
        };
        let was_confirmed = bookmark.is_some_and(|bookmark| bookmark.log.is_some());
        Filing {
            task,
            life,
            next,
            is_told,
            log: met.log,
            is_confirmed: was_confirmed && !met.is_another,
            held: (is_new && met.log.is_some()).then(Vec::new),
            has_anchor: bookmark.is_some_and(|bookmark| bookmark.anchor.is_some()),
            cursor: None,
            size: 0,
            model: met.model.or(told.and_then(|told| told.model)),
            known: told,
            told,
            arrivals: Arrivals::default(),
        }
    }

    /// The life that is read, and how far.
    pub(super) fn place(&self) -> Option<(Life, Cursor)> {
        Some((self.life, self.cursor?))
    }

    /// Which log the recorder says that it has.
    pub(super) const fn log(&self) -> Option<LogIdentity> {
        self.log
    }

    /// What was last archived of the life.
    pub(super) const fn told(&self) -> Option<LifeRecord> {
        self.told
    }

    /// Whether the first reading of a new log waits to be confirmed.
    pub(super) const fn is_holding(&self) -> bool {
        self.held.is_some()
    }

    /// Whether the log is known again by an entry that was read.
    pub(super) const fn has_anchor(&self) -> bool {
        self.has_anchor
    }

    /// The entries since the last call.
    pub(super) fn take_arrivals(&mut self) -> Arrivals {
        std::mem::take(&mut self.arrivals)
    }

    /// Files a part of a reading, or holds it back. What fails will be read again.
    pub(super) fn take(&mut self, step: &Step<'_>) -> Result<(), Trouble> {
        if self.task.shared.is_stopped() {
            // What is held back will be read again.
            return Err(Trouble::Stopped);
        }
        // A slow line takes half an hour for a full log, and is no thread that hangs.
        self.task.shared.states.change(self.task.place, |_| {});
        if self.held.as_ref().is_some_and(|held| held.len() >= HELD) {
            return Err(Trouble::Held);
        }
        if self.log.is_some() && self.held.is_none() && !self.is_proven(step.deliveries) {
            self.held = Some(Vec::new());
        }
        let mut records = Vec::with_capacity(step.deliveries.len() + 1);
        for delivery in step.deliveries {
            self.add(delivery, &mut records)?;
        }
        let has_moved = self.cursor != step.cursor || self.size != step.size;
        (self.cursor, self.size) = (step.cursor, step.size);
        self.has_anchor = step.cursor.is_some_and(|cursor| cursor.anchor.is_some());
        records.extend(self.life_record());
        if let Some(held) = &mut self.held {
            held.append(&mut records);
            return Ok(());
        }
        match has_moved || !records.is_empty() {
            true => self.file(records),
            false => Ok(()),
        }
    }

    /// Whether these come after what was read before, by what the log itself shows.
    fn is_proven(&self, deliveries: &[Delivery]) -> bool {
        let is_loss = |delivery: &Delivery| {
            use Lost::{Overwritten, OverwrittenAtLeast};
            let is_overwritten =
                |lost| matches!(lost, Overwritten { .. } | OverwrittenAtLeast { .. });
            matches!(delivery, Delivery::Lost { lost, .. } if is_overwritten(*lost))
        };
        deliveries.is_empty() || (self.has_anchor && !deliveries.iter().any(is_loss))
    }

    fn add(&mut self, delivery: &Delivery, records: &mut Vec<Record>) -> Result<(), Trouble> {
        match *delivery {
            Delivery::Event { entry_number, sequence, entry, model } => {
                let (life, number, known) = (self.life, entry_number, EntryRecord::ALL_KNOWN);
                let record = EntryRecord { life, sequence, number, entry, known };
                let arrived = Arrived { record, at: RealTime.now() };
                self.arrivals.first.get_or_insert(arrived);
                self.arrivals.last = Some(arrived);
                self.model = Some(model);
                records.push(Record::Entry(record));
            }
            Delivery::Lost { after, lost } => {
                if lost == Lost::LogRestarted && self.next.is_none() && self.log.is_some() {
                    // The recorder can say which log it has now, and is asked before.
                    return Err(Trouble::NewLog);
                }
                records.push(Record::Gap(gap(self.life, after, lost)));
                if lost == Lost::LogRestarted {
                    let next = self.next.take();
                    (self.life, self.is_told) =
                        next.map_or_else(|| Ok((draw()?, false)), Ok::<_, Trouble>)?;
                }
            }
        }
        Ok(())
    }

    /// What is known of the life, if that is news.
    fn life_record(&mut self) -> Option<Record> {
        let cursor = self.cursor?;
        let (life, is_exact, model) = (self.life, cursor.is_exact, self.model);
        let size = Some(self.size);
        let record = LifeRecord { life, is_exact, model, size, erased: None };
        (self.known != Some(record)).then(|| {
            self.known = Some(record);
            Record::Life(record)
        })
    }

    /// After a reading that is held back: the recorder says again which log it has, and then the
    /// reading is filed. If it is another one by now, the reading begins anew.
    pub(super) fn confirm(&mut self, unit: &mut Unit) -> Result<(), Trouble> {
        if self.held.is_none() {
            return Ok(());
        }
        self.is_still_there(unit)?;
        let held = self.held.take().unwrap_or_default();
        self.is_confirmed = true;
        self.file(held)
    }

    /// The recorder has said which log it has after something of it was read.
    pub(super) const fn is_said(&mut self) {
        self.is_confirmed |= self.log.is_some() && self.held.is_none() && self.has_anchor;
    }

    /// Asks once more which log this is, if the recorder can say that.
    pub(super) fn is_still_there(&self, unit: &mut Unit) -> Result<(), Trouble> {
        if self.log.is_none() {
            return Ok(());
        }
        let now = unit.identity_again()?.map(|identity| LogIdentity::from(&identity));
        if now == self.log { Ok(()) } else { Err(Trouble::Unproven) }
    }

    /// Archives what is known besides entries.
    pub(super) fn note(&mut self, records: Vec<Record>) -> Result<(), Trouble> {
        if records.is_empty() { Ok(()) } else { self.file(records) }
    }

    fn file(&mut self, records: Vec<Record>) -> Result<(), Trouble> {
        let shared = &self.task.shared;
        let bookmark = self.cursor.map(|cursor| Bookmark {
            life: self.life,
            sequence: cursor.sequence,
            is_exact: cursor.is_exact,
            anchor: cursor.anchor,
            log_size: Some(self.size),
            log: self.log.filter(|_| self.is_confirmed).map(|log| log.to_bytes()),
        });
        let of_life = |record: &Record| match record {
            Record::Life(life) => Some(*life),
            _ => None,
        };
        let life = records.iter().rev().find_map(of_life);
        let gaps = records.iter().filter(|record| matches!(record, Record::Gap(_))).count();
        let batch = Batch {
            collector: shared.options.name.clone(),
            recorder: self.task.recorder.name.clone(),
            records,
            bookmark,
            joins: !self.is_told,
            at: host_reading::now().utc,
        };
        let appended = shared.writer.append(batch)?.wait()?;
        self.told = life.or(self.told);
        shared.states.change(self.task.place, |state| {
            state.entries += appended.entries;
            state.conflicts += appended.conflicts;
            state.gaps += gaps as u64;
        });
        Ok(())
    }
}

/// Whether everybody gives the life of a bookmark its name.
fn is_told(bookmark: &Bookmark) -> bool {
    let log = bookmark.log.map(LogIdentity::from_bytes);
    log.is_some_and(|log| log.life_name() == bookmark.life)
}
