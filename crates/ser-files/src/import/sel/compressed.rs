//! Compressed ASCII, as the command `CSER` gives it: rows of comma-separated values, each with a
//! checksum.
//!
//! The checksum is the sum of all bytes of a line up to the comma before it. A row whose checksum is
//! wrong is left out, by its number. What the relay says of itself has no state, and a field less.

use super::super::list::{Found, Numbered, Row, When};
use super::super::notes::{Notes, Refusal};
use super::super::text::{Line, TextLines};
use crate::error::quoted;
use crate::fields::Fields;

/// The columns that are looked for.
const COLUMNS: [&str; 5] = ["REC_NUM", "DATE", "TIME", "ELEMENT", "STATE"];

/// Whether a file begins like that.
pub(in super::super) fn is_it(head: &[u8]) -> bool {
    let mut fields = Fields::new();
    head.split(|byte| matches!(byte, b'\r' | b'\n')).any(|line| {
        let line = bare(line);
        let is_quoted = line.first() == Some(&b'"');
        is_quoted && matches!(checked(line, &mut fields), Some(Ok(())))
    })
}

/// Reads all lists of a file.
pub(in super::super) fn read(
    lines: &mut TextLines<'_>,
    found: &mut Found,
    notes: &mut Notes,
) -> Result<(), Refusal> {
    let mut fields = Fields::new();
    let mut numbered = Numbered::default();
    let mut columns: Columns = [0, 1, 2, 3, 4];
    while let Some(line) = lines.next()? {
        let is_too_long = matches!(line, Line::TooLong);
        let number = lines.number();
        if is_too_long {
            notes.leave_out(number, format!("longer than {} bytes", lines.limit()));
            numbered.tear(None);
            continue;
        }
        let raw = bare(lines.raw());
        if !matches!(raw.first(), Some(b'"' | b'0'..=b'9')) {
            // A prompt, an echo, an empty line.
            continue;
        }
        if let Some(why) = wrong(raw, &mut fields) {
            notes.leave_out(number, why);
            numbered.tear(None);
            if !lines.is_ended() {
                numbered.cut();
            }
            continue;
        }
        if let Some(found_columns) = columns_of(&fields) {
            numbered.finish(found, notes);
            columns = found_columns;
        } else if fields.field(0) == b"No Data Available" {
            notes.remark(Some(number), "the relay says that its list is empty");
        } else if let Some(text) = number_of(&fields, columns) {
            match row(&fields, columns, number, found)?.and_then(|row| numbered.add(text, row)) {
                Ok(()) => {}
                Err(why) => {
                    notes.leave_out(number, why);
                    numbered.tear(Some(text));
                }
            }
        }
        // Everything else identifies the relay.
    }
    numbered.finish(found, notes);
    Ok(())
}

/// Takes a line apart. Returns what is wrong with it as a whole, with its row if it has one.
fn wrong(raw: &[u8], fields: &mut Fields) -> Option<String> {
    match checked(raw, fields) {
        Some(Ok(())) => None,
        None => Some(format!("this line has no checksum: {}", quoted(raw))),
        Some(Err(why)) => Some(match fields.field(0) {
            first if first.iter().all(u8::is_ascii_digit) && !first.is_empty() => {
                format!("row {}: {why}", String::from_utf8_lossy(first))
            }
            _ => why,
        }),
    }
}

/// Where the columns are.
type Columns = [usize; 5];

/// Without what frames a message.
fn bare(line: &[u8]) -> &[u8] {
    let is_frame = |byte: &u8| matches!(byte, 2 | 3 | b' ');
    let start = line.iter().position(|byte| !is_frame(byte)).unwrap_or(line.len());
    let end = line.iter().rposition(|byte| !is_frame(byte)).map_or(start, |last| last + 1);
    line.get(start..end).unwrap_or_default()
}

/// Takes a line apart. `None` if it has no checksum; an error if that is wrong.
fn checked(line: &[u8], fields: &mut Fields) -> Option<Result<(), String>> {
    fields.split(line).ok()?;
    let last = fields.count().checked_sub(1)?;
    let text = fields.field(last);
    let is_hex = text.len() == 4 && text.iter().all(u8::is_ascii_hexdigit);
    let said = u16::from_str_radix(std::str::from_utf8(text).ok()?, 16).ok().filter(|_| is_hex)?;
    let comma = line.iter().rposition(|byte| *byte == b',')?;
    let summed =
        line.get(..=comma)?.iter().fold(0_u16, |sum, byte| sum.wrapping_add((*byte).into()));
    Some(match said == summed {
        true => Ok(()),
        false => Err(format!("its checksum is {said:04X} and has to be {summed:04X}")),
    })
}

fn columns_of(fields: &Fields) -> Option<Columns> {
    let mut columns = [0; 5];
    for (place, name) in columns.iter_mut().zip(COLUMNS) {
        *place = (0..fields.count()).find(|place| fields.field(*place) == name.as_bytes())?;
    }
    Some(columns)
}

/// The number of a row; `None` if this is none.
fn number_of(fields: &Fields, [number, ..]: Columns) -> Option<u64> {
    let text = fields.field(number);
    let is_number = !text.is_empty() && text.iter().all(u8::is_ascii_digit);
    std::str::from_utf8(text).ok()?.parse().ok().filter(|number| is_number && *number > 0)
}

fn row(
    fields: &Fields,
    [_, date, time, element, state]: Columns,
    line: u64,
    found: &mut Found,
) -> Result<Result<Row, String>, Refusal> {
    let text = |place: usize| String::from_utf8_lossy(fields.field(place)).trim().to_owned();
    // The checksum is the last field.
    let state = Some(state).filter(|state| state + 1 < fields.count()).map(text);
    if element + 1 >= fields.count() {
        return Ok(Err("this row has no element".to_owned()));
    }
    let when = match When::parse(&text(date), &text(time)) {
        Ok(when) => when,
        Err(why) => return Ok(Err(why)),
    };
    let state = state.filter(|state| !state.is_empty());
    let changes = super::changes(found, &text(element), state.as_deref())?;
    let forgets = state.is_none();
    Ok(Ok(Row { line, when, place: 0, forgets, torn: None, learnt: Vec::new(), changes }))
}
