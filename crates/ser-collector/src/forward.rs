//! Giving what is in one archive to another one.
//!
//! Rows are given in the order of their positions, and the outlet moves on when the other archive
//! has them on its disk. After any failure the rest is given again, and what the other archive has
//! already changes nothing there.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use ser_archive::{Archive, Archived, Batch, Result};
use ser_evidence::record::{EntryRecord, Gap, Record, Why};
use ser_observer::host_reading;
use tracing::{debug, info, warn};

use crate::options::{Forward, Open, Times};
use crate::pause::{self, Pause};

/// How many rows are given at a time.
const AT_ONCE: u32 = 2000;

/// What was given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Forwarded {
    /// Rows that were gone over.
    pub rows: u64,
    /// Entries that the other archive did not have.
    pub entries: u64,
    /// Entries that contradict others there.
    pub conflicts: u64,
}

/// Gives the next rows after a position, which moves on when the other archive has them for good.
/// Returns what was given; no rows mean that it has everything.
///
/// # Errors
/// If either archive fails.
pub fn forward(from: &mut Archive, to: &mut Archive, after: &mut i64) -> Result<Forwarded> {
    let rows = from.since(*after, AT_ONCE)?;
    let Some(last) = rows.last().map(|row| row.position) else { return Ok(Forwarded::default()) };
    file_lives(from, to, &rows)?;
    let mut forwarded = Forwarded { rows: rows.len() as u64, ..Forwarded::default() };
    for appended in to.append(&batches(rows))? {
        forwarded.entries += appended.entries;
        forwarded.conflicts += appended.conflicts;
    }
    *after = last;
    Ok(forwarded)
}

/// Lets the other archive decide where each life is filed that it does not know yet, by all that is
/// here of it. What is given first may have nothing in common with what is there.
fn file_lives(from: &mut Archive, to: &mut Archive, rows: &[Archived]) -> Result<()> {
    let mut asked = BTreeSet::new();
    for Archived { collector, recorder, record, .. } in rows {
        let Record::Entry(EntryRecord { life, .. }) = record else { continue };
        if !asked.insert((collector, recorder, *life)) {
            continue;
        }
        let chain = (collector.as_str(), recorder.as_str());
        if to.knows_life(chain, *life)? {
            continue;
        }
        let mut shown: Vec<EntryRecord> = from.beginning(recorder, *life)?.into_iter().collect();
        for theirs in to.beginnings(recorder)? {
            shown.extend(from.same_entry(recorder, *life, &theirs)?);
        }
        to.file_life(chain, *life, &shown)?;
    }
    Ok(())
}

/// Gives what is new until the end.
pub(crate) fn keep_forwarding(forward: &Forward, open: &Open, times: &Times, stop: &AtomicBool) {
    let mut pause = Pause::new(times);
    let (mut told, mut has_caught_up) = (None::<Instant>, false);
    let outlet = &forward.outlet;
    loop {
        let is_last = stop.load(Ordering::Relaxed);
        let given = (|| -> Result<()> {
            let (mut from, mut to) = (open()?, (forward.open)()?);
            loop {
                let is_last = stop.load(Ordering::Relaxed);
                let given = give_next(&mut from, &mut to, outlet)?;
                if told.take().is_some() {
                    info!(outlet, "what is archived is given on again");
                }
                pause.is_over();
                if given.conflicts > 0 {
                    warn!(outlet, conflicts = given.conflicts, "entries contradict others there");
                }
                if given.rows == 0 && !std::mem::replace(&mut has_caught_up, true) {
                    info!(outlet, "all that is archived was given on");
                }
                match given.rows {
                    0 if is_last => return Ok(()),
                    0 => pause::wait(times.poll, stop),
                    _ => {}
                }
            }
        })();
        match given {
            Ok(()) => return,
            Err(error) if told.is_none_or(|at| at.elapsed() >= times.tell_again) => {
                warn!(outlet, "what is archived cannot be given on and waits here: {error}");
                (told, has_caught_up) = (Some(Instant::now()), false);
            }
            Err(error) => debug!(outlet, "{error}"),
        }
        if is_last {
            return;
        }
        pause::wait(pause.next(), stop);
    }
}

/// Gives everything that is new, once.
pub(crate) fn give_all(forward: &Forward, open: &Open) -> Result<()> {
    let (mut from, mut to) = (open()?, (forward.open)()?);
    while give_next(&mut from, &mut to, &forward.outlet)?.rows > 0 {}
    Ok(())
}

fn give_next(from: &mut Archive, to: &mut Archive, outlet: &str) -> Result<Forwarded> {
    let mut position = from.outlet(outlet)?;
    let given = forward(from, to, &mut position)?;
    if given.rows > 0 {
        from.set_outlet(outlet, position)?;
    }
    Ok(given)
}

/// Neighbouring rows of one chain together.
fn batches(rows: Vec<Archived>) -> Vec<Batch> {
    let mut batches: Vec<Batch> = Vec::new();
    for Archived { collector, recorder, record, .. } in rows {
        if is_of_this_archive_alone(&record) {
            continue;
        }
        match batches.last_mut() {
            Some(batch) if (&batch.collector, &batch.recorder) == (&collector, &recorder) => {
                batch.records.push(record);
            }
            _ => batches.push(Batch {
                collector,
                recorder,
                records: vec![record],
                bookmark: None,
                joins: true,
                at: host_reading::now().utc,
            }),
        }
    }
    batches
}

/// What this archive let go is not gone elsewhere.
fn is_of_this_archive_alone(record: &Record) -> bool {
    matches!(record, Record::Gap(Gap { why: Why::Expired, .. }))
}
