//! Looking after the archive once a day: what is old is let go, and the heads of the chains are
//! told.
//!
//! A head that was told can be held against the archive later: rows that were taken away at the end
//! leave no other trace.

use std::fmt::Write;
use std::sync::atomic::{AtomicBool, Ordering};

use ser_archive::{Archive, Keep, Result};
use ser_observer::host_reading;
use tracing::{info, warn};

use crate::options::{Open, Options};
use crate::pause;

/// Looks after the archive now and then until the end, and tells the heads at last.
pub(crate) fn look_after(options: &Options, open: &Open, stop: &AtomicBool) {
    loop {
        if let Err(error) = open().and_then(|mut archive| look(options, &mut archive)) {
            warn!("the archive could not be looked after: {error}");
        }
        pause::wait(options.times.look_after_archive, stop);
        if stop.load(Ordering::Relaxed) {
            return;
        }
    }
}

fn look(options: &Options, archive: &mut Archive) -> Result<()> {
    let now = host_reading::now().utc;
    let since = options
        .keep_for
        .map(|time| now.after(-i64::try_from(time.as_micros()).unwrap_or(i64::MAX)));
    let keep = Keep { since, bytes: options.keep_bytes };
    if keep != Keep::default() {
        let gone = archive.expire(keep, now)?;
        if gone.entries > 0 {
            info!(entries = gone.entries, gaps = gone.gaps, "old entries were let go");
        }
        if gone.is_held_back {
            warn!("old entries are kept, because an outlet does not have them yet");
        }
    }
    tell_heads(archive)
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
