//! Decides whether the watchdog may be fed.

/// Allows feeding only while both halves of the recorder make progress. The main loop proves it by
/// asking, capture by its tick.
#[derive(Clone, Copy, Debug, Default)]
pub struct Liveness {
    last_tick_ms: Option<u32>,
}

impl Liveness {
    /// Nothing has been seen yet.
    #[must_use]
    pub const fn new() -> Liveness {
        Liveness { last_tick_ms: None }
    }

    /// Called at the end of every pass of the main loop with the tick of the latest sample. True
    /// when capture has sampled since the last call, so the watchdog may be fed.
    pub fn pass(&mut self, tick_ms: u32) -> bool {
        let sampled = self.last_tick_ms != Some(tick_ms);
        self.last_tick_ms = Some(tick_ms);
        sampled
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_main_loop_that_runs_without_capture_does_not_feed() {
        let mut liveness = Liveness::new();
        assert!(liveness.pass(1));
        assert!(!liveness.pass(1));
        assert!(!liveness.pass(1));
        assert!(liveness.pass(2));
    }
}
