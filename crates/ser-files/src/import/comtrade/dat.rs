//! The data: a row for each sample, as text or binary.

use std::io::{self, BufRead};

use super::cfg::Configuration;
use super::decimal::whole;
use super::samples::{Sample, Samples};
use crate::error::quoted;
use crate::import::list::Found;
use crate::import::notes::{Notes, Refusal};
use crate::import::text::{Input, Line, TextLines};

/// The longest row of text, in bytes: a number for each of tens of thousands of channels.
const MOST_LINE: usize = 1 << 20;

/// Behind this byte a text has ended, however long the file is.
const END_OF_TEXT: char = '\u{1A}';

/// Reads rows of text, the first of which is in the line after `line`.
pub(super) fn ascii(
    configuration: &Configuration,
    data: Input<'_>,
    line: u64,
    samples: &mut Samples,
    found: &mut Found,
    notes: &mut Notes,
) -> Result<(), Refusal> {
    let mut lines = TextLines::with_limit(data, MOST_LINE);
    lines.count_from(line);
    let mut states = vec![false; configuration.names.len()];
    let mut beyond = Beyond::default();
    while let Some(line) = lines.next()? {
        let text = match line {
            Line::Text(text) => text.to_owned(),
            Line::TooLong => {
                notes.leave_out(lines.number(), format!("longer than {MOST_LINE} bytes"));
                samples.tear();
                continue;
            }
        };
        let number = lines.number();
        let (text, is_last) = match text.split_once(END_OF_TEXT) {
            Some((text, _)) => (text, true),
            None => (&*text, false),
        };
        if !text.trim().is_empty() {
            if samples.is_full() {
                beyond.add(number);
            } else {
                let understood = row(text, configuration, &mut states);
                let taken = match understood {
                    Ok((own, stamp)) => samples.add(
                        &Sample { line: number, number: own, stamp, states: &states },
                        found,
                        notes,
                    )?,
                    Err(why) => Err(why),
                };
                if let Err(why) = taken {
                    notes.leave_out(number, why);
                    samples.tear();
                }
            }
        }
        if is_last {
            break;
        }
    }
    beyond.tell(notes);
    Ok(())
}

/// Samples behind the last that was announced.
#[derive(Default)]
struct Beyond {
    first: Option<u64>,
    count: u64,
}

impl Beyond {
    fn add(&mut self, line: u64) {
        self.first = self.first.or(Some(line));
        self.count += 1;
    }

    fn tell(&self, notes: &mut Notes) {
        if let Some(first) = self.first {
            notes.leave_out(
                first,
                match self.count {
                    1 => "a sample more than the configuration announces".to_owned(),
                    count => format!("{count} samples more than the configuration announces"),
                },
            );
            notes.left_out_count += self.count - 1;
        }
    }
}

/// Number and stamp of a row; its states go to `states`.
fn row(
    text: &str,
    configuration: &Configuration,
    states: &mut [bool],
) -> Result<(u64, Option<u64>), String> {
    let needed = 2 + configuration.analogs + states.len();
    let count = text.split(',').count();
    if count != needed {
        return Err(format!("{count} fields where {needed} have to be"));
    }
    let mut fields = text.split(',').map(str::trim);
    let number = fields.next().unwrap_or_default();
    let number = whole(number)
        .ok_or_else(|| format!("{} is not a number of a sample", quoted(number.as_bytes())))?;
    let stamp =
        match fields.next().unwrap_or_default() {
            "" => None,
            stamp => Some(whole(stamp).ok_or_else(|| {
                format!("{} is not a stamp of a sample", quoted(stamp.as_bytes()))
            })?),
        };
    for (state, field) in states.iter_mut().zip(fields.skip(configuration.analogs)) {
        *state = match field {
            "0" => false,
            "1" => true,
            _ => return Err(format!("{} is not a state", quoted(field.as_bytes()))),
        };
    }
    Ok((number, stamp))
}

/// Reads binary rows. Lines of notes are rows.
pub(super) fn binary(
    configuration: &Configuration,
    mut data: Input<'_>,
    samples: &mut Samples,
    found: &mut Found,
    notes: &mut Notes,
) -> Result<(), Refusal> {
    const MISSING: u32 = u32::MAX;
    let mut row = vec![0; configuration.layout.row_len(configuration)];
    let mut states = vec![false; configuration.names.len()];
    let statuses_at = row.len() - states.len().div_ceil(16) * 2;
    let mut beyond = Beyond::default();
    for number in 1.. {
        let len = filled(&mut data, &mut row).map_err(Refusal::Io)?;
        if len < row.len() {
            if len > 0 && !samples.is_full() {
                notes.leave_out(number, format!("the data ends in this sample, after {len} bytes"));
            }
            break;
        }
        if samples.is_full() {
            beyond.add(number);
            continue;
        }
        let word = |at: usize| {
            let bytes = row.get(at..at + 4).and_then(|bytes| bytes.try_into().ok());
            u32::from_le_bytes(bytes.unwrap_or_default())
        };
        let statuses = row.get(statuses_at..).unwrap_or_default();
        for (place, state) in states.iter_mut().enumerate() {
            // Little-endian words of sixteen: the byte is the same as without them.
            let byte = statuses.get(place / 8).copied().unwrap_or_default();
            *state = byte >> (place % 8) & 1 == 1;
        }
        let stamp = Some(word(4)).filter(|stamp| *stamp != MISSING).map(u64::from);
        let sample = Sample { line: number, number: word(0).into(), stamp, states: &states };
        if let Err(why) = samples.add(&sample, found, notes)? {
            notes.leave_out(number, why);
            samples.tear();
        }
    }
    beyond.tell(notes);
    Ok(())
}

/// Fills as much of a row as there is.
fn filled(data: &mut impl BufRead, row: &mut [u8]) -> io::Result<usize> {
    let mut len = 0;
    while let Some(rest) = row.get_mut(len..).filter(|rest| !rest.is_empty()) {
        match data.read(rest) {
            Ok(0) => break,
            Ok(read) => len += read,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(len)
}
