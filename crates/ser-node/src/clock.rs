//! Date and time: the millisecond tick plus an offset.
//!
//! Setting the clock moves the offset and never the tick. Debounce may hold a change back until
//! after the clock has been set. Such a change still gets its time from the setting that was in
//! force when it happened.

use chrono::NaiveDateTime;
use ser_proto::{ClockSource, TimeStamp};

use crate::calendar::{self, Date};
use crate::history::{History, SPAN};

/// A battery-backed clock that keeps the time while the recorder is off.
pub trait Rtc {
    /// The time now, asked once at power-up; `None` when it is not known.
    fn read(&mut self) -> Option<NaiveDateTime>;

    /// Takes over the time when the recorder's clock is set. `now` is the time of this call, not of
    /// the command's arrival.
    fn write(&mut self, now: NaiveDateTime);
}

/// No battery-backed clock: the recorder starts at 2000-01-01 00:00 each time.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoRtc;

impl Rtc for NoRtc {
    fn read(&mut self) -> Option<NaiveDateTime> {
        None
    }

    fn write(&mut self, _now: NaiveDateTime) {}
}

/// 2000-01-01 00:00, in milliseconds since 1970.
const NEVER_SET_MS: i64 = 946_684_800_000;

/// A hundred years, 1970–2069: the range that two-digit years can express.
const CENTURY_MS: i64 = 36_525 * 24 * 60 * 60 * 1000;

/// Milliseconds since 1970 at tick 0, within the hundred years. Stored in 42 bits, because many
/// offsets are remembered.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Offset([u16; 3]);

impl Offset {
    /// What unused memory holds.
    pub(crate) const NONE: Offset = Offset([0; 3]);

    /// The offset of a clock that shows `now_ms` at `tick_ms`.
    fn new(now_ms: i64, tick_ms: u64) -> Offset {
        let [a, b, c, d, e, f, ..] =
            now_ms.saturating_sub_unsigned(tick_ms).rem_euclid(CENTURY_MS).to_le_bytes();
        Offset([u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d]), u16::from_le_bytes([e, f])])
    }

    fn ms(self) -> i64 {
        let [low, middle, high] = self.0.map(i64::from);
        high << 32 | middle << 16 | low
    }
}

/// Turns ticks into date and time.
#[derive(Debug)]
pub(crate) struct Clock<'a> {
    offset: History<Offset, &'a mut [Offset; SPAN]>,
    latest: Setting,
    /// The one before it, for questions that came before the latest and are read after it.
    before: Setting,
}

/// Where the clock has its time from, and since when.
#[derive(Clone, Copy, Debug)]
struct Setting {
    source: ClockSource,
    /// When it was set, or read from the battery-backed clock, or else power-up.
    set_ms: u64,
}

impl<'a> Clock<'a> {
    /// A clock that shows `now` at `tick_ms`; 2000-01-01 when the time is not known.
    pub(crate) fn new(
        tick_ms: u64,
        now: Option<NaiveDateTime>,
        offsets: &'a mut [Offset; SPAN],
    ) -> Clock<'a> {
        let source = if now.is_some() { ClockSource::Battery } else { ClockSource::NeverSet };
        let now_ms = now.map_or(NEVER_SET_MS, to_calendar_ms);
        let offset = History::with_places(offsets, Offset::new(now_ms, tick_ms));
        let setting = Setting { source, set_ms: tick_ms };
        Clock { offset, latest: setting, before: setting }
    }

    /// Sets the clock so that it shows `now` at `tick_ms`.
    pub(crate) fn set(&mut self, tick_ms: u64, now: NaiveDateTime, source: ClockSource) {
        if tick_ms >= self.latest.set_ms {
            self.before = self.latest;
            self.latest = Setting { source, set_ms: tick_ms };
        }
        self.offset.set(tick_ms, Offset::new(to_calendar_ms(now), tick_ms));
    }

    /// Where it had its time from at `tick_ms`, and for how many whole seconds it had run on its
    /// own. Of the past, two settings are known.
    pub(crate) fn source_and_age_s(&self, tick_ms: u64) -> (ClockSource, u32) {
        let is_later = self.latest.set_ms > tick_ms;
        let Setting { source, set_ms } = if is_later { self.before } else { self.latest };
        let age_s = tick_ms.saturating_sub(set_ms) / 1000;
        (source, u32::try_from(age_s).unwrap_or(u32::MAX))
    }

    /// Calendar time of the sample of `tick_ms`, by the setting in force then.
    pub(crate) fn stamp_ms(&self, tick_ms: u64) -> i64 {
        within_century(self.offset.at_sample(tick_ms).ms(), tick_ms)
    }

    /// Calendar time at `tick_ms`, by the setting in force then. One in this very millisecond counts.
    pub(crate) fn at_ms(&self, tick_ms: u64) -> i64 {
        within_century(self.offset.at_sample(tick_ms.saturating_add(1)).ms(), tick_ms)
    }

    /// Calendar time at `tick_ms`, by the present setting.
    pub(crate) fn now_ms(&self, tick_ms: u64) -> i64 {
        within_century(self.offset.latest().ms(), tick_ms)
    }
}

/// Milliseconds since 1970, within the hundred years of two-digit years.
fn within_century(offset_ms: i64, tick_ms: u64) -> i64 {
    offset_ms.saturating_add_unsigned(tick_ms).rem_euclid(CENTURY_MS)
}

fn to_calendar_ms(time: NaiveDateTime) -> i64 {
    time.and_utc().timestamp_millis()
}

/// The date and time that many milliseconds after the start of 1970, within the hundred years of
/// two-digit years.
pub(crate) fn to_time_stamp(calendar_ms: i64) -> TimeStamp {
    const EPOCH: TimeStamp =
        TimeStamp { year: 70, month: 1, day: 1, hour: 0, minute: 0, second: 0, millisecond: 0 };
    time_stamp(calendar_ms.rem_euclid(CENTURY_MS)).unwrap_or(EPOCH)
}

fn time_stamp(calendar_ms: i64) -> Option<TimeStamp> {
    let (Date { year, month, day }, ms) = calendar::split(calendar_ms)?;
    Some(TimeStamp {
        year: u8::try_from(year % 100).ok()?,
        month,
        day,
        hour: u8::try_from(ms / 3_600_000).ok()?,
        minute: u8::try_from(ms / 60_000 % 60).ok()?,
        second: u8::try_from(ms / 1000 % 60).ok()?,
        millisecond: u16::try_from(ms % 1000).ok()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn time(text: &str) -> NaiveDateTime {
        text.parse().unwrap()
    }

    fn shows(clock: &Clock<'_>, tick_ms: u64) -> String {
        to_time_stamp(clock.stamp_ms(tick_ms)).to_string()
    }

    #[test]
    fn a_clock_that_was_never_set_starts_in_2000() {
        let mut offsets = [Offset::NONE; SPAN];
        assert_eq!(shows(&Clock::new(0, None, &mut offsets), 0), "2000-01-01T00:00:00.000");
    }

    #[test]
    fn the_clock_goes_on_from_where_it_is_set() {
        let mut offsets = [Offset::NONE; SPAN];
        let mut clock = Clock::new(5, Some(time("2026-11-22T10:00:00.000")), &mut offsets);
        assert_eq!(shows(&clock, 5), "2026-11-22T10:00:00.000");
        clock.set(1000, time("2026-11-22T12:00:00.250"), ClockSource::HostOverRs232);
        assert_eq!(to_time_stamp(clock.now_ms(1000)).to_string(), "2026-11-22T12:00:00.250");
        assert_eq!(shows(&clock, 1001), "2026-11-22T12:00:00.251");
        assert_eq!(shows(&clock, 1751), "2026-11-22T12:00:01.001");
        assert_eq!(clock.source_and_age_s(3999), (ClockSource::HostOverRs232, 2));
        // Earlier samples keep the time of the old setting.
        assert_eq!(shows(&clock, 1000), "2026-11-22T10:00:00.995");
        let at = |tick_ms| to_time_stamp(clock.at_ms(tick_ms)).to_string();
        assert_eq!(at(1000), "2026-11-22T12:00:00.250");
        assert_eq!(at(999), "2026-11-22T10:00:00.994");
        assert_eq!(clock.source_and_age_s(1000), (ClockSource::HostOverRs232, 0));
        assert_eq!(clock.source_and_age_s(999), (ClockSource::Battery, 0));
    }

    #[test]
    fn after_2069_comes_1970_as_two_digits_have_it() {
        let mut offsets = [Offset::NONE; SPAN];
        let clock = Clock::new(0, Some(time("2069-12-31T23:59:59.999")), &mut offsets);
        assert_eq!(shows(&clock, 0), "2069-12-31T23:59:59.999");
        assert_eq!(shows(&clock, 1), "1970-01-01T00:00:00.000");
    }

    #[test]
    fn a_stamp_is_what_the_calendar_library_makes_of_the_time() {
        const STEP_MS: i64 = 7 * 60 * 60 * 1000 + 61_001;
        for calendar_ms in (0..CENTURY_MS).step_by(usize::try_from(STEP_MS).unwrap()) {
            let known = chrono::DateTime::from_timestamp_millis(calendar_ms).unwrap().naive_utc();
            assert_eq!(to_time_stamp(calendar_ms), TimeStamp::try_from(known).unwrap());
        }
    }
}
