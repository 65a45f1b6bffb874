//! What readers make of a file: lists of rows, each with its time as written and what changed.
//!
//! A [`List`] is one stretch of a log without an unknown jump inside. Points and words are kept once
//! and named by their place. Nothing is decided here about zones, inputs and recorders.

use std::collections::HashMap;

use sha2::{Digest, Sha256};

use super::calendar::{Date, DateOrder, NoTime, time_of_day};
use super::notes::{Notes, Refusal};
use crate::error::quoted;

/// The most changes that are read at once. Recorders hold some thousands; a file of more is cut.
pub(super) const MOST_CHANGES: usize = 500_000;

/// The last place that a row of a list can have. Recorders count in 16 or 32 bits; beyond this a
/// number is damaged, and sums of places would overflow.
pub(super) const LAST_PLACE: u64 = 1 << 48;

/// The most different names in a file.
const MOST_NAMES: usize = 65_536;

/// A row: one moment of a list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Row {
    /// The line that it is from.
    pub(super) line: u64,
    /// When, as it is written.
    pub(super) when: When,
    /// Its place in the list, from 1, larger for later rows. What is skipped is missing.
    pub(super) place: u64,
    /// Whether nothing is known any more of states before it.
    pub(super) forgets: bool,
    /// What is lost between the row before and this one: the points that are known to have changed
    /// there. Nothing is if this is `None`.
    pub(super) torn: Option<Vec<usize>>,
    /// States that are known before it although no row shows them.
    pub(super) learnt: Vec<(usize, bool)>,
    /// What changed in it, each point once.
    pub(super) changes: Vec<Change>,
}

/// A time as it is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct When {
    /// The day.
    pub(super) date: Date,
    /// Nanoseconds since midnight.
    pub(super) day_ns: u64,
    /// How much later than that it is, in nanoseconds.
    pub(super) later_ns: i64,
    /// Seconds east of UTC, if the file says it.
    pub(super) utc_offset_s: Option<i32>,
}

impl When {
    /// Date and time of a row, to milliseconds or finer.
    pub(super) fn parse(date: &str, time: &str) -> Result<When, String> {
        let wrong = |what: &str, text: &str| format!("{} is not a {what}", quoted(text.as_bytes()));
        let date = Date::parse(date).ok_or_else(|| wrong("date", date))?;
        let day_ns = time_of_day(time).map_err(|no_time| match no_time {
            NoTime::Wrong => wrong("time", time),
            NoTime::Coarse => format!("{} is coarser than milliseconds", quoted(time.as_bytes())),
        })?;
        Ok(When { date, day_ns, later_ns: 0, utc_offset_s: None })
    }
}

/// What happened to a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Change {
    /// The place of its name.
    pub(super) point: usize,
    /// What became of it.
    pub(super) to: To,
}

/// What became of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum To {
    /// It went on or off.
    State(bool),
    /// It is called this from then, by the place of the word.
    Word(usize),
    /// Something happened that has no state.
    Event,
    /// It changed, and the list does not say to what.
    Unseen,
}

/// How the rows of a list follow each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Order {
    /// As their places say.
    #[default]
    Places,
    /// As their places say, unless all of their times say that it is the other way round.
    PlacesOrReversed,
    /// By their times: the rows are of several devices, and one millisecond has no order.
    Times,
}

/// A stretch of a log.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct List {
    pub(super) rows: Vec<Row>,
    pub(super) order: Order,
    /// Dates of the same file that no row has. They are in the same order.
    pub(super) other_dates: Vec<Date>,
    /// The order in which the format has dates, if it says one.
    pub(super) usual_dates: Option<DateOrder>,
    /// Whether places count from the beginning of the log.
    pub(super) counts_from_beginning: bool,
    /// Whether it is made of samples, which show all states.
    pub(super) is_sampled: bool,
    /// What is lost behind the last row, as [`Row::torn`].
    pub(super) torn_at_end: Option<Vec<usize>>,
    /// How many rows older ones took the places of, before the first.
    pub(super) overwritten: Option<u64>,
}

/// Texts, each once.
#[derive(Debug, Default)]
pub(super) struct Texts {
    places: HashMap<String, usize>,
    all: Vec<String>,
}

impl Texts {
    /// The place of a text; `None` if there are too many.
    pub(super) fn place(&mut self, text: &str) -> Option<usize> {
        if let Some(place) = self.places.get(text) {
            return Some(*place);
        }
        if self.all.len() == MOST_NAMES {
            return None;
        }
        self.places.insert(text.to_owned(), self.all.len());
        self.all.push(text.to_owned());
        Some(self.all.len() - 1)
    }

    /// Whether a text is there.
    pub(super) fn contains(&self, text: &str) -> bool {
        self.places.contains_key(text)
    }

    /// The text at a place.
    pub(super) fn get(&self, place: usize) -> &str {
        self.all.get(place).map_or("", String::as_str)
    }
}

/// What is read from files of one recorder.
#[derive(Debug, Default)]
pub(super) struct Found {
    pub(super) points: Texts,
    pub(super) words: Texts,
    pub(super) lists: Vec<List>,
    changes: usize,
    /// Whether a name was too long to be kept whole.
    pub(super) is_cut: bool,
}

impl Found {
    /// The place of a point's name, made fit to be shown.
    pub(super) fn point(&mut self, name: &str) -> Result<usize, Refusal> {
        let most = u64::try_from(MOST_NAMES).unwrap_or(u64::MAX);
        let too_much = Refusal::TooMuch { what: "different names", most };
        self.is_cut |= is_too_long(name);
        self.points.place(&fit(name)).ok_or(too_much)
    }

    /// The place of a word for a state, made fit to be shown.
    pub(super) fn word(&mut self, word: &str) -> Result<usize, Refusal> {
        let most = u64::try_from(MOST_NAMES).unwrap_or(u64::MAX);
        let too_much = Refusal::TooMuch { what: "different words for states", most };
        self.is_cut |= is_too_long(word);
        self.words.place(&fit(word)).ok_or(too_much)
    }

    /// Makes room for this many changes more.
    pub(super) fn count(&mut self, changes: usize) -> Result<(), Refusal> {
        self.changes = self.changes.saturating_add(changes);
        let most = u64::try_from(MOST_CHANGES).unwrap_or(u64::MAX);
        match self.changes > MOST_CHANGES {
            true => Err(Refusal::TooMuch { what: "changes", most }),
            false => Ok(()),
        }
    }
}

/// The longest name that is kept, in characters.
pub(super) const LONGEST: usize = 200;

/// So many characters of a longer one are kept, and eight digits that tell it from others.
const KEPT: usize = LONGEST - 9;

fn is_too_long(name: &str) -> bool {
    name.trim().chars().nth(LONGEST).is_some()
}

/// A name as it may be shown: one line of visible characters, not empty, of bounded length. Two names
/// that begin alike stay apart, however long they are.
pub(super) fn fit(name: &str) -> String {
    let visible = |letter: char| match letter {
        letter if ser_console::is_obeyed(letter) => '\u{FFFD}',
        letter => letter,
    };
    let name = name.trim();
    let most = if is_too_long(name) { KEPT } else { LONGEST };
    let mut fit: String = name.chars().take(most).map(visible).collect();
    if most == KEPT {
        let sum = Sha256::digest(name.as_bytes());
        let sum = sum.first_chunk().map_or(0, |bytes| u32::from_be_bytes(*bytes));
        fit.push_str(&format!("~{sum:08x}"));
    }
    match fit.trim() {
        "" => "(no name)".to_owned(),
        fit => fit.to_owned(),
    }
}

/// Takes rows that say their own number, the newest being 1, in any order.
#[derive(Debug, Default)]
pub(super) struct Numbered {
    rows: Vec<(u64, Row)>,
    pub(super) other_dates: Vec<Date>,
    /// Rows of this list that were left out.
    damaged: u64,
    /// The largest number that one of them has.
    damaged_number: u64,
    /// The file ends in a line that is not whole.
    is_cut: bool,
}

impl Numbered {
    /// Adds a row with its number; an error says why it is left out.
    pub(super) fn add(&mut self, number: u64, row: Row) -> Result<(), String> {
        if number > LAST_PLACE {
            return Err(format!("there is no row {number}"));
        }
        self.rows.push((number, row));
        Ok(())
    }

    /// Notes that a row was left out: its number if that is known.
    pub(super) fn tear(&mut self, number: Option<u64>) {
        self.damaged += 1;
        self.damaged_number = self.damaged_number.max(number.unwrap_or_default());
    }

    /// Notes that the file ends in a line that is not whole.
    pub(super) const fn cut(&mut self) {
        self.is_cut = true;
    }

    /// Whether there is a row.
    pub(super) fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The list so far; the next row begins another one.
    pub(super) fn finish(&mut self, found: &mut Found, notes: &mut Notes) {
        let damaged = std::mem::take(&mut self.damaged);
        let damaged_number = std::mem::take(&mut self.damaged_number);
        if self.rows.is_empty() {
            return;
        }
        let mut rows = std::mem::take(&mut self.rows);
        // The oldest first; of one number, the row that comes first in the file.
        rows.sort_by_key(|(number, row)| (u64::MAX - number, row.line));
        let oldest = rows.first().map_or(0, |(number, _)| *number);
        let newest = rows.last().map_or(1, |(number, _)| *number);
        // Of a list that is cut off and has its newest row, the oldest ones are missing. They have a
        // place of their own.
        let is_begun = damaged_number <= oldest && !(self.is_cut && newest == 1);
        let beyond = u64::from(!is_begun);
        let mut list = List {
            order: Order::PlacesOrReversed,
            other_dates: std::mem::take(&mut self.other_dates),
            ..List::default()
        };
        let mut before: Option<u64> = None;
        for (number, mut row) in rows {
            if before == Some(number) {
                let is_same = list
                    .rows
                    .last()
                    .is_some_and(|kept| (kept.when, &kept.changes) == (row.when, &row.changes));
                if !is_same {
                    notes.leave_out(row.line, format!("another row has the number {number}, too"));
                }
                continue;
            }
            row.forgets |= before.is_some_and(|before| before != number + 1);
            row.place = oldest - number + 1 + beyond;
            before = Some(number);
            list.rows.push(row);
        }
        if beyond > 0
            && let Some(first) = list.rows.first_mut()
        {
            first.torn.get_or_insert_default();
        }
        tell_missing(&mut list, (oldest + beyond, newest), damaged, notes);
        found.lists.push(list);
    }
}

/// Tells rows that are not there: the newest, if there is none with the number 1, and those whose
/// numbers are skipped.
fn tell_missing(list: &mut List, (oldest, newest): (u64, u64), damaged: u64, notes: &mut Notes) {
    if newest > 1 {
        list.torn_at_end = Some(Vec::new());
    }
    // What was left out has been told.
    if damaged > 0 {
        return;
    }
    let skipped = list.rows.windows(2).filter_map(|pair| match pair {
        [older, newer] if older.place + 1 < newer.place => {
            let number = |place: u64| oldest - place + 1;
            Some((older.line, number(newer.place) + 1, number(older.place) - 1))
        }
        _ => None,
    });
    for (line, from, to) in skipped {
        match from == to {
            true => notes.lose(line, format!("row {from} is not in the file")),
            false => notes.lose(line, format!("rows {from} to {to} are not in the file")),
        }
    }
    match (newest, list.rows.last().map(|row| row.line)) {
        (2, Some(line)) => notes.lose(line, "row 1, the newest, is not in the file"),
        (3.., Some(line)) => {
            let why = format!("rows 1 to {}, the newest, are not in the file", newest - 1);
            notes.lose(line, why);
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_can_be_shown() {
        assert_eq!(fit("  86 LOCKOUT "), "86 LOCKOUT");
        assert_eq!(fit("a\u{1B}[2J\u{202E}"), "a\u{FFFD}[2J\u{FFFD}");
        assert_eq!(fit(" \t"), "(no name)");
        assert_eq!(fit(&"x".repeat(999)).len(), LONGEST);
        let long = |end: &str| fit(&format!("{}{end}", "x".repeat(LONGEST)));
        assert_eq!(long("").len(), LONGEST);
        assert_eq!(long(" ").len(), LONGEST);
        assert_eq!((long("a").len(), long("a") == long("a")), (LONGEST, true));
        assert_ne!(long("a"), long("b"));
    }

    #[test]
    fn more_than_is_read_at_once_is_refused() {
        let mut found = Found::default();
        assert!(found.count(MOST_CHANGES).is_ok());
        assert!(found.count(1).is_err());
        for name in 0..MOST_NAMES {
            found.point(&name.to_string()).unwrap();
        }
        assert!(found.point("0").is_ok());
        assert!(found.point("one more").is_err());
    }
}
