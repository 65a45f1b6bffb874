//! How time passes for a host.

use std::thread;
use std::time::{Duration, Instant};

/// How time passes for a host.
///
/// Only tests want another clock than [`RealTime`]. A test that plays the other end lets its time
/// pass in [`wait`](Clock::wait) or in its transport, and so never really waits.
pub trait Clock: Send + Sync {
    /// The time since some moment in the past.
    fn now(&self) -> Duration;

    /// Lets time pass.
    fn wait(&self, time: Duration);
}

/// The time of this computer.
#[derive(Clone, Copy, Debug)]
pub struct RealTime {
    epoch: Instant,
}

impl RealTime {
    /// A clock that reads zero now.
    #[must_use]
    pub fn new() -> RealTime {
        RealTime { epoch: Instant::now() }
    }
}

impl Default for RealTime {
    fn default() -> RealTime {
        RealTime::new()
    }
}

impl Clock for RealTime {
    fn now(&self) -> Duration {
        self.epoch.elapsed()
    }

    fn wait(&self, time: Duration) {
        thread::sleep(time);
    }
}
