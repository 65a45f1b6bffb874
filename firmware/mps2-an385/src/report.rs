//! Tells the log what the counters say.

use ser_node::Diagnostics;

use crate::stack;

/// Counters that run all the time must not fill the log.
const INTERVAL_MS: u32 = 1000;

/// What the log knows already.
pub(crate) struct Report {
    looked_ms: u32,
    diagnostics: Diagnostics,
    stack_bytes: usize,
}

impl Report {
    pub(crate) fn new(now_ms: u32) -> Report {
        Report { looked_ms: now_ms, diagnostics: Diagnostics::default(), stack_bytes: 0 }
    }

    /// Logs what has changed, once a second at most.
    pub(crate) fn pass(&mut self, now_ms: u32, diagnostics: impl FnOnce() -> Diagnostics) {
        if now_ms.wrapping_sub(self.looked_ms) < INTERVAL_MS {
            return;
        }
        self.looked_ms = now_ms;
        let diagnostics = diagnostics();
        if diagnostics != self.diagnostics {
            self.diagnostics = diagnostics;
            defmt::warn!("{}", diagnostics);
        }
        let stack_bytes = stack::high_water();
        if stack_bytes > self.stack_bytes {
            self.stack_bytes = stack_bytes;
            defmt::info!("stack: {=usize} bytes used at most", stack_bytes);
        }
    }
}
