//! Dates, times of day and offsets from UTC as other recorders write them.

use std::fmt;

use jiff::civil;

/// In which order a date is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum DateOrder {
    /// Month, day, year.
    Mdy,
    /// Day, month, year.
    Dmy,
    /// Year, month, day.
    Ymd,
}

impl DateOrder {
    /// All of them.
    pub const ALL: [DateOrder; 3] = [DateOrder::Mdy, DateOrder::Dmy, DateOrder::Ymd];

    /// Where year, month and day are.
    const fn places(self) -> [usize; 3] {
        match self {
            DateOrder::Mdy => [2, 0, 1],
            DateOrder::Dmy => [2, 1, 0],
            DateOrder::Ymd => [0, 1, 2],
        }
    }
}

impl DateOrder {
    /// For people.
    pub(super) const fn in_words(self) -> &'static str {
        match self {
            DateOrder::Mdy => "month, day, year",
            DateOrder::Dmy => "day, month, year",
            DateOrder::Ymd => "year, month, day",
        }
    }
}

/// As the option that chooses it.
impl fmt::Display for DateOrder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            DateOrder::Mdy => "mdy",
            DateOrder::Dmy => "dmy",
            DateOrder::Ymd => "ymd",
        })
    }
}

/// Three numbers, of which the order may be known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Date {
    numbers: [u16; 3],
    /// The place of the year, if it has four digits.
    year_at: Option<usize>,
}

/// The first year of two digits that is one of the last century.
const CENTURY: u16 = 70;

impl Date {
    /// Understands `11/22/2026`, `26/11/22`, `2026-11-22` and `22.11.2026`.
    pub(super) fn parse(text: &str) -> Option<Date> {
        let separator = text.chars().find(|letter| "/-.".contains(*letter))?;
        let mut parts = text.split(separator);
        let mut numbers = [0; 3];
        let mut year_at = None;
        for (place, number) in numbers.iter_mut().enumerate() {
            let digits = parts.next()?;
            if !digits.bytes().all(|byte| byte.is_ascii_digit()) {
                return None;
            }
            match digits.len() {
                1 | 2 => {}
                4 if year_at.is_none() => year_at = Some(place),
                _ => return None,
            }
            *number = digits.parse().ok()?;
        }
        parts.next().is_none().then_some(Date { numbers, year_at })
    }

    /// A date whose order is known.
    pub(super) fn of(date: civil::Date) -> Date {
        let (year, month, day) = (date.year(), date.month(), date.day());
        let numbers = [year.unsigned_abs(), month.unsigned_abs().into(), day.unsigned_abs().into()];
        Date { numbers, year_at: Some(0) }
    }

    /// The date, if it is one in this order.
    pub(super) fn in_order(self, order: DateOrder) -> Option<civil::Date> {
        let [year_at, month_at, day_at] = order.places();
        if self.year_at.is_some_and(|at| at != year_at) {
            return None;
        }
        let number = |at: usize| self.numbers.get(at).copied();
        let year = match number(year_at)? {
            year if self.year_at.is_some() => year,
            year if year >= CENTURY => year + 1900,
            year => year + 2000,
        };
        let small = |at: usize| i8::try_from(number(at)?).ok();
        civil::Date::new(i16::try_from(year).ok()?, small(month_at)?, small(day_at)?).ok()
    }
}

/// As it was written, with slashes.
impl fmt::Display for Date {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [one, two, three] = self.numbers;
        write!(f, "{one:02}/{two:02}/{three:02}")
    }
}

/// Nanoseconds of a second.
pub(super) const SECOND_NS: u64 = 1_000_000_000;

/// Why a text is no time of day.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NoTime {
    /// It is something else.
    Wrong,
    /// It is coarser than milliseconds.
    Coarse,
}

/// Nanoseconds since midnight: `10:00:00.250`, with one or two digits for the hour, and three to nine
/// behind the point.
pub(super) fn time_of_day(text: &str) -> Result<u64, NoTime> {
    let (ns, digits) = seconds_of_day(text).ok_or(NoTime::Wrong)?;
    if digits < 3 { Err(NoTime::Coarse) } else { Ok(ns) }
}

/// The same with any number of digits behind the point, and how many there were.
pub(super) fn seconds_of_day(text: &str) -> Option<(u64, usize)> {
    let (whole, fraction) = text.split_once(['.', ',']).unwrap_or((text, ""));
    let mut parts = whole.split(':');
    let mut number = |least: usize, limit: u64| {
        let digits = parts.next()?;
        let is_number =
            (least..=2).contains(&digits.len()) && digits.bytes().all(|byte| byte.is_ascii_digit());
        digits.parse::<u64>().ok().filter(|number| is_number && *number < limit)
    };
    let (hour, minute, second) = (number(1, 24)?, number(2, 60)?, number(2, 60)?);
    if parts.next().is_some()
        || fraction.len() > 9
        || (fraction.is_empty() && text.len() != whole.len())
    {
        return None;
    }
    let mut ns = 0;
    for place in 0..9 {
        let digit = match fraction.as_bytes().get(place) {
            None => 0,
            Some(byte) if byte.is_ascii_digit() => u64::from(byte - b'0'),
            Some(_) => return None,
        };
        ns = ns * 10 + digit;
    }
    Some((((hour * 60 + minute) * 60 + second) * SECOND_NS + ns, fraction.len()))
}

/// Seconds east of UTC: `-6`, `+5.5`, `-5h30`, `+05:30`, `+0530`, with a `t` behind as some write it.
/// Fifteen hours is the most.
pub(super) fn utc_offset(text: &str) -> Option<i32> {
    let text = text.trim();
    let text = text.strip_suffix(['t', 'T', 's', 'S']).unwrap_or(text);
    let (sign, digits) = match text.as_bytes().first()? {
        b'-' => (-1, text.get(1..)?),
        b'+' => (1, text.get(1..)?),
        _ => (1, text),
    };
    let number = |digits: &str| {
        let is_number =
            (1..=2).contains(&digits.len()) && digits.bytes().all(|b| b.is_ascii_digit());
        digits.parse::<i32>().ok().filter(|_| is_number)
    };
    let (hours, minutes) = if let Some((hours, tenths)) = digits.split_once('.') {
        let quarters = match tenths {
            "0" | "00" => 0,
            "25" => 15,
            "5" | "50" => 30,
            "75" => 45,
            _ => return None,
        };
        (number(hours)?, quarters)
    } else if let Some((hours, minutes)) = digits.split_once(['h', 'H', ':']) {
        (number(hours)?, if minutes.is_empty() { 0 } else { number(minutes)? })
    } else if digits.len() == 4 {
        (number(digits.get(..2)?)?, number(digits.get(2..)?)?)
    } else {
        (number(digits)?, 0)
    };
    (hours <= 15 && minutes < 60).then_some(sign * (hours * 3600 + minutes * 60))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn possible(text: &str) -> Vec<String> {
        let date = Date::parse(text).unwrap();
        let dates = DateOrder::ALL.iter().filter_map(|order| date.in_order(*order));
        dates.map(|date| date.to_string()).collect()
    }

    #[test]
    fn a_date_is_what_it_may_be_in_each_order() {
        assert_eq!(possible("11/22/2026"), ["2026-11-22"]);
        assert_eq!(possible("11/12/2026"), ["2026-11-12", "2026-12-11"]);
        assert_eq!(possible("26/11/22"), ["2022-11-26", "2026-11-22"]);
        assert_eq!(possible("2026-11-22"), ["2026-11-22"]);
        assert_eq!(possible("1/2/70"), ["1970-01-02", "1970-02-01"]);
        assert_eq!(possible("02/29/2026"), [""; 0]);
        for wrong in ["", "11/22", "11/22/2026/1", "11/22/202", "a/b/c", "11//2026", "1111/22/2026"]
        {
            assert_eq!(Date::parse(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn a_time_of_day_has_milliseconds() {
        assert_eq!(time_of_day("09:58:01.900"), Ok(35_881_900_000_000));
        assert_eq!(time_of_day("9:58:01.900000001"), Ok(35_881_900_000_001));
        assert_eq!(time_of_day("23:59:59,999"), Ok(86_399_999_000_000));
        for coarse in ["10:00:00", "10:00:00.25"] {
            assert_eq!(time_of_day(coarse), Err(NoTime::Coarse), "{coarse}");
        }
        for wrong in [
            "",
            "10:00",
            "24:00:00.000",
            "10:60:00.000",
            "10:00:60.000",
            "10:0:00.000",
            "10:00:00.",
            "10:00:00.0000000000",
            "10:00:00.2x0",
            "10:00:00:00.000",
            "+1:00:00.000",
        ] {
            assert_eq!(time_of_day(wrong), Err(NoTime::Wrong), "{wrong}");
        }
    }

    #[test]
    fn offsets_are_understood_as_people_write_them() {
        for (text, minutes) in [
            ("-6", -360),
            ("+5.5", 330),
            ("-5h30", -330),
            ("+1h00", 60),
            ("-4t", -240),
            ("0", 0),
            ("+05:30", 330),
            ("+0530", 330),
            (" -3.5 ", -210),
            ("10", 600),
        ] {
            assert_eq!(utc_offset(text), Some(minutes * 60), "{text}");
        }
        for wrong in ["", "-", "x", "16", "5h60", "5.3", "--5", "+5:3:0", "5 h"] {
            assert_eq!(utc_offset(wrong), None, "{wrong}");
        }
    }

    proptest! {
        #[test]
        fn no_text_is_too_much(text: String) {
            let _ = (Date::parse(&text), time_of_day(&text), utc_offset(&text));
        }
    }
}
