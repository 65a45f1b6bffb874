//! COMTRADE: status channels of a fault record.
//!
//! A record is a configuration ([`cfg`]) and its data ([`dat`]), in two files or in one
//! ([`is_cff`]). Each row of the data shows the state of every channel, so the first row tells how
//! everything was, and each later one tells what changed. Analog channels are passed over.

mod cfg;
mod dat;
mod decimal;
mod samples;

use std::io::Read;

use super::list::Found;
use super::notes::{Notes, Refusal};
use super::text::{Input, Line, TextLines};
use cfg::Configuration;
use samples::Samples;

pub use cfg::Extent;

/// The largest configuration that is read, in bytes.
const MOST_BYTES: usize = 16 << 20;

/// How a part of a combined file begins.
const PART: &str = "--- file type:";

/// Whether a file begins like a configuration.
pub(super) fn is_cfg(head: &str) -> bool {
    let mut lines = head.split(['\r', '\n']).filter(|line| !line.trim().is_empty());
    let first = lines.next().unwrap_or_default();
    first.contains(',') && lines.next().is_some_and(|line| cfg::counts(line).is_some())
}

/// Whether a file begins like one with all parts in it.
pub(super) fn is_cff(head: &str) -> bool {
    part(head.split(['\r', '\n']).next().unwrap_or_default()).is_some()
}

/// Whether a file looks like data without its configuration.
pub(super) fn is_dat(head: &str) -> bool {
    let first = head.split(['\r', '\n']).next().unwrap_or_default();
    let is_number = |field: &str| {
        let field = field.trim();
        field.bytes().all(|byte| byte.is_ascii_digit() || b"+-.eE".contains(&byte))
    };
    first.starts_with(|letter: char| letter.is_ascii_digit())
        && first.split(',').count() >= 3
        && first.split(',').all(is_number)
}

/// The kind of the part that begins with this line.
fn part(line: &str) -> Option<String> {
    let line = line.trim_start().to_ascii_lowercase();
    let kind = line.strip_prefix(PART)?.trim();
    Some(kind.trim_end_matches('-').trim().to_owned())
}

/// Reads a configuration and its data.
pub(super) fn read(
    lines: &mut TextLines<'_>,
    data: impl FnOnce() -> std::io::Result<Input<'static>>,
    found: &mut Found,
    notes: &mut Notes,
) -> Result<Extent, Refusal> {
    let mut texts = Vec::new();
    let mut room = MOST_BYTES;
    while let Some(line) = lines.next()? {
        keep(line, &mut texts, &mut room)?;
    }
    let configuration = Configuration::parse(&numbered(texts), notes)?;
    let data = data().map_err(Refusal::NoData)?;
    rows(&configuration, data, (0, None), found, notes)?;
    Ok(configuration.extent())
}

/// Reads a file that has all parts in it.
pub(super) fn read_combined(
    mut lines: TextLines<'_>,
    found: &mut Found,
    notes: &mut Notes,
) -> Result<Extent, Refusal> {
    let mut texts = Vec::new();
    let mut room = MOST_BYTES;
    let mut is_configuration = false;
    loop {
        let number = lines.number() + 1;
        let Some(line) = lines.next()? else {
            return Err(Refusal::damaged(number, "there is no part with data"));
        };
        let kind = match &line {
            Line::Text(text) => part(text),
            Line::TooLong => None,
        };
        match kind.as_deref() {
            Some(kind) if kind.starts_with("dat") => {
                let len = kind.rsplit_once(':').and_then(|(_, len)| len.trim().parse().ok());
                let configuration = Configuration::parse(&texts, notes)?;
                rows(&configuration, lines.into_rest()?, (number, len), found, notes)?;
                return Ok(configuration.extent());
            }
            Some(kind) => is_configuration = kind == "cfg",
            None if is_configuration => {
                let mut kept = Vec::new();
                keep(line, &mut kept, &mut room)?;
                texts.extend(kept.into_iter().map(|text| (number, text)));
            }
            None => {}
        }
    }
}

fn keep(line: Line<'_>, texts: &mut Vec<String>, room: &mut usize) -> Result<(), Refusal> {
    let text = match line {
        Line::Text(text) => text.to_owned(),
        Line::TooLong => String::new(),
    };
    let most = u64::try_from(MOST_BYTES).unwrap_or(u64::MAX);
    let too_much = Refusal::TooMuch { what: "bytes of configuration", most };
    *room = room.checked_sub(text.len() + 32).ok_or(too_much)?;
    texts.push(text);
    Ok(())
}

fn numbered(texts: Vec<String>) -> Vec<(u64, String)> {
    (1..).zip(texts).collect()
}

/// Reads the data. `from` is the line before it in the same file, and how many bytes it has if that
/// is told.
fn rows(
    configuration: &Configuration,
    data: Input<'_>,
    (line, len): (u64, Option<u64>),
    found: &mut Found,
    notes: &mut Notes,
) -> Result<(), Refusal> {
    let mut samples = Samples::new(configuration, found)?;
    let data: Input<'_> = match len {
        Some(len) => Box::new(std::io::BufReader::new(data.take(len))),
        None => data,
    };
    match configuration.layout {
        cfg::Layout::Ascii => dat::ascii(configuration, data, line, &mut samples, found, notes)?,
        cfg::Layout::Binary { .. } => dat::binary(configuration, data, &mut samples, found, notes)?,
    }
    samples.finish(found, notes);
    Ok(())
}
