//! The heartbeat (chapter 5, GENI OK Status): the board sets a flag, and the host clears it.

use crate::elapsed::elapsed_ms;
use crate::event::Failure;
use crate::map;
use crate::ram::SharedRam;

/// The tick at which the flag was last seen.
#[derive(Debug)]
pub(super) struct Heart {
    last_beat_ms: u32,
}

impl Heart {
    pub(super) const fn new() -> Heart {
        Heart { last_beat_ms: 0 }
    }

    /// Counts the board as alive now.
    pub(super) fn begin(&mut self, now_ms: u32) {
        self.last_beat_ms = now_ms;
    }

    /// Whether there was a beat since the last call.
    ///
    /// The flag is checked before the clock, because a host that was away for long finds it set by
    /// a healthy board.
    pub(super) fn watch<R: SharedRam>(
        &mut self,
        ram: &mut R,
        now_ms: u32,
        patience_ms: u32,
    ) -> Result<bool, Failure> {
        if ram.read(map::STATUS_OK) == 1 {
            ram.write(map::STATUS_OK, 0);
            self.last_beat_ms = now_ms;
            return Ok(true);
        }
        if elapsed_ms(now_ms, self.last_beat_ms) < patience_ms {
            return Ok(false);
        }
        match ram.read(map::STATUS_FAULTS) {
            0 => Err(Failure::NoHeartbeat),
            faults => Err(Failure::Hardware { faults }),
        }
    }
}
