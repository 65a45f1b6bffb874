//! The calendar registers of STM32 clocks (RTC version 2: F2, F4, F7, L4 …) as date and time,
//! without register access.
//!
//! The board gives access to SSR, TR and DR. This module decides when their content can be believed
//! and what its bits mean. Names and layouts are those of the reference manual (RM0090, chapter
//! "Real-time clock").
//!
//! ```text
//! TR   PM(22) hour tens(21:20) units(19:16) | minute tens(14:12) units(11:8) | second tens(6:4) units(3:0)
//! DR   year tens(23:20) units(19:16) | weekday(15:13) month tens(12) units(11:8) | day tens(5:4) units(3:0)
//! SSR  counts down from PREDIV_S to 0 in every second
//! ```
//!
//! # Design
//! The two digits of the year stand for 2000–2099. The chip takes every year divisible by four as a
//! leap year. That is right for these years, and wrong for any first year that is not a multiple of
//! four. Registers that hold no date give `None`, never a panic.
//!
//! The registers change while they are read one after the other, and a register read in the moment
//! of a change may show anything (BYPSHAD). The shadow registers would avoid that, but have to be
//! waited for. [`read`] therefore reads all three until two rounds in a row show the same.
//!
//! # Notes
//! With `PREDIV_A` 0 and `PREDIV_S` 7FFFh, a 32768 Hz crystal is read back in steps of 31 µs, at
//! the cost of a little more current from the battery. The usual values of 7Fh and 255 give 3.9 ms.
//! Writing TR begins a new second, so a time with milliseconds is written in two steps:
//! [`Calendar::from_date_time`], then the [`Shift`]. ISR's INITS bit says whether the calendar has
//! been set since the backup domain got power.

use chrono::{Datelike, NaiveDate, NaiveDateTime, Timelike};
use ser_node::calendar::{Date, date_time};

/// The registers that hold date and time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Calendar {
    /// Time register.
    pub tr: u32,
    /// Date register.
    pub dr: u32,
}

/// The content of the shift register that sets the fraction of the second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Shift {
    /// Whether a second is added (ADD1S).
    pub add_second: bool,
    /// By how many steps of SSR the clock is set back (SUBFS).
    pub subtract: u16,
}

/// The registers themselves, each read from the clock at the moment of the call.
pub trait CalendarRegisters {
    /// Sub-second register.
    fn ssr(&mut self) -> u16;

    /// Time register.
    fn tr(&mut self) -> u32;

    /// Date register.
    fn dr(&mut self) -> u32;
}

/// Rounds before the read is given up. The fastest register changes every 31 µs, and a round takes
/// less than one such step.
const MAX_ROUNDS: u32 = 16;

/// SSR and the calendar, from one moment. `None` when they never stand still, which does not happen
/// with a working clock.
///
/// The clock has not moved between two looks at an equal SSR, because a whole second is longer than
/// any round takes. Date and time read in between are from that moment.
pub fn read(registers: &mut impl CalendarRegisters) -> Option<(u16, Calendar)> {
    let mut round = || {
        let ssr = registers.ssr();
        (ssr, Calendar { tr: registers.tr(), dr: registers.dr() })
    };
    let mut before = round();
    (0..MAX_ROUNDS).find_map(|_| {
        let now = round();
        let stands_still = now == before;
        before = now;
        stands_still.then_some(now)
    })
}

const FIRST_YEAR: u16 = 2000;
const PM: u32 = 1 << 22;
const NANOSECONDS: i64 = 1_000_000_000;

impl Calendar {
    /// The registers for a time without its fraction. `None` outside of 2000–2099.
    #[must_use]
    pub fn from_date_time(time: NaiveDateTime) -> Option<Calendar> {
        let Date { year, month, day } = Date::of(time)?;
        let year = year.checked_sub(FIRST_YEAR)?;
        Some(Calendar {
            tr: to_bcd(time.hour()) << 16 | to_bcd(time.minute()) << 8 | to_bcd(time.second()),
            dr: to_bcd(year.into()) << 16
                | time.weekday().number_from_monday() << 13
                | to_bcd(month.into()) << 8
                | to_bcd(day.into()),
        })
    }

    /// Date and time in the registers; `ssr` and `prediv_s` give the fraction. `None` when they
    /// hold none.
    ///
    /// After a shift SSR may be greater than `PREDIV_S` for up to a second: the clock is then that
    /// much behind the full second that TR shows.
    #[must_use]
    pub fn to_date_time(self, ssr: u16, prediv_s: u16) -> Option<NaiveDateTime> {
        if self.tr & PM != 0 {
            return None;
        }
        let year = i32::from(FIRST_YEAR).checked_add_unsigned(from_bcd(self.dr >> 16, 0xFF)?)?;
        let date =
            NaiveDate::from_ymd_opt(year, from_bcd(self.dr >> 8, 0x1F)?, from_bcd(self.dr, 0x3F)?)?;
        let hour = from_bcd(self.tr >> 16, 0x3F)?;
        let second =
            date.and_hms_opt(hour, from_bcd(self.tr >> 8, 0x7F)?, from_bcd(self.tr, 0x7F)?)?;
        let nanoseconds = ahead_ns(ssr, prediv_s);
        let second = second.and_utc().timestamp() + nanoseconds.div_euclid(NANOSECONDS);
        let nanosecond = u32::try_from(nanoseconds.rem_euclid(NANOSECONDS)).ok()?;
        date_time(second * 1000)?.with_nanosecond(nanosecond)
    }
}

impl Shift {
    /// The shift that sets the fraction of the second, to be written right after a calendar with
    /// the whole seconds of `time` was started. `None` when the fraction is less than a step.
    ///
    /// A clock can only be set back, by less than a second, so a whole second is added at the same
    /// time.
    #[must_use]
    pub fn to_fraction_of(time: NaiveDateTime, prediv_s: u16) -> Option<Shift> {
        let steps = i64::from(prediv_s) + 1;
        // chrono expresses a leap second as more than a second.
        let nanoseconds = i64::from(time.nanosecond()).min(NANOSECONDS - 1);
        let ahead = nanoseconds * steps / NANOSECONDS;
        let subtract = u16::try_from(steps - ahead).ok()?;
        (ahead != 0).then_some(Shift { add_second: true, subtract })
    }
}

/// How far the clock is ahead of the full second, in nanoseconds; negative for up to a second after
/// a shift.
fn ahead_ns(ssr: u16, prediv_s: u16) -> i64 {
    let steps = i64::from(prediv_s) + 1;
    let ahead = i64::from(prediv_s) - i64::from(ssr);
    ahead * NANOSECONDS / steps
}

fn to_bcd(number: u32) -> u32 {
    ((number / 10) << 4) | (number % 10)
}

/// The number in the low bits that `mask` leaves; `None` when they hold no decimal digits.
fn from_bcd(bits: u32, mask: u32) -> Option<u32> {
    let bits = bits & mask;
    let (tens, units) = (bits >> 4, bits & 0xF);
    (tens <= 9 && units <= 9).then_some(tens * 10 + units)
}

#[cfg(test)]
mod tests {
    use chrono::TimeDelta;
    use proptest::prelude::*;

    use super::*;

    fn time(text: &str) -> NaiveDateTime {
        text.parse().unwrap()
    }

    #[test]
    fn a_date_stands_in_the_registers_as_the_manual_draws_it() {
        // A Sunday.
        let registers = Calendar::from_date_time(time("2026-11-22T19:58:37")).unwrap();
        assert_eq!(registers, Calendar { tr: 0x0019_5837, dr: 0x0026_F122 });
        assert_eq!(registers.to_date_time(0xFF, 0xFF), Some(time("2026-11-22T19:58:37")));
    }

    #[test]
    fn the_fraction_counts_down() {
        let registers = Calendar::from_date_time(time("2026-11-22T19:58:37")).unwrap();
        assert_eq!(registers.to_date_time(0x7F, 0xFF), Some(time("2026-11-22T19:58:37.500")));
        assert_eq!(registers.to_date_time(0, 999), Some(time("2026-11-22T19:58:37.999")));
        // A quarter of a second behind, for a moment after a shift.
        assert_eq!(registers.to_date_time(0x13F, 0xFF), Some(time("2026-11-22T19:58:36.750")));
    }

    #[test]
    fn leap_years_are_where_the_chip_expects_them() {
        for (year, leap) in [(2000, true), (2024, true), (2026, false), (2028, true), (2096, true)]
        {
            let new_year =
                NaiveDate::from_ymd_opt(year, 1, 1).unwrap().and_hms_opt(0, 0, 0).unwrap();
            let digits = Calendar::from_date_time(new_year).unwrap().dr >> 16;
            assert_eq!(from_bcd(digits, 0xFF).unwrap().is_multiple_of(4), leap, "{year}");
        }
    }

    #[test]
    fn registers_without_a_date_are_no_date() {
        let good = Calendar::from_date_time(time("2026-11-22T19:58:37")).unwrap();
        let bad = [
            // As after the very first power-up: month and day are 0 or 1, the year is 2000.
            Calendar { dr: 0, ..good },
            Calendar { dr: 0x0026_F322, ..good },
            Calendar { dr: 0x0026_E230, ..good },
            Calendar { dr: 0x002A_F122, ..good },
            Calendar { tr: 0x0024_0000, ..good },
            Calendar { tr: 0x0019_6037, ..good },
            Calendar { tr: 0x0019_587F, ..good },
            Calendar { tr: 0x0047_5837, ..good },
            Calendar { tr: u32::MAX, dr: u32::MAX },
        ];
        for registers in bad {
            assert_eq!(registers.to_date_time(0, 0xFF), None, "{registers:x?}");
        }
        assert_eq!(Calendar::from_date_time(time("1999-12-31T23:59:59")), None);
        assert_eq!(Calendar::from_date_time(time("2100-01-01T00:00:00")), None);
    }

    #[test]
    fn a_shift_adds_a_second_and_takes_the_rest_back() {
        let shift = Shift::to_fraction_of(time("2026-11-22T10:00:00.250"), 0xFF);
        assert_eq!(shift, Some(Shift { add_second: true, subtract: 0xC0 }));
        assert_eq!(Shift::to_fraction_of(time("2026-11-22T10:00:00.003"), 0xFF), None);
        assert_eq!(Shift::to_fraction_of(time("2026-11-22T10:00:00"), 0x7FFF), None);
    }

    /// A clock that takes a step before some of the looks at its registers, counted from 0. That
    /// look may then show anything.
    struct Moving {
        steps_at: fn(u32, u32) -> bool,
        argument: u32,
        /// Bits that are flipped in a look at the moment of a step.
        torn: u32,
        looks: u32,
        ssr: u16,
        second: NaiveDateTime,
    }

    impl Moving {
        /// A clock one step before the new year.
        fn new(steps_at: fn(u32, u32) -> bool, argument: u32, torn: u32) -> Moving {
            Moving {
                steps_at,
                argument,
                torn,
                looks: 0,
                ssr: 0,
                second: time("2026-12-31T23:59:59"),
            }
        }

        fn calendar(&self) -> Calendar {
            Calendar::from_date_time(self.second).unwrap()
        }

        fn look(&mut self, register: fn(&Moving) -> u32) -> u32 {
            let steps = (self.steps_at)(self.looks, self.argument);
            self.looks += 1;
            if !steps {
                return register(self);
            }
            if let Some(ssr) = self.ssr.checked_sub(1) {
                self.ssr = ssr;
            } else {
                self.ssr = 0x7FFF;
                self.second += TimeDelta::seconds(1);
            }
            register(self) ^ self.torn
        }
    }

    impl CalendarRegisters for Moving {
        fn ssr(&mut self) -> u16 {
            let [low, high, ..] = self.look(|clock| clock.ssr.into()).to_le_bytes();
            u16::from_le_bytes([low, high])
        }

        fn tr(&mut self) -> u32 {
            self.look(|clock| clock.calendar().tr)
        }

        fn dr(&mut self) -> u32 {
            self.look(|clock| clock.calendar().dr)
        }
    }

    const TORN: [u32; 4] = [0, 1, 0x0055_5555, u32::MAX];

    #[test]
    fn a_clock_that_moves_at_any_look_is_read_as_before_or_after() {
        let old = Moving::new(|_, _| false, 0, 0).calendar();
        let mut mixed = 0;
        for at in 0..12 {
            for torn in TORN {
                let clock = || Moving::new(|look, at| look == at, at, torn);
                let mut one_round = clock();
                let seen = (one_round.ssr(), Calendar { tr: one_round.tr(), dr: one_round.dr() });
                let mut clock = clock();
                let read = read(&mut clock);
                let new = (0x7FFF, Calendar::from_date_time(time("2027-01-01T00:00:00")).unwrap());
                assert!(
                    read == Some((0, old)) || read == Some(new),
                    "at {at}, {torn:x}: {read:x?}"
                );
                mixed += u32::from(seen != (0, old) && seen != new);
            }
        }
        // A single round would be wrong at each of the three looks, at two of them even without
        // noise.
        assert_eq!(mixed, 3 * 3 + 2);
    }

    #[test]
    fn a_clock_that_moves_again_and_again_is_read_when_it_stands_still_for_two_rounds() {
        for every in 7..20 {
            for torn in TORN {
                let mut clock = Moving::new(|look, every| look % every == every - 1, every, torn);
                let (ssr, calendar) = read(&mut clock).expect("two rounds without a step");
                assert_eq!(
                    (ssr, calendar),
                    (clock.ssr, clock.calendar()),
                    "every {every}, {torn:x}"
                );
            }
        }
    }

    #[test]
    fn registers_that_never_stand_still_are_given_up() {
        let mut clock = Moving::new(|_, _| true, 0, 0);
        assert_eq!(read(&mut clock), None);
        assert_eq!(clock.looks, 3 * (MAX_ROUNDS + 1));
    }

    proptest! {
        #[test]
        fn every_time_of_the_century_comes_back(seconds in 0..3_155_760_000_i64, ms in 0..1000_i64) {
            let prediv_s = 0x7FFF;
            let written = time("2000-01-01T00:00:00") + TimeDelta::milliseconds(seconds * 1000 + ms);
            prop_assume!(written.year() < 2100);
            let mut registers = Calendar::from_date_time(written).unwrap();
            let mut ssr = prediv_s;
            // What the chip does on a shift right after the start of a second.
            if let Some(shift) = Shift::to_fraction_of(written, prediv_s) {
                prop_assert!(shift.add_second && shift.subtract <= prediv_s);
                let second = registers.to_date_time(prediv_s, prediv_s).unwrap() + TimeDelta::seconds(1);
                prop_assume!(second.year() < 2100);
                registers = Calendar::from_date_time(second).unwrap();
                ssr += shift.subtract;
            }
            let read = registers.to_date_time(ssr, prediv_s).unwrap();
            prop_assert!((written - read).abs() < TimeDelta::microseconds(31), "{} instead of {}", read, written);
        }

        #[test]
        fn no_registers_make_it_panic(tr: u32, dr: u32, ssr: u16, prediv_s: u16, seconds in 0..4_000_000_000_i64) {
            let _ = Calendar { tr, dr }.to_date_time(ssr, prediv_s);
            let _ = Shift::to_fraction_of(time("2000-01-01T00:00:00") + TimeDelta::seconds(seconds), prediv_s);
        }
    }
}
