//! Looking after the archive once a day: what is old is let go, and the heads of the chains are
//! told.
//!
//! A head that was told can be held against the archive later: rows that were taken away at the end
//! leave no other trace.

use std::fmt::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use ser_archive::{Archive, Keep, Result};
use ser_evidence::time::{Moment, Utc};
use ser_observer::host_reading;
use tracing::{info, warn};

use crate::options::{Open, Options};
use crate::pause;

/// Looks after the archive now and then until the end, and tells the heads at last.
pub(crate) fn look_after(options: &Options, open: &Open, stop: &AtomicBool) {
    // A computer whose clock is wrong after it was switched on must not take everything for old.
    let mut believed = open().and_then(|mut archive| archive.last_added()).ok().flatten();
    let mut is_first = true;
    loop {
        let now = host_reading::now().utc;
        let is_credible = |time: &Duration| {
            let longest = *time + 2 * options.times.look_after_archive;
            believed.is_none_or(|before| now.since(before) <= us(longest))
        };
        let keep_for = options.keep_for.filter(is_credible);
        if keep_for == options.keep_for {
            believed = Some(now);
        } else {
            let hint =
                "is the clock of this computer right? ser-cli archive retain lets go by hand";
            warn!(hint, "nothing was added for longer than entries are kept, so none are let go");
        }
        let keep =
            Keep { since: keep_for.map(|time| now.after(-us(time))), bytes: options.keep_bytes };
        let looked = open().and_then(|mut archive| {
            let_go(keep, now, &mut archive)?;
            if is_first { Ok(()) } else { tell_heads(&mut archive) }
        });
        if let Err(error) = looked {
            warn!("the archive could not be looked after: {error}");
        }
        is_first = false;
        pause::wait(options.times.look_after_archive, stop);
        if stop.load(Ordering::Relaxed) {
            return;
        }
    }
}

fn us(time: Duration) -> i64 {
    i64::try_from(time.as_micros()).unwrap_or(i64::MAX)
}

fn let_go(keep: Keep, now: Moment<Utc>, archive: &mut Archive) -> Result<()> {
    if keep == Keep::default() {
        return Ok(());
    }
    let gone = archive.expire(keep, now)?;
    if gone.entries > 0 {
        info!(entries = gone.entries, gaps = gone.gaps, "old entries were let go");
    }
    if gone.is_held_back {
        warn!("old entries are kept, because an outlet does not have them yet");
    }
    Ok(())
}

/// Tells where each chain is, to be held against the archive later.
pub(crate) fn tell_heads(archive: &mut Archive) -> Result<()> {
    for head in archive.heads()? {
        let digest = head.digest.iter().fold(String::new(), |mut text, byte| {
            _ = write!(text, "{byte:02x}");
            text
        });
        let (collector, recorder, rows) = (&head.collector, &head.recorder, head.rows);
        info!(collector, recorder, rows, head = digest, "the head of a chain");
    }
    Ok(())
}
