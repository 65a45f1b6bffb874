//! What the recorder's clock shows, and how far that is from what it should show.

use std::time::Duration;

use ser_client::{ClockLook, HostTime, Unit};
use ser_proto::ClockReading;

use crate::connection::ConnectionArgs;
use crate::error::Result;
use crate::site_file::ClockSetting;

/// How often the clock is looked at. What holds a single look up does not hold up all of them.
const LOOKS: usize = 3;

/// A recorder may know the arrival of a question by its whole millisecond only, as on a bus.
const MILLISECOND_US: i64 = 1000;

/// A recorder's clock, as this computer sees it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Clock {
    /// The last reading.
    pub(super) reading: ClockReading,
    /// How far the clock is ahead of what it should show, in microseconds: from, to. `None` if it
    /// was never set, or shows what cannot be compared.
    pub(super) ahead_us: Option<(i64, i64)>,
    /// What it should show.
    pub(super) reference: ClockSetting,
    /// Whether the site file says so; otherwise it is this computer's local time.
    pub(super) is_of_site: bool,
}

impl Clock {
    /// Looks at the clock; `None` where it cannot be asked.
    pub(super) fn of(unit: &mut Unit, connection: &ConnectionArgs) -> Result<Option<Clock>> {
        let of_site = connection.clock_setting();
        let is_of_site = of_site.is_some();
        let reference = of_site.unwrap_or_else(ClockSetting::of_this_computer);
        let mut clock: Option<Clock> = None;
        for _ in 0..LOOKS {
            let Some(look) = unit.clock_look()? else { break };
            let here = HostTime::now();
            let should = |at: Duration| reference.shown_us(here.at(at).utc_us);
            let found = ahead_us(&look, should);
            let before = clock.as_ref().and_then(|clock| clock.ahead_us);
            let ahead_us = found.map(|found| before.map_or(found, |before| both(before, found)));
            let reading = look.reading;
            clock = Some(Clock { reading, ahead_us, reference: reference.clone(), is_of_site });
        }
        Ok(clock)
    }
}

/// How far a clock was ahead, by one look. `should` is what it should show at a time of the host.
fn ahead_us(look: &ClockLook, should: impl Fn(Duration) -> Option<i64>) -> Option<(i64, i64)> {
    let ClockLook { reading, between: (from, to) } = look;
    if reading.source == ser_proto::ClockSource::NeverSet {
        return None;
    }
    let lo = reading.clock_us.checked_sub(should(*to)?)?.checked_sub(MILLISECOND_US)?;
    let hi = reading.clock_us.checked_sub(should(*from)?)?.checked_add(MILLISECOND_US)?;
    (lo <= hi).then_some((lo, hi))
}

/// What two looks know together. If they contradict each other, the clock was set in between, and
/// the later one counts.
fn both(earlier: (i64, i64), later: (i64, i64)) -> (i64, i64) {
    let (lo, hi) = (earlier.0.max(later.0), earlier.1.min(later.1));
    if lo <= hi { (lo, hi) } else { later }
}

#[cfg(test)]
mod tests {
    use ser_proto::ClockSource;

    use super::*;

    const fn us(us: u64) -> Duration {
        Duration::from_micros(us)
    }

    fn look(clock_us: i64, source: ClockSource) -> ClockLook {
        let reading = ClockReading {
            token: 1,
            clock_us,
            source,
            age_s: 0,
            doubt_us: None,
            drift_ppb: None,
            tick_us: 0,
            life: 1,
            next_sequence: 1,
            last_mark: None,
        };
        ClockLook { reading, between: (us(100), us(300)) }
    }

    #[test]
    fn a_clock_is_ahead_by_what_it_shows_less_the_time_of_the_question() {
        let should = |at: Duration| i64::try_from(at.as_micros()).ok().map(|us| us + 10_000);
        let set = look(10_250, ClockSource::HostOverRs232);
        // And a millisecond either way.
        assert_eq!(ahead_us(&set, should), Some((-1050, 1150)));
        assert_eq!(ahead_us(&look(10_250, ClockSource::NeverSet), should), None);
        assert_eq!(ahead_us(&look(i64::MIN, ClockSource::Battery), should), None);
        assert_eq!(ahead_us(&set, |_| None), None);
    }

    #[test]
    fn looks_know_more_together_unless_the_clock_was_set() {
        assert_eq!(both((-50, 150), (0, 300)), (0, 150));
        assert_eq!(both((-50, 150), (1000, 1200)), (1000, 1200));
    }
}
