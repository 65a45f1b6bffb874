//! Both clocks of this computer at one instant: the one that people set, and the one that they cannot.
//!
//! Evidence is reckoned on the monotonic clock, which no time server moves. It is worth something
//! beside the name of the boot that it counts from, and UTC is needed where two computers, or two
//! boots, meet.

use std::fs;
use std::hash::{BuildHasher, RandomState};
use std::sync::OnceLock;
use std::time::{Duration, SystemTime};

use super::clock::{Clock, RealTime};

/// How often the clocks are read for one pair of readings. The program may be interrupted between
/// the two.
const LOOKS: usize = 5;

/// Both clocks of this computer at one instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HostTime {
    /// The name of the boot that [`monotonic`](Self::monotonic) counts from. Where the system gives
    /// boots no names, one that was drawn for this run of the program.
    pub boot: u128,
    /// The time of [`RealTime`].
    pub monotonic: Duration,
    /// Microseconds since the beginning of 1970, UTC.
    pub utc_us: i64,
    /// How far that may be from UTC, if the system knows.
    pub utc_doubt: Option<Duration>,
}

impl HostTime {
    /// The time now.
    #[must_use]
    pub fn now() -> HostTime {
        let looks = (0..LOOKS).map(|_| {
            let before = RealTime.now();
            let utc_us = utc_us();
            let took = RealTime.now().saturating_sub(before);
            (took, before + took / 2, utc_us)
        });
        let (_, monotonic, utc_us) = looks.min().unwrap_or_default();
        // The kernel knows, but no library that is kept well reads it from there without being half
        // a time server.
        HostTime { boot: boot(), monotonic, utc_us, utc_doubt: None }
    }

    /// What both clocks showed, or will show, at another time of the monotonic clock, if nobody set
    /// the other one in between.
    #[must_use]
    pub fn at(self, monotonic: Duration) -> HostTime {
        let us = |time: Duration| i64::try_from(time.as_micros()).unwrap_or(i64::MAX);
        let later_us = us(monotonic).saturating_sub(us(self.monotonic));
        HostTime { monotonic, utc_us: self.utc_us.saturating_add(later_us), ..self }
    }
}

fn utc_us() -> i64 {
    let us = |time: Duration| i64::try_from(time.as_micros()).unwrap_or(i64::MAX);
    match SystemTime::now().duration_since(SystemTime::UNIX_EPOCH) {
        Ok(since) => us(since),
        Err(before) => us(before.duration()).saturating_neg(),
    }
}

fn boot() -> u128 {
    static BOOT: OnceLock<u128> = OnceLock::new();
    *BOOT.get_or_init(|| system_boot().unwrap_or_else(random))
}

/// The system's name for this boot.
fn system_boot() -> Option<u128> {
    if !cfg!(target_os = "linux") {
        // The monotonic clock does not count from there.
        return None;
    }
    named(&fs::read_to_string("/proc/sys/kernel/random/boot_id").ok()?)
}

/// A name like `6a5c1d1e-…`.
fn named(text: &str) -> Option<u128> {
    let digits: String = text.trim().split('-').collect();
    u128::from_str_radix(&digits, 16).ok().filter(|_| digits.len() == 32)
}

fn random() -> u128 {
    // The keys of hash tables are drawn by the system.
    let half = |place: u8| u128::from(RandomState::new().hash_one(place));
    half(0) << 64 | half(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_clocks_go_on_together() {
        let before = RealTime.now();
        let (first, second) = (HostTime::now(), HostTime::now());
        assert!(before <= first.monotonic && second.monotonic <= RealTime.now());
        assert_eq!(first.boot, second.boot);
        assert!(first.utc_us > 1_700_000_000_000_000, "this computer's clock is set");
    }

    #[test]
    fn another_time_of_one_clock_is_another_time_of_the_other() {
        let now = HostTime {
            boot: 1,
            monotonic: Duration::from_secs(10),
            utc_us: 1_000_000,
            utc_doubt: None,
        };
        assert_eq!(now.at(Duration::from_secs(12)).utc_us, 3_000_000);
        assert_eq!(now.at(Duration::from_micros(8_999_999)).utc_us, -1);
        assert_eq!(now.at(now.monotonic), now);
    }

    #[test]
    fn a_boot_has_a_name_of_128_bits() {
        let name = "6a5c1d1e-0b1f-4b0e-9b8a-0123456789ab\n";
        assert_eq!(named(name), Some(0x6a5c_1d1e_0b1f_4b0e_9b8a_0123_4567_89ab));
        assert_eq!(named("6a5c1d1e"), None);
        assert_eq!(named("no name of a boot, but as long as one"), None);
        assert_ne!(random(), random());
    }
}
