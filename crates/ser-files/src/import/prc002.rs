//! CSV as it is asked for with NERC PRC-002: a row for each change of a device of a substation.
//!
//! The rows of one file come from several devices, so they are put in the order of their times, and
//! those of one millisecond have no order. Each row has its own offset from UTC.

use super::calendar::utc_offset;
use super::list::{Change, Found, List, Order, Row, To, When};
use super::notes::{Notes, Refusal};
use super::text::{Line, TextLines};
use crate::error::{NO_LINE_END, quoted};
use crate::fields::Fields;
use crate::missing::RECORDS_MISSING;

const COLUMNS: [&str; 6] = ["date", "time", "local time code", "substation", "device", "state"];

/// What a row says.
enum Said {
    Change(Row),
    /// Something is missing here; in words.
    Missing(String),
}

/// Where the columns are.
type Columns = [usize; 6];

/// Whether a file begins with these columns.
pub(super) fn is_it(head: &str) -> bool {
    let mut fields = Fields::new();
    let mut lines = head.split(['\r', '\n']).filter(|line| !line.trim().is_empty());
    lines.next().is_some_and(|line| columns(line, &mut fields).is_some())
}

/// Reads a file.
pub(super) fn read(
    lines: &mut TextLines<'_>,
    found: &mut Found,
    notes: &mut Notes,
) -> Result<(), Refusal> {
    let mut fields = Fields::new();
    let mut places: Option<Columns> = None;
    let mut list = List { order: Order::Times, ..List::default() };
    let mut torn: Option<Vec<usize>> = None;
    while let Some(line) = lines.next()? {
        let text = match line {
            Line::Text(text) if text.trim().is_empty() => continue,
            Line::Text(text) => text.to_owned(),
            Line::TooLong => {
                notes.leave_out(lines.number(), format!("longer than {} bytes", lines.limit()));
                torn = Some(Vec::new());
                continue;
            }
        };
        let number = lines.number();
        if let Some(columns) = columns(&text, &mut fields) {
            places = Some(columns);
            continue;
        }
        let Some(columns) = places else {
            return Err(Refusal::damaged(
                number,
                format!("the columns have to be {}", COLUMNS.join(", ")),
            ));
        };
        // Where the last text stands in quotes, the second one says that it is whole.
        let is_whole = lines.is_ended() || text.ends_with('"');
        let understood = match is_whole {
            true => row(&text, columns, &mut fields, number, found)?,
            false => Err(NO_LINE_END.to_owned()),
        };
        match understood {
            Ok(Said::Missing(what)) => {
                notes.lose(number, what);
                torn = Some(Vec::new());
            }
            Ok(Said::Change(mut row)) => {
                row.place = u64::try_from(list.rows.len()).unwrap_or(u64::MAX) + 1;
                row.torn = torn.take();
                list.rows.push(row);
            }
            Err(why) => {
                notes.leave_out(number, why);
                torn = Some(Vec::new());
            }
        }
    }
    list.torn_at_end = torn;
    found.lists.push(list);
    Ok(())
}

fn columns(line: &str, fields: &mut Fields) -> Option<Columns> {
    fields.split(line.as_bytes()).ok()?;
    let mut columns = [0; 6];
    for (place, name) in columns.iter_mut().zip(COLUMNS) {
        let is_it =
            |place: &usize| fields.field(*place).trim_ascii().eq_ignore_ascii_case(name.as_bytes());
        *place = (0..fields.count()).find(is_it)?;
    }
    Some(columns)
}

fn row(
    line: &str,
    columns: Columns,
    fields: &mut Fields,
    number: u64,
    found: &mut Found,
) -> Result<Result<Said, String>, Refusal> {
    let [date, time, code, substation, device, state] = match texts(line, columns, fields) {
        Ok(texts) => texts,
        Err(why) => return Ok(Err(why)),
    };
    let Some(offset) = utc_offset(&code) else {
        return Ok(Err(format!("{} is not a local time code", quoted(code.as_bytes()))));
    };
    let when = match When::parse(&date, &time) {
        Ok(when) => When { utc_offset_s: Some(offset), ..when },
        Err(why) => return Ok(Err(why)),
    };
    if device.is_empty() || state.is_empty() {
        return Ok(Err("a row needs a device and a state".to_owned()));
    }
    // With --spreadsheet-safe our own export may have an apostrophe before it.
    if let Some(what) = state.trim_start_matches('\'').strip_prefix(RECORDS_MISSING) {
        let what = what.trim_start_matches([':', ' ']);
        return Ok(Ok(Said::Missing(format!("{device} says that records are missing: {what}"))));
    }
    let point = found.point(&format!("{substation} {device}"))?;
    let to = To::Word(found.word(&state)?);
    found.count(1)?;
    let changes = vec![Change { point, to }];
    Ok(Ok(Said::Change(Row {
        line: number,
        when,
        place: 0,
        forgets: false,
        torn: None,
        learnt: Vec::new(),
        changes,
    })))
}

fn texts(line: &str, columns: Columns, fields: &mut Fields) -> Result<[String; 6], String> {
    fields.split(line.as_bytes())?;
    let needed = columns.iter().max().map_or(0, |last| last + 1);
    if fields.count() < needed {
        return Err(format!("{} fields where {needed} have to be", fields.count()));
    }
    Ok(columns.map(|place| String::from_utf8_lossy(fields.field(place)).trim().to_owned()))
}
