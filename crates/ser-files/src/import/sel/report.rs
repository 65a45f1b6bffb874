//! The printed report, as the command `SER` gives it on a terminal.
//!
//! What a capture has around the report (prompts, echoes, STX and ETX, the relay's head) is passed
//! over. Rows begin below the line of columns. Element and state may have single blanks in them, so
//! two or more part them.

use super::super::calendar::Date;
use super::super::list::{Found, Numbered, Row, When};
use super::super::notes::{Notes, Refusal};
use super::super::text::{Line, TextLines};
use crate::error::{NO_LINE_END, quoted};

/// What ends a message of a relay.
const ETX: char = '\u{3}';

/// Whether a file begins like such a report.
pub(in super::super) fn is_it(head: &str) -> bool {
    head.split(['\r', '\n']).any(|line| {
        let line = cleaned(line);
        is_columns(&line) || line.trim_start().starts_with("FID=") || says_empty(&line)
    })
}

/// Reads all reports of a file.
pub(in super::super) fn read(
    lines: &mut TextLines<'_>,
    found: &mut Found,
    notes: &mut Notes,
) -> Result<(), Refusal> {
    let mut numbered = Numbered::default();
    let mut is_below_columns = false;
    let mut without_element = 0_u64;
    while let Some(line) = lines.next()? {
        let Line::Text(text) = line else {
            let limit = lines.limit();
            notes.leave_out(lines.number(), format!("longer than {limit} bytes"));
            numbered.tear(None);
            continue;
        };
        // A relay ends what it sends with ETX.
        let has_end = text.ends_with(ETX);
        let text = cleaned(text);
        let number = lines.number();
        let is_whole = has_end || lines.is_ended();
        if !is_whole && is_below_columns && !matches!(kind(&text), Kind::Nothing) {
            numbered.cut();
        }
        match kind(&text) {
            Kind::Columns => {
                numbered.finish(found, notes);
                is_below_columns = true;
            }
            Kind::Head(date) => {
                numbered.finish(found, notes);
                numbered.other_dates.extend(date);
                is_below_columns = false;
            }
            Kind::Empty => notes.remark(Some(number), "the relay says that its list is empty"),
            Kind::Row(written) => {
                let understood = match is_whole {
                    true => row(&written, number, found)?,
                    false => Err(NO_LINE_END.to_owned()),
                };
                if let Err(why) = understood.and_then(|row| numbered.add(written.number, row)) {
                    without_element += u64::from(written.rest.is_empty());
                    numbered.tear(Some(written.number));
                    notes.leave_out(number, why);
                }
            }
            Kind::Other if is_below_columns => {
                let why =
                    format!("this is not a row of a list: {}", quoted(text.trim().as_bytes()));
                notes.leave_out(number, why);
                numbered.tear(None);
            }
            Kind::Nothing | Kind::Other => {}
        }
    }
    let is_list_of_values = without_element > 0 && found.lists.is_empty() && numbered.is_empty();
    numbered.finish(found, notes);
    match is_list_of_values {
        true => Err(list_of_values(notes)),
        false => Ok(()),
    }
}

fn list_of_values(notes: &Notes) -> Refusal {
    Refusal::damaged(
        notes.left_out.first().and_then(|note| note.line).unwrap_or(1),
        "rows of this list have no element: relays such as the SEL-551 print values and dots that \
         do not tell what changed",
    )
}

/// What a line is.
enum Kind<'l> {
    /// The names of the columns.
    Columns,
    /// The head of a report, with its date.
    Head(Option<Date>),
    /// Nothing of interest: empty, a prompt, an identification.
    Nothing,
    /// The relay has no rows.
    Empty,
    /// A row.
    Row(Written<'l>),
    /// Something else.
    Other,
}

/// A row as it is written.
struct Written<'l> {
    number: u64,
    date: &'l str,
    time: &'l str,
    /// Element and state.
    rest: &'l str,
}

/// Without what a terminal obeys. A tab stands for blanks.
fn cleaned(line: &str) -> String {
    let shown = line.chars().filter(|letter| *letter == '\t' || !letter.is_control());
    shown
        .flat_map(|letter| if letter == '\t' { [' '; 2] } else { [letter, '\0'] })
        .filter(|letter| *letter != '\0')
        .collect()
}

fn is_columns(line: &str) -> bool {
    let mut words = line.split_whitespace();
    words.next() == Some("#")
        && words.next().is_some_and(|word| word.eq_ignore_ascii_case("date"))
        && words.next().is_some_and(|word| word.eq_ignore_ascii_case("time"))
}

fn says_empty(line: &str) -> bool {
    let line = line.trim().to_ascii_lowercase();
    line.starts_with("no ser data") || line.starts_with("no data available")
}

fn kind(line: &str) -> Kind<'_> {
    let text = line.trim();
    if text.is_empty() || text.starts_with("=>") || text.starts_with("FID=") {
        return Kind::Nothing;
    }
    if is_columns(text) {
        return Kind::Columns;
    }
    if says_empty(text) {
        return Kind::Empty;
    }
    if let Some((_, date)) = text.split_once("Date:") {
        return Kind::Head(date.split_whitespace().next().and_then(Date::parse));
    }
    written(text).map_or(Kind::Other, Kind::Row)
}

fn written(line: &str) -> Option<Written<'_>> {
    let (number, rest) = word(line);
    let (date, rest) = word(rest);
    let (time, rest) = word(rest);
    let is_number = number.bytes().all(|byte| byte.is_ascii_digit());
    let number = number.parse().ok().filter(|number| is_number && *number > 0)?;
    Date::parse(date)?;
    time.contains(':').then_some(Written { number, date, time, rest })
}

/// The first word, and what follows it.
fn word(line: &str) -> (&str, &str) {
    let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
    (word, rest.trim_start())
}

fn row(
    written: &Written<'_>,
    line: u64,
    found: &mut Found,
) -> Result<Result<Row, String>, Refusal> {
    let (when, (element, state)) =
        match (When::parse(written.date, written.time), parted(written.rest)) {
            (Ok(when), Ok(parts)) => (when, parts),
            (Err(why), _) | (_, Err(why)) => return Ok(Err(why)),
        };
    let changes = super::changes(found, element, state)?;
    let forgets = state.is_none();
    Ok(Ok(Row { line, when, place: 0, forgets, torn: None, learnt: Vec::new(), changes }))
}

/// Element and state. What the relay says of itself has no state.
fn parted(rest: &str) -> Result<(&str, Option<&str>), String> {
    let mut parts = rest.split("  ").map(str::trim).filter(|part| !part.is_empty());
    match (parts.next(), parts.next(), parts.next()) {
        (None, ..) => Err("this row has no element and no state".to_owned()),
        (Some(element), Some(state), None) => Ok((element, Some(state))),
        (Some(_), Some(_), Some(_)) => {
            Err(format!("more than element and state: {}", quoted(rest.as_bytes())))
        }
        (Some(only), None, _) => match only.rsplit_once(' ') {
            // Where the columns are full, a single blank is left between them.
            Some((element, state)) if STATES.contains(&state) => Ok((element, Some(state))),
            Some((element, part))
                if is_element(element) && STATES.iter().any(|state| state.starts_with(part)) =>
            {
                Err(format!("{} is only a part of a state", quoted(part.as_bytes())))
            }
            None if is_element(only) => {
                Err(format!("{} has no state here", quoted(only.as_bytes())))
            }
            _ => Ok((only, None)),
        },
    }
}

/// What a relay calls the states of an element, unless somebody has given them other names.
const STATES: [&str; 2] = ["Asserted", "Deasserted"];

/// Whether this is the name of an element. What the relay says of itself is in words.
fn is_element(text: &str) -> bool {
    !text.contains(|letter: char| letter.is_lowercase() || letter == ' ')
}
