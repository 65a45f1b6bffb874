//! File names by IEEE C37.232 (COMNAME): what is in a file can be read from its name.

use super::local::offset_code;

/// What a file name says.
#[derive(Clone, Copy, Debug)]
pub struct FileName<'a> {
    /// When the record begins, in microseconds of UTC.
    pub utc_us: i64,
    /// How far the times in the file are east of UTC, in seconds.
    pub offset_s: i32,
    /// The site.
    pub station: &'a str,
    /// The recorder, or what stands for several.
    pub device: &'a str,
    /// Whose it is.
    pub company: &'a str,
    /// The extension, without a dot.
    pub extension: &'a str,
}

/// The longest part of a name that comes from outside, in characters. Names of 64 characters are the
/// most that every program takes.
const MAX_PART: usize = 12;

/// As `261122,100000250,+1,NORTHFIELD,U1-SER1,COMPANY.cfg`.
#[must_use]
pub fn file_name(name: &FileName<'_>) -> String {
    let local_us = name.utc_us.saturating_add(i64::from(name.offset_s) * 1_000_000);
    let at = jiff::Timestamp::from_microsecond(local_us).unwrap_or_default();
    let (date, time) = (at.strftime("%y%m%d"), at.strftime("%H%M%S%3f"));
    let [station, device, company] = [name.station, name.device, name.company].map(part);
    let code = offset_code(name.offset_s);
    format!("{date},{time},{code},{station},{device},{company}.{}", name.extension)
}

/// A part of a name, without anything that a file system or a comma-separated name would mind.
fn part(text: &str) -> String {
    let clean = |letter: char| match letter {
        '-' | '_' | '+' => letter,
        _ if letter.is_alphanumeric() => letter,
        _ => '_',
    };
    let cleaned: String = text.trim().chars().take(MAX_PART).map(clean).collect();
    if cleaned.is_empty() { "_".to_owned() } else { cleaned }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_says_when_where_and_whose() {
        let us = 1_772_600_767_008_000;
        let name = FileName {
            utc_us: us,
            offset_s: 0,
            station: "STATION",
            device: "SER320-1",
            company: "COMPANY",
            extension: "cfg",
        };
        assert_eq!(file_name(&name), "260304,050607008,0,STATION,SER320-1,COMPANY.cfg");
        let hostile = FileName { offset_s: -12_600, station: "../a,b", device: "", ..name };
        assert_eq!(file_name(&hostile), "260304,013607008,-3h30,___a_b,_,COMPANY.cfg");
    }
}
