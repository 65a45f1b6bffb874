//! The battery-backed clock: adapts a driver of a clock chip to the `Rtc` that the recorder needs.
//!
//! A clock that stopped while the power was off still shows a date, and one with an empty battery
//! shows any date. A wrong time in a recorder's log is worse than none. A time is therefore
//! believed only if the chip has not lost it and it is plausible.
//!
//! # Design
//! The driver implements `rtcc::DateTimeAccess`, as the driver of the DS3231 and its relatives does
//! (crate `ds323x`), plus [`KeepsTime`] for what that trait leaves out. Faults of the clock are
//! kept in [`ClockHealth`], which the board reads after the recorder has taken the clock over.
//!
//! # Tradeoffs
//! Chips that count whole seconds are read as the middle of the second that they show, and are set
//! to the nearest second. The error is half a second at most each time, until a host sets the
//! recorder's clock.
//!
//! # Notes
//! `stm32f4xx-hal`'s own RTC has no such trait. In version 0.23 its `get_datetime` panics on
//! registers that hold no date and waits without bound for the shadow registers. It also counts
//! years from 1970, so the chip sees leap years where there are none. See
//! [`stm32_rtc`](crate::stm32_rtc) for the registers as date and time.

use core::sync::atomic::{AtomicU8, Ordering};

use chrono::{NaiveDate, NaiveDateTime};
use rtcc::DateTimeAccess;
use ser_node::Rtc;
use ser_node::calendar::date_time;

use crate::counter::Counter;

/// What a clock chip reports apart from the time.
pub trait KeepsTime: DateTimeAccess {
    /// The chip's resolution in milliseconds: 1000 for whole seconds, 1 for milliseconds and less.
    /// Range: 1–1000.
    const RESOLUTION_MS: u16;

    /// Whether the clock has stood still since it was last set: oscillator stopped, battery lost,
    /// or never set.
    ///
    /// # Errors
    /// When the chip does not answer.
    fn has_lost_time(&mut self) -> Result<bool, Self::Error>;

    /// Says that the clock has been set and that its time is good from now on. Clears the chip's
    /// flag.
    ///
    /// # Errors
    /// When the chip does not answer.
    fn time_is_good(&mut self) -> Result<(), Self::Error>;
}

/// State of the clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ClockState {
    /// Not asked yet.
    Unknown,
    /// It gave a time, or it has been set.
    Good,
    /// It stood still: the time was lost while the power was off.
    Lost,
    /// It shows an impossible time.
    Implausible,
    /// It does not answer.
    Silent,
}

/// The board's view of a clock that the recorder owns; for a static.
#[derive(Debug, Default)]
pub struct ClockHealth {
    state: AtomicU8,
    /// How often the clock failed to take a new time.
    pub writes_failed: Counter,
}

impl ClockHealth {
    /// Nothing is known yet.
    #[must_use]
    pub const fn new() -> ClockHealth {
        ClockHealth { state: AtomicU8::new(0), writes_failed: Counter::new() }
    }

    /// State of the clock.
    #[must_use]
    pub fn state(&self) -> ClockState {
        match self.state.load(Ordering::Relaxed) {
            1 => ClockState::Good,
            2 => ClockState::Lost,
            3 => ClockState::Implausible,
            4 => ClockState::Silent,
            _ => ClockState::Unknown,
        }
    }

    fn set(&self, state: ClockState) {
        let code = match state {
            ClockState::Unknown => 0,
            ClockState::Good => 1,
            ClockState::Lost => 2,
            ClockState::Implausible => 3,
            ClockState::Silent => 4,
        };
        self.state.store(code, Ordering::Relaxed);
    }
}

/// A clock chip as the recorder's [`Rtc`].
pub struct ClockChip<'a, C> {
    chip: C,
    not_before: NaiveDate,
    health: &'a ClockHealth,
}

/// The first year that two digits cannot say (protocol: 70–99 are 1970–1999).
const FIRST_YEAR_BEYOND: i32 = 2070;

impl<'a, C: KeepsTime> ClockChip<'a, C> {
    /// A clock that is believed from `not_before` on: the day on which the firmware or the board
    /// was made.
    pub const fn new(chip: C, not_before: NaiveDate, health: &'a ClockHealth) -> ClockChip<'a, C> {
        const {
            assert!(
                C::RESOLUTION_MS >= 1 && C::RESOLUTION_MS <= 1000,
                "see `KeepsTime::RESOLUTION_MS`"
            );
        };
        ClockChip { chip, not_before, health }
    }

    /// Ends the adapter; returns the driver.
    pub fn release(self) -> C {
        self.chip
    }

    fn examine(&mut self) -> Result<NaiveDateTime, ClockState> {
        // Asked first: a chip that has lost its time may hold values that its driver takes for an
        // error.
        if self.chip.has_lost_time().map_err(|_| ClockState::Silent)? {
            return Err(ClockState::Lost);
        }
        let shown = self.chip.datetime().map_err(|_| ClockState::Silent)?;
        let beyond = NaiveDate::from_ymd_opt(FIRST_YEAR_BEYOND, 1, 1).unwrap_or(NaiveDate::MAX);
        if shown.date() < self.not_before || shown.date() >= beyond {
            return Err(ClockState::Implausible);
        }
        // How far the time is ahead of what the chip shows, on average.
        let half_a_step_ms = i64::from(C::RESOLUTION_MS / 2);
        date_time(shown.and_utc().timestamp_millis() + half_a_step_ms)
            .ok_or(ClockState::Implausible)
    }

    fn set(&mut self, now: NaiveDateTime) -> Result<(), C::Error> {
        self.chip.set_datetime(&rounded(now, C::RESOLUTION_MS))?;
        self.chip.time_is_good()
    }
}

/// The nearest time that a chip with this resolution can show.
fn rounded(time: NaiveDateTime, resolution_ms: u16) -> NaiveDateTime {
    let resolution_ms = i64::from(resolution_ms);
    let steps = (time.and_utc().timestamp_millis() + resolution_ms / 2).div_euclid(resolution_ms);
    // Cannot fail within the years of the protocol. If it did, the exact time would be the best
    // substitute.
    date_time(steps * resolution_ms).unwrap_or(time)
}

impl<C: KeepsTime> Rtc for ClockChip<'_, C> {
    fn read(&mut self) -> Option<NaiveDateTime> {
        let examined = self.examine();
        self.health.set(examined.err().unwrap_or(ClockState::Good));
        examined.ok()
    }

    fn write(&mut self, now: NaiveDateTime) {
        match self.set(now) {
            Ok(()) => self.health.set(ClockState::Good),
            Err(_) => {
                self.health.writes_failed.count();
                self.health.set(ClockState::Silent);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use chrono::{DurationRound, TimeDelta};

    use super::*;
    use crate::flash_log::FlashHealth;
    use crate::health::Health;
    use crate::inputs::InputHealth;

    fn time(text: &str) -> NaiveDateTime {
        text.parse().unwrap()
    }

    /// A chip that counts in steps of `STEP_MS`; `None` when it is not there.
    struct Chip<const STEP_MS: u16> {
        shows: Option<NaiveDateTime>,
        lost: bool,
    }

    impl<const STEP_MS: u16> DateTimeAccess for Chip<STEP_MS> {
        type Error = ();

        fn datetime(&mut self) -> Result<NaiveDateTime, ()> {
            self.shows
                .map(|time| time.duration_trunc(TimeDelta::milliseconds(STEP_MS.into())).unwrap())
                .ok_or(())
        }

        fn set_datetime(&mut self, datetime: &NaiveDateTime) -> Result<(), ()> {
            *self.shows.as_mut().ok_or(())? = *datetime;
            Ok(())
        }
    }

    impl<const STEP_MS: u16> KeepsTime for Chip<STEP_MS> {
        const RESOLUTION_MS: u16 = STEP_MS;

        fn has_lost_time(&mut self) -> Result<bool, ()> {
            self.shows.map(|_| self.lost).ok_or(())
        }

        fn time_is_good(&mut self) -> Result<(), ()> {
            self.lost = false;
            Ok(())
        }
    }

    fn clock<'a, const STEP_MS: u16>(
        shows: Option<&str>,
        lost: bool,
        health: &'a ClockHealth,
    ) -> ClockChip<'a, Chip<STEP_MS>> {
        let made = NaiveDate::from_ymd_opt(2026, 11, 1).unwrap();
        ClockChip::new(Chip { shows: shows.map(time), lost }, made, health)
    }

    /// What the recorder is told, and the state that the board sees.
    fn read<const STEP_MS: u16>(
        shows: Option<&str>,
        lost: bool,
    ) -> (Option<NaiveDateTime>, ClockState) {
        let health = ClockHealth::new();
        assert_eq!(health.state(), ClockState::Unknown);
        let read = clock::<STEP_MS>(shows, lost, &health).read();
        (read, health.state())
    }

    #[test]
    fn a_clock_with_milliseconds_is_taken_at_its_word() {
        let now = "2026-11-22T10:00:00.250";
        assert_eq!(read::<1>(Some(now), false), (Some(time(now)), ClockState::Good));
    }

    #[test]
    fn a_clock_with_whole_seconds_is_read_in_the_middle_of_the_second() {
        for fraction in [".000", ".999"] {
            let (read, _) = read::<1000>(Some(&format!("2026-12-31T23:59:59{fraction}")), false);
            assert_eq!(read, Some(time("2026-12-31T23:59:59.500")));
        }
    }

    #[test]
    fn a_clock_that_has_stood_still_is_not_believed() {
        assert_eq!(read::<1>(Some("2026-11-22T10:00:00"), true), (None, ClockState::Lost));
    }

    #[test]
    fn a_time_that_cannot_be_is_not_believed() {
        for shows in [
            "2000-01-01T00:00:17",
            "2026-10-31T23:59:59.999",
            "2070-01-01T00:00:00",
            "2165-06-15T12:00:00",
        ] {
            assert_eq!(read::<1>(Some(shows), false), (None, ClockState::Implausible), "{shows}");
        }
        for shows in ["2026-11-01T00:00:00", "2069-12-31T23:59:59.999"] {
            assert_eq!(read::<1>(Some(shows), false), (Some(time(shows)), ClockState::Good));
        }
    }

    #[test]
    fn a_chip_that_does_not_answer_is_no_clock_and_setting_it_is_counted() {
        assert_eq!(read::<1>(None, false), (None, ClockState::Silent));
        let health = ClockHealth::new();
        let mut clock = clock::<1>(None, false, &health);
        clock.write(time("2026-11-22T10:00:00"));
        clock.write(time("2026-11-22T10:00:00"));
        assert_eq!((health.state(), health.writes_failed.get()), (ClockState::Silent, 2));
        let (inputs, storage) = (InputHealth::new(), FlashHealth::new());
        let board =
            Health { inputs: &inputs, serialisers: None, clock: &health, storage: &storage };
        assert!(board.is_broken());
    }

    #[test]
    fn setting_the_clock_makes_it_good_again() {
        let health = ClockHealth::new();
        let mut clock = clock::<1>(Some("2000-01-01T00:00:00"), true, &health);
        assert_eq!((clock.read(), health.state()), (None, ClockState::Lost));
        let now = time("2026-11-22T10:00:00.123");
        clock.write(now);
        assert_eq!(health.state(), ClockState::Good);
        assert_eq!((clock.read(), health.writes_failed.get()), (Some(now), 0));
    }

    #[test]
    fn a_clock_with_whole_seconds_is_set_to_the_nearest_one() {
        let health = ClockHealth::new();
        for (now, set) in [
            ("2026-12-31T23:59:59.499", "2026-12-31T23:59:59"),
            ("2026-12-31T23:59:59.500", "2027-01-01T00:00:00"),
        ] {
            let mut clock = clock::<1000>(Some("2026-11-22T10:00:00"), false, &health);
            clock.write(time(now));
            assert_eq!(clock.release().shows, Some(time(set)));
        }
    }
}
