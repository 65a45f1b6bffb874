//! Numbers and times as bytes. A list of millions of rows consists of little else, and the general
//! machinery of formats takes longer for them than everything before it.

use std::io::Write;

use jiff::Timestamp;
use ser_proto::TimeStamp;

const DAY_US: i64 = 86_400_000_000;

/// Adds a number.
pub(crate) fn push_number(line: &mut Vec<u8>, number: u64) {
    line.extend_from_slice(itoa::Buffer::new().format(number).as_bytes());
}

/// Adds the last digits of a number, up to four.
pub(crate) fn push_digits(line: &mut Vec<u8>, number: u64, count: usize) {
    let number = digits(u32::try_from(number % 10_000).unwrap_or_default());
    line.extend(number.iter().skip(number.len().saturating_sub(count)));
}

/// Adds a stamp as it is always written.
pub(crate) fn push_stamp(line: &mut Vec<u8>, stamp: &TimeStamp) {
    let TimeStamp { month, day, hour, minute, second, millisecond, .. } = *stamp;
    if [month, day, hour, minute, second].iter().any(|&field| field > 99) || millisecond > 999 {
        // Writing to a vector does not fail.
        let _ = write!(line, "{stamp}");
        return;
    }
    let year = digits(stamp.full_year().into());
    line.extend_from_slice(&year);
    for (before, field) in
        [(b'-', month), (b'-', day), (b'T', hour), (b':', minute), (b':', second)]
    {
        let [_, _, tens, ones] = digits(field.into());
        line.extend_from_slice(&[before, tens, ones]);
    }
    let [_, hundreds, tens, ones] = digits(millisecond.into());
    line.extend_from_slice(&[b'.', hundreds, tens, ones]);
}

/// Adds a stamp as a German spreadsheet reads it: `22.11.2026 10:00:00,250`.
pub(crate) fn push_german(line: &mut Vec<u8>, stamp: &TimeStamp) {
    let begin = line.len();
    push_stamp(line, stamp);
    make_german(line, begin);
}

/// Makes `22.11.2026 10:00:00,250` of the last text, if it begins as `2026-11-22T10:00:00.250`.
fn make_german(line: &mut Vec<u8>, begin: usize) {
    let text = line.get(begin..).and_then(|text| text.get(..23));
    let Some(&[y0, y1, y2, y3, b'-', m0, m1, b'-', d0, d1, b'T', ref time @ ..]) =
        text.and_then(|text| <&[u8; 23]>::try_from(text).ok())
    else {
        return;
    };
    let [h0, h1, _, n0, n1, _, s0, s1, _, t0, t1, t2] = *time;
    let german = [
        d0, d1, b'.', m0, m1, b'.', y0, y1, y2, y3, b' ', h0, h1, b':', n0, n1, b':', s0, s1, b',',
        t0, t1, t2,
    ];
    line.truncate(begin);
    line.extend_from_slice(&german);
}

/// The last four digits of a number.
fn digits(number: u32) -> [u8; 4] {
    let digit = |unit: u32| u8::try_from(number / unit % 10).map_or(b'?', |digit| b'0' + digit);
    [digit(1000), digit(100), digit(10), digit(1)]
}

/// Moments in UTC, most of them on the day of the one before.
#[derive(Debug, Default)]
pub(crate) struct UtcTexts {
    /// A day since 1970, and its date with the `T`.
    day: Option<(i64, String)>,
}

impl UtcTexts {
    /// Adds a moment as [`rfc3339`] has it; nothing if no calendar has it.
    pub(crate) fn push(&mut self, line: &mut Vec<u8>, utc_us: i64) {
        let day = utc_us.div_euclid(DAY_US);
        if self.day.as_ref().is_none_or(|(known, _)| *known != day) {
            self.day = date(day).map(|date| (day, date));
        }
        let Some((_, date)) = &self.day else {
            line.extend_from_slice(rfc3339(utc_us).unwrap_or_default().as_bytes());
            return;
        };
        let us = u64::try_from(utc_us.rem_euclid(DAY_US)).unwrap_or_default();
        let part = |unit: u64, count: u64| u32::try_from(us / unit % count).unwrap_or_default();
        let [_, _, hour_tens, hour] = digits(part(3_600_000_000, 24));
        let [_, _, minute_tens, minute] = digits(part(60_000_000, 60));
        let [_, _, second_tens, second] = digits(part(1_000_000, 60));
        let [_, tenths, hundredths, ms] = digits(part(1000, 1000));
        let [_, us_hundreds, us_tens, us] = digits(part(1, 1000));
        line.extend_from_slice(date.as_bytes());
        line.extend_from_slice(&[
            hour_tens,
            hour,
            b':',
            minute_tens,
            minute,
            b':',
            second_tens,
            second,
            b'.',
            tenths,
            hundredths,
            ms,
            us_hundreds,
            us_tens,
            us,
            b'Z',
        ]);
    }
}

impl UtcTexts {
    /// Adds a moment as a German spreadsheet reads it: the millisecond in which it is.
    pub(crate) fn push_german(&mut self, line: &mut Vec<u8>, utc_us: i64) {
        let begin = line.len();
        self.push(line, utc_us.div_euclid(1000).saturating_mul(1000));
        make_german(line, begin);
    }
}

/// As `2026-11-22T10:00:00.250000Z`; `None` if no calendar has it.
pub(crate) fn rfc3339(utc_us: i64) -> Option<String> {
    let at = Timestamp::from_microsecond(utc_us).ok()?;
    Some(at.strftime("%Y-%m-%dT%H:%M:%S.%6fZ").to_string())
}

/// The date of a day, with the `T` after it; `None` if a calendar does not have all of the day.
fn date(day: i64) -> Option<String> {
    let begins = day.checked_mul(DAY_US)?;
    rfc3339(begins.checked_add(DAY_US - 1)?)?;
    let text = rfc3339(begins)?;
    Some(text.strip_suffix("00:00:00.000000Z")?.to_owned())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn every_stamp_is_as_it_is_displayed(fields: (u8, u8, u8, u8, u8, u8, u16)) {
            let (year, month, day, hour, minute, second, millisecond) = fields;
            for narrow in [1, 3] {
                let stamp = TimeStamp {
                    year,
                    month: month / narrow,
                    day: day / narrow,
                    hour: hour / narrow,
                    minute: minute / narrow,
                    second: second / narrow,
                    millisecond: if narrow == 1 { millisecond } else { millisecond % 1000 },
                };
                let mut line = Vec::new();
                push_stamp(&mut line, &stamp);
                prop_assert_eq!(String::from_utf8(line).unwrap(), stamp.to_string());
            }
        }

        #[test]
        fn every_moment_is_as_jiff_has_it(near: i32, far: i64) {
            let mut texts = UtcTexts::default();
            // The ends of jiff's calendar are within a day of these.
            let ends = [-377_705_023_201_000_000, 253_402_207_200_999_999];
            let others = ends.map(|end| end + i64::from(near) * 100);
            let moments = [i64::from(near), i64::from(near) * 1_000_000, far, far / 100, far / 100];
            for us in moments.into_iter().chain(others) {
                let mut line = Vec::new();
                texts.push(&mut line, us);
                let text = String::from_utf8(line).unwrap();
                prop_assert_eq!(text, rfc3339(us).unwrap_or_default());
            }
        }
    }

    #[test]
    fn numbers_are_decimal() {
        let mut line = Vec::new();
        [0, 7, u64::MAX].into_iter().for_each(|number| push_number(&mut line, number));
        assert_eq!(line, b"0718446744073709551615");
    }
}
