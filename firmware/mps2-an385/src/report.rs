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
            log_changed(&self.diagnostics, &diagnostics);
            self.diagnostics = diagnostics;
        }
        let stack_bytes = stack::high_water();
        if stack_bytes > self.stack_bytes {
            self.stack_bytes = stack_bytes;
            defmt::info!("stack: {=usize} bytes used at most", stack_bytes);
        }
    }
}

/// One line for each counter that has moved.
fn log_changed(before: &Diagnostics, after: &Diagnostics) {
    macro_rules! each {
        ($($counter:ident),* $(,)?) => {
            // Without `..`, so that a new counter is not forgotten here.
            let Diagnostics { $($counter),* } = after;
            for (name, before, after) in [$((stringify!($counter), before.$counter, *$counter)),*] {
                if after != before {
                    defmt::warn!("{=str}: {=u32}", name, after);
                }
            }
        };
    }
    each!(
        frames_interrupted,
        frames_not_hex,
        frames_checksum,
        frames_too_long,
        frames_empty,
        line_errors,
        commands_unknown,
        commands_wrong_length,
        parameters_refused,
        commands_overrun,
        edges_lost,
        samples_missed,
        events_unreported,
        events_unprinted,
        storage_errors,
    );
}
