//! The configuration: what the channels are, and how the data is laid out.
//!
//! What devices write differs from the standard in many small ways. They are borne where the meaning
//! is beyond doubt: line ends, blanks, padding, case, a missing line of rates. What contradicts
//! itself is refused or told.

use std::collections::{HashMap, HashSet};

use super::decimal::{number, whole};
use crate::error::quoted;
use crate::import::calendar::{Date, DateOrder, seconds_of_day, utc_offset};
use crate::import::list::{When, fit};
use crate::import::notes::{Notes, Refusal};

/// More status channels than any record has.
const MOST_CHANNELS: usize = 65_536;

/// More analog channels than the standard can say.
const MOST_ANALOGS: usize = 999_999;

/// A configuration.
#[derive(Clone, Debug)]
pub(super) struct Configuration {
    /// Names of the status channels, each once.
    pub(super) names: Vec<String>,
    pub(super) analogs: usize,
    /// Sampling rates, each up to a sample; none if the stamps count.
    pub(super) rates: Vec<Rate>,
    /// How many samples are announced; 0 if nothing is.
    pub(super) samples: u64,
    /// The time of the first sample.
    pub(super) first: When,
    /// In which order the standard of its year has dates.
    pub(super) dates: Option<DateOrder>,
    pub(super) layout: Layout,
    /// A stamp is so many nanoseconds.
    pub(super) unit_ns: f64,
}

/// Samples per second up to a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rate {
    pub(super) hz: f64,
    pub(super) until: u64,
}

/// How the data is laid out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Layout {
    Ascii,
    /// With so many bytes for an analog channel.
    Binary {
        analog_len: usize,
    },
}

/// The lines, one after the other.
struct Lines<'l> {
    lines: &'l [(u64, String)],
    next: usize,
}

impl<'l> Lines<'l> {
    fn peek(&self) -> &'l str {
        self.lines.get(self.next).map_or("", |(_, text)| trimmed(text))
    }

    fn next(&mut self, what: &str) -> Result<(u64, &'l str), Refusal> {
        let last = self.lines.last().map_or(0, |(number, _)| *number);
        let found = self.lines.get(self.next).map(|(number, text)| (*number, trimmed(text)));
        self.next += 1;
        found.ok_or_else(|| Refusal::damaged(last + 1, format!("the file ends before {what}")))
    }
}

/// Without blanks and without what some devices fill the end with.
fn trimmed(text: &str) -> &str {
    text.trim_matches(|letter: char| letter.is_whitespace() || matches!(letter, '\u{1A}' | '\0'))
}

/// Analog and status channels, of a line like `5,1A,4D`.
pub(super) fn counts(line: &str) -> Option<(u64, u64, u64)> {
    let mut fields = trimmed(line).split(',');
    let mut field = |letter: &str| {
        let text = fields.next()?.trim().to_ascii_uppercase();
        whole(text.strip_suffix(letter)?)
    };
    let counts = (field("")?, field("A")?, field("D")?);
    fields.next().is_none().then_some(counts)
}

/// What a record is, apart from its rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Extent {
    /// Analog channels that were passed over.
    pub analog_channels: usize,
    /// Status channels.
    pub status_channels: usize,
}

impl Configuration {
    /// Understands the lines of a configuration, each with its number.
    pub(super) fn parse(
        lines: &[(u64, String)],
        notes: &mut Notes,
    ) -> Result<Configuration, Refusal> {
        let mut lines = Lines { lines, next: 0 };
        let (first_line, station) = lines.next("the station")?;
        let year = revision(station);
        let (number, line) = lines.next("the numbers of channels")?;
        let (total, analogs, statuses) = counts(line).ok_or_else(|| {
            Refusal::damaged(
                number,
                format!("{} are no numbers of channels", quoted(line.as_bytes())),
            )
        })?;
        if Some(total) != analogs.checked_add(statuses) {
            notes
                .remark(Some(number), format!("{total} channels are not {analogs} and {statuses}"));
        }
        if !matches!(year, Some(1991 | 1999 | 2013) | None) {
            let year = year.unwrap_or_default();
            notes.remark(
                Some(first_line),
                format!("there is no COMTRADE of {year}; read as of 1999"),
            );
        }
        let analogs = bounded(analogs, MOST_ANALOGS, "analog channels")?;
        let statuses = bounded(statuses, MOST_CHANNELS, "status channels")?;
        for _ in 0..analogs {
            lines.next("the last analog channel")?;
        }
        let names = names(&mut lines, statuses, notes)?;
        lines.next("the line frequency")?;
        let (rates, samples) = rates(&mut lines)?;
        let (first, digits) = moment(&mut lines)?;
        lines.next("the time of the trigger")?;
        let layout = layout(&mut lines)?;
        let multiplier = multiplier(&mut lines)?;
        let utc_offset_s = zone(&mut lines, year, notes);
        // With more than six decimals in the dates, stamps are nanoseconds.
        let base_ns = if digits > 6 { 1.0 } else { 1000.0 };
        Ok(Configuration {
            names,
            analogs,
            rates,
            samples,
            first: When { utc_offset_s, ..first },
            dates: (!matches!(year, None | Some(1991))).then_some(DateOrder::Dmy),
            layout,
            unit_ns: base_ns * multiplier,
        })
    }

    pub(super) fn extent(&self) -> Extent {
        Extent { analog_channels: self.analogs, status_channels: self.names.len() }
    }
}

fn bounded(count: u64, most: usize, what: &'static str) -> Result<usize, Refusal> {
    let limit = u64::try_from(most).unwrap_or(u64::MAX);
    usize::try_from(count)
        .ok()
        .filter(|count| *count <= most)
        .ok_or(Refusal::TooMuch { what, most: limit })
}

/// The year of the standard; the first one had none.
fn revision(line: &str) -> Option<u64> {
    let mut fields = line.rsplit(',').map(str::trim);
    let last = fields.next()?;
    let is_year = last.len() == 4 && fields.count() >= 2;
    whole(last).filter(|_| is_year)
}

/// The names of status channels. What has the name of another one gets its number.
fn names(lines: &mut Lines<'_>, count: usize, notes: &mut Notes) -> Result<Vec<String>, Refusal> {
    let mut names = Vec::new();
    for place in 1..=count {
        let (line, text) = lines.next("the last status channel")?;
        let fields: Vec<&str> = text.split(',').collect();
        let name = match fields.as_slice() {
            [_, name, _] | [_, name, _, _, _] => (*name).to_owned(),
            [_, name @ .., _, _, _] if name.len() > 1 => {
                notes.remark(
                    Some(line),
                    "a comma in a name; the last three fields are taken for those behind it",
                );
                name.join(",")
            }
            [_, name, _, _] | [_, name] => (*name).to_owned(),
            _ => String::new(),
        };
        if fields.first().and_then(|number| whole(number)) != u64::try_from(place).ok() {
            notes.remark(Some(line), format!("status channel {place} is numbered otherwise"));
        }
        names.push(match name.trim() {
            "" => format!("status {place}"),
            // As it will be shown: what is alike then has to be told apart here.
            name => fit(name),
        });
    }
    Ok(told_apart(&names))
}

/// The same names, where each that comes more than once has its place behind it.
fn told_apart(names: &[String]) -> Vec<String> {
    let mut counts: HashMap<&str, usize> = HashMap::new();
    for name in names {
        *counts.entry(name).or_default() += 1;
    }
    let mut made = HashSet::new();
    let told = (1..).zip(names).map(|(place, name): (usize, &String)| {
        if counts.get(name.as_str()) == Some(&1) {
            return name.clone();
        }
        // Another channel may be called so as it is.
        let mut told = format!("{name} ({place})");
        while counts.contains_key(told.as_str()) || made.contains(&told) {
            told = format!("{told} ({place})");
        }
        made.insert(told.clone());
        told
    });
    told.collect()
}

/// Sampling rates and the number of samples.
fn rates(lines: &mut Lines<'_>) -> Result<(Vec<Rate>, u64), Refusal> {
    let (line, text) = lines.next("the number of sampling rates")?;
    let count = whole(text).filter(|count| *count <= 1000).ok_or_else(|| {
        Refusal::damaged(
            line,
            format!("{} is not a number of sampling rates", quoted(text.as_bytes())),
        )
    })?;
    let mut rates = Vec::new();
    let mut samples = 0;
    for _ in 0..count.max(1) {
        // Without a rate some leave this line out.
        if count == 0 && lines.peek().contains('/') {
            break;
        }
        let (line, text) = lines.next("the sampling rates")?;
        let rate = text
            .split_once(',')
            .and_then(|(hz, until)| Some(Rate { hz: number(hz)?, until: whole(until)? }));
        let rate = rate.ok_or_else(|| {
            Refusal::damaged(line, format!("{} is not a sampling rate", quoted(text.as_bytes())))
        })?;
        samples = rate.until;
        if count > 0 && rate.hz > 0.0 {
            rates.push(rate);
        }
    }
    Ok((rates, samples))
}

/// A date and time, and how many decimals it has.
fn moment(lines: &mut Lines<'_>) -> Result<(When, usize), Refusal> {
    let (line, text) = lines.next("the time of the first sample")?;
    let moment = text.split_once(',').and_then(|(date, time)| {
        let (day_ns, digits) = seconds_of_day(time.trim())?;
        let date = Date::parse(date.trim())?;
        Some((When { date, day_ns, later_ns: 0, utc_offset_s: None }, digits))
    });
    moment.ok_or_else(|| {
        Refusal::damaged(line, format!("{} is not a date and time", quoted(text.as_bytes())))
    })
}

fn layout(lines: &mut Lines<'_>) -> Result<Layout, Refusal> {
    let (line, text) = lines.next("the kind of data")?;
    match text.to_ascii_uppercase().as_str() {
        "ASCII" => Ok(Layout::Ascii),
        "BINARY" => Ok(Layout::Binary { analog_len: 2 }),
        "BINARY32" | "FLOAT32" => Ok(Layout::Binary { analog_len: 4 }),
        _ => Err(Refusal::damaged(
            line,
            format!(
                "{} is not a kind of data: ASCII, BINARY, BINARY32, FLOAT32",
                quoted(text.as_bytes())
            ),
        )),
    }
}

/// What stamps are multiplied with; 1 where the first standard had no such line.
fn multiplier(lines: &mut Lines<'_>) -> Result<f64, Refusal> {
    if lines.peek().is_empty() {
        return Ok(1.0);
    }
    let (line, text) = lines.next("the multiplier")?;
    number(text).filter(|multiplier| *multiplier > 0.0).ok_or_else(|| {
        Refusal::damaged(line, format!("{} is not a multiplier of stamps", quoted(text.as_bytes())))
    })
}

/// The offset from UTC, and what the recorder says of its clock.
fn zone(lines: &mut Lines<'_>, year: Option<u64>, notes: &mut Notes) -> Option<i32> {
    if year.is_none_or(|year| year < 2013) || lines.peek().is_empty() {
        return None;
    }
    let (line, text) = lines.next("the time code").ok()?;
    let code = text.split(',').next().unwrap_or_default();
    let offset = utc_offset(code);
    if offset.is_none() {
        notes.remark(Some(line), format!("{} is not a time code", quoted(code.as_bytes())));
    }
    if let Ok((line, text)) = lines.next("the quality of the clock") {
        let code = text.split(',').next().unwrap_or_default().trim();
        if let Some(quality) = quality(code) {
            notes.remark(Some(line), format!("the device says of its clock: {quality}"));
        }
    }
    offset
}

/// What a code for the quality of a clock means.
fn quality(code: &str) -> Option<&'static str> {
    Some(match code.to_ascii_uppercase().as_str() {
        "0" => "locked",
        "1" => "not locked, good to 1 ns",
        "2" => "not locked, good to 10 ns",
        "3" => "not locked, good to 100 ns",
        "4" => "not locked, good to 1 us",
        "5" => "not locked, good to 10 us",
        "6" => "not locked, good to 100 us",
        "7" => "not locked, good to 1 ms",
        "8" => "not locked, good to 10 ms",
        "9" => "not locked, good to 100 ms",
        "A" => "not locked, good to 1 s",
        "B" => "not locked, good to 10 s",
        "F" => "not reliable",
        _ => return None,
    })
}
