//! How time passes for a host.

use std::thread;
use std::time::Duration;

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

/// The time of this computer: its monotonic clock, the same for all that ask for it.
///
/// On Linux it counts from the start of the system and runs also while the computer sleeps, so that
/// two programs can compare what they saw. Elsewhere it counts from some moment of this program.
#[derive(Clone, Copy, Debug, Default)]
pub struct RealTime;

impl RealTime {
    /// The clock.
    #[must_use]
    pub const fn new() -> RealTime {
        RealTime
    }
}

impl Clock for RealTime {
    fn now(&self) -> Duration {
        monotonic()
    }

    fn wait(&self, time: Duration) {
        thread::sleep(time);
    }
}

#[cfg(target_os = "linux")]
fn monotonic() -> Duration {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Boottime);
    // It is never negative.
    Duration::try_from(now).unwrap_or_default()
}

#[cfg(not(target_os = "linux"))]
fn monotonic() -> Duration {
    static EPOCH: std::sync::OnceLock<std::time::Instant> = std::sync::OnceLock::new();
    EPOCH.get_or_init(std::time::Instant::now).elapsed()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_have_the_same_time() {
        let (first, second, third) = (RealTime::new().now(), RealTime.now(), RealTime::new().now());
        assert!(first <= second && second <= third);
    }
}
