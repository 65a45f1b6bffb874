//! Giving what is in one archive to another one.
//!
//! Rows are given in the order of their positions, and the outlet moves on when the other archive
//! has them on its disk. After any failure the rest is given again, and what the other archive has
//! already changes nothing there.

use std::sync::atomic::{AtomicBool, Ordering};

use ser_archive::{Archive, Archived, Batch, Result};
use ser_evidence::record::{Gap, Record, Why};
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
    let mut forwarded = Forwarded { rows: rows.len() as u64, ..Forwarded::default() };
    for appended in to.append(&batches(rows))? {
        forwarded.entries += appended.entries;
        forwarded.conflicts += appended.conflicts;
    }
    *after = last;
    Ok(forwarded)
}

/// Gives what is new until the end.
pub(crate) fn keep_forwarding(forward: &Forward, open: &Open, times: &Times, stop: &AtomicBool) {
    let (mut pause, mut is_told) = (Pause::new(times), false);
    let outlet = &forward.outlet;
    loop {
        let is_last = stop.load(Ordering::Relaxed);
        let given = (|| -> Result<()> {
            let (mut from, mut to) = (open()?, (forward.open)()?);
            loop {
                let is_last = stop.load(Ordering::Relaxed);
                let given = give_next(&mut from, &mut to, outlet)?;
                if std::mem::take(&mut is_told) {
                    info!(outlet, "it takes what is archived again");
                }
                pause.is_over();
                if given.conflicts > 0 {
                    warn!(outlet, conflicts = given.conflicts, "entries contradict others there");
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
            Err(error) if !std::mem::replace(&mut is_told, true) => {
                warn!(outlet, "it does not take what is archived, which waits here: {error}");
            }
            Err(error) => debug!(outlet, "{error}"),
        }
        if is_last {
            return;
        }
        pause::wait(pause.next(), stop);
    }
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
