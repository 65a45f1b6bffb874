//! Local times by the million, and offsets from UTC as other formats write them.

use jiff::Timestamp;
use jiff::tz::TimeZone;

const HOUR_US: i64 = 3_600_000_000;

/// How far a zone is east of UTC at a moment, in seconds.
pub(super) fn offset_of(zone: &TimeZone, utc_us: i64) -> i32 {
    let at = Timestamp::from_microsecond(utc_us).unwrap_or_default();
    zone.to_offset(at).seconds()
}

/// An offset as COMTRADE writes it: `0`, `-5`, `+10h30`.
pub(super) fn offset_code(seconds: i32) -> String {
    let sign = if seconds < 0 { "-" } else { "+" };
    let minutes = seconds.unsigned_abs() / 60;
    match (minutes / 60, minutes % 60) {
        (0, 0) => "0".to_owned(),
        (hours, 0) => format!("{sign}{hours}"),
        (hours, minutes) => format!("{sign}{hours}h{minutes:02}"),
    }
}

/// The offsets of a zone, asked for in rising order of time: it is looked up once an hour.
#[derive(Debug)]
pub(super) struct Offsets {
    zone: TimeZone,
    /// An hour, and the offset if it is the same in all of it.
    known: Option<(i64, Option<i32>)>,
}

impl Offsets {
    pub(super) const fn of(zone: TimeZone) -> Offsets {
        Offsets { zone, known: None }
    }

    /// How far the zone is east of UTC, in seconds.
    pub(super) fn at(&mut self, utc_us: i64) -> i32 {
        let hour = utc_us.div_euclid(HOUR_US);
        let known = self.known.filter(|(known, _)| *known == hour);
        let of_hour = match known {
            Some((_, offset)) => offset,
            None => {
                let begins = hour.saturating_mul(HOUR_US);
                let [first, last] = [begins, begins.saturating_add(HOUR_US - 1)]
                    .map(|us| offset_of(&self.zone, us));
                let offset = (first == last).then_some(first);
                self.known = Some((hour, offset));
                offset
            }
        };
        of_hour.unwrap_or_else(|| offset_of(&self.zone, utc_us))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_are_written_in_hours_and_minutes_where_there_are_some() {
        let codes = [0, 3600, -5 * 3600, 37_800, -12_600, 20_700].map(offset_code);
        assert_eq!(codes, ["0", "+1", "-5", "+10h30", "-3h30", "+5h45"]);
    }

    #[test]
    fn offsets_are_those_of_the_zone_at_every_minute_of_a_year() {
        for name in ["Europe/Berlin", "Australia/Lord_Howe", "America/St_Johns", "Asia/Kathmandu"] {
            let zone = TimeZone::get(name).unwrap();
            let mut offsets = Offsets::of(zone.clone());
            for minute in 0..366 * 1440 {
                let us = 1_767_225_600_000_000 + minute * 60_000_000 + 59_999_999;
                assert_eq!(offsets.at(us), offset_of(&zone, us), "{name} {us}");
            }
        }
    }
}
