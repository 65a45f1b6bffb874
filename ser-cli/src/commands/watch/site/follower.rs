//! One recorder of several, read in a thread of its own.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::time::{Duration, Instant};
use std::{sync::Arc, thread};

use ser_client::{Delivery, LogFollower, LogWatcher};
use ser_observer::clock_look::NowAndThen;

use super::super::{Args, POLL_EVERY};
use super::Batch;
use crate::buses::Buses;
use crate::closed_stdout;
use crate::connection::{self, ConnectionArgs, HEARTBEAT};
use crate::error::{Failure, Result, inform};
use crate::keeper::{self, Keeper};
use crate::kept::KeptRecords;
use crate::log_identity;
use crate::original::Originals;
use crate::output::{Annotator, Event, EventWriter, Loss, Record, RecorderColumn};
use crate::suppressed::LeftOut;
use ser_evidence::record::{self as evidence, EntryRecord};

/// How long a recorder that has failed is left alone.
const ASK_AGAIN: Duration = Duration::from_secs(10);

/// A recorder, and what is needed to follow it.
pub(super) struct Follower<'a> {
    pub(super) column: RecorderColumn,
    pub(super) connection: ConnectionArgs,
    pub(super) args: &'a Args,
    pub(super) stop: &'a Arc<AtomicBool>,
    pub(super) buses: &'a Buses,
}

impl Follower<'_> {
    /// Its name, what is kept of its clock, and the entry that was delivered last.
    pub(super) fn remembered(&self) -> (String, Option<KeptRecords>, Option<EntryRecord>) {
        let kept = KeptRecords::of(&self.args.state, &self.connection).ok();
        let last = keeper::last_delivered(&self.args.state, &self.connection, None);
        (self.column.name.clone(), kept, last)
    }

    /// Hands over what the recorder records, until an interrupt or until nobody listens.
    pub(super) fn run(&self, place: usize, batches: &SyncSender<Batch>) {
        let mut has_failed = false;
        while !self.is_stopped() {
            match self.follow(place, batches, &mut has_failed) {
                Ok(()) | Err(Failure::Interrupted | Failure::OutputClosed) => return,
                Err(failure) => {
                    if !std::mem::replace(&mut has_failed, true) {
                        failure.warn_of(&self.column.name);
                        inform(format_args!(
                            "{} is asked again every ten seconds",
                            self.column.name
                        ));
                    }
                    self.pause();
                }
            }
        }
    }

    fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed) || closed_stdout::reader_is_gone()
    }

    fn pause(&self) {
        let until = Instant::now() + ASK_AGAIN;
        while Instant::now() < until && !self.is_stopped() {
            thread::sleep(HEARTBEAT);
        }
    }

    /// Follows the log until something fails.
    fn follow(
        &self,
        place: usize,
        batches: &SyncSender<Batch>,
        has_failed: &mut bool,
    ) -> Result<()> {
        let mut keeper = Keeper::load(&self.args.state, &self.connection)?;
        let mut unit = self.buses.open(&self.connection)?;
        let known = self.connection.known_log_size();
        let size = connection::log_size(&mut unit, known, keeper.size())?;
        let originals = Originals::of(&self.args.state, &self.connection)?;
        let met = log_identity::meet(&mut unit, &mut keeper, &originals)?;
        let follower = match LogFollower::new(keeper.cursor(), size) {
            follower if met.is_another => follower.of_another_log(),
            follower => follower,
        };
        let interval = self.args.interval.unwrap_or(POLL_EVERY);
        let may_shorten = self.args.interval.is_none();
        let mut watcher = LogWatcher::polling(follower, interval, may_shorten);
        let mut annotator = Annotator::new(keeper.life()?, keeper.before());
        let kept = KeptRecords::of(&self.args.state, &self.connection)?;
        let mut clock = met.log.map(|log| NowAndThen::new(log.life));
        let left_out = KeptRecords::of(&self.args.state, &self.connection)?;
        let left_out = LeftOut::new(Some(left_out), self.connection.points()).of(&self.column.name);
        let mut left_out = met.log.map(|_| left_out);
        let result = loop {
            if self.is_stopped() {
                break Ok(());
            }
            let step = watcher.step(&mut unit, HEARTBEAT, &mut |step| -> Result<()> {
                let records = records(&mut annotator, step.deliveries)?;
                keeper.name(annotator.life(), step.size)?;
                if !records.is_empty() {
                    hand_over(place, records, batches)?;
                }
                keeper.delivered(step.cursor, step.size, annotator.life())
            });
            if let Err(failure) = step {
                break Err(failure);
            }
            if std::mem::take(has_failed) {
                inform(format_args!("{}: all is well again", self.column.name));
            }
            // The list has no place for it, and it is told.
            let _ = left_out.as_mut().and_then(|left_out| left_out.look_if_due(&mut unit));
            keeper.save_if_due()?;
            let place = watcher.cursor().map(|cursor| (annotator.life(), cursor));
            if let (Some(clock), Some(place)) = (&mut clock, place) {
                let observation = clock.step(&mut unit, place);
                match observation.map_err(Failure::from) {
                    Ok(Some(seen)) => kept.add(&[evidence::Record::Clock(seen)]),
                    Ok(None) => {}
                    Err(failure) => break Err(failure),
                }
            }
        };
        if result.is_ok() {
            log_identity::remember(&mut unit, &mut keeper, met.log)?;
        }
        keeper.save().and(result)
    }
}

/// The records of deliveries.
fn records(annotator: &mut Annotator, deliveries: &[Delivery]) -> Result<Vec<Record>> {
    let mut records = Vec::new();
    for delivery in deliveries {
        records.extend(annotator.write(delivery, &mut Nowhere)?);
    }
    Ok(records)
}

/// Hands a batch over, and waits until it is written.
fn hand_over(recorder: usize, records: Vec<Record>, batches: &SyncSender<Batch>) -> Result<()> {
    let (written, is_written) = sync_channel(1);
    let batch = Batch { recorder, records, written };
    batches.send(batch).map_err(|_| Failure::OutputClosed)?;
    is_written.recv().map_err(|_| Failure::OutputClosed)
}

/// Records are returned, and need not be written.
struct Nowhere;

impl EventWriter for Nowhere {
    fn event(&mut self, _: &Event) -> io::Result<()> {
        Ok(())
    }

    fn lost(&mut self, _: &Loss) -> io::Result<()> {
        Ok(())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
