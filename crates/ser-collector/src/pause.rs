//! Waiting, so that an end is noticed soon.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use crate::options::Times;

/// How soon an end is noticed.
pub(crate) const HEARTBEAT: Duration = Duration::from_millis(100);

/// Pauses that grow from failure to failure.
#[derive(Debug)]
pub(crate) struct Pause {
    first: Duration,
    longest: Duration,
    next: Duration,
}

impl Pause {
    pub(crate) const fn new(times: &Times) -> Pause {
        Pause { first: times.first_pause, longest: times.longest_pause, next: times.first_pause }
    }

    /// How long to wait now. It will be longer the next time.
    pub(crate) fn next(&mut self) -> Duration {
        let now = self.next.min(self.longest);
        self.next = (self.next * 2).min(self.longest);
        now
    }

    /// All is well, and the next failure is a first one.
    pub(crate) const fn is_over(&mut self) {
        self.next = self.first;
    }
}

/// Waits, unless the end comes first.
pub(crate) fn wait(time: Duration, stop: &AtomicBool) {
    let until = Instant::now() + time;
    loop {
        let left = until.saturating_duration_since(Instant::now());
        if left.is_zero() || stop.load(Ordering::Relaxed) {
            return;
        }
        thread::sleep(left.min(HEARTBEAT));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_grow_up_to_a_limit_and_begin_anew_when_all_is_well() {
        let mut pause = Pause::new(&Times::default());
        let seconds: Vec<u64> = (0..8).map(|_| pause.next().as_secs()).collect();
        assert_eq!(seconds, [1, 2, 4, 8, 16, 32, 60, 60]);
        pause.is_over();
        assert_eq!(pause.next().as_secs(), 1);
    }
}
