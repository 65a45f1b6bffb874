//! How a failure is reported: what was wrong, and one fact a line below it.

use std::fmt::{self, Display};

use chrono::DateTime;
use ser_proto::Entry;

use super::recorded::{Erase, Recorded, stamp_ms};

/// How many erases are shown, because a life can have thousands.
const SHOWN: usize = 8;

/// What was wrong and the facts about it, each with a name.
#[derive(Clone, Debug)]
pub struct Wrong {
    what: String,
    facts: Vec<(&'static str, String)>,
}

impl Wrong {
    /// A failure without facts.
    #[must_use]
    pub fn new(what: impl Into<String>) -> Wrong {
        Wrong { what: what.into(), facts: Vec::new() }
    }

    /// Adds a fact.
    #[must_use]
    pub fn fact(mut self, name: &'static str, fact: impl Display) -> Wrong {
        self.facts.push((name, fact.to_string()));
        self
    }

    /// Makes it an error.
    ///
    /// # Errors
    /// Always.
    pub fn err<T>(self) -> Result<T, String> {
        Err(self.to_string())
    }
}

impl Display for Wrong {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.what)?;
        let width = self.facts.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
        self.facts.iter().try_for_each(|(name, fact)| write!(f, "\n  {name:width$}  {fact}"))
    }
}

/// An event as `2026-11-22 10:00:00.250  changed 00200001  on 00200000`.
impl Display for Recorded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Recorded { stamp_ms, changed, state, .. } = *self;
        match DateTime::from_timestamp_millis(stamp_ms) {
            Some(stamp) => write!(f, "{}", stamp.format("%Y-%m-%d %H:%M:%S%.3f"))?,
            None => write!(f, "{stamp_ms} ms")?,
        }
        write!(f, "  changed {changed:08x}  on {state:08x}")
    }
}

/// An entry in the same words as an event of the ledger.
#[derive(Clone, Copy, Debug)]
pub struct Told<'a>(pub &'a Entry);

impl Display for Told<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Entry { changed, state, time } = *self.0;
        match stamp_ms(time) {
            Some(stamp_ms) => {
                Recorded { stamp_ms, changed: changed.0, state: state.0, at_ms: 0, unrecorded: 0 }
                    .fmt(f)
            }
            None => {
                write!(
                    f,
                    "{time}, which is not a date  changed {:08x}  on {:08x}",
                    changed.0, state.0
                )
            }
        }
    }
}

/// An event of the ledger by its number, with what it was.
#[derive(Clone, Copy, Debug)]
pub struct Numbered<'a> {
    /// Its number, counted from 0 at power-up.
    pub number: usize,
    /// How many there are.
    pub of: usize,
    /// What it was, if it has happened and is not forgotten.
    pub event: Option<&'a Recorded>,
}

impl Display for Numbered<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Numbered { number, of, event } = *self;
        write!(f, "event {number} of {of}: ")?;
        match event {
            Some(event) => event.fmt(f),
            None if number >= of => f.write_str("has not been yet"),
            None => f.write_str("long past"),
        }
    }
}

/// As `at 3`, `between 3 and 7`, `from 3 on`, each meaning before the event of this number. An
/// erase that may not have happened is in brackets.
impl Display for Erase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Erase { from, to, certain } = *self;
        let open = if certain { "" } else { "(" };
        let close = if certain { "" } else { ")" };
        match to {
            usize::MAX => write!(f, "{open}from {from} on{close}"),
            to if to == from => write!(f, "{open}at {from}{close}"),
            to => write!(f, "{open}between {from} and {to}{close}"),
        }
    }
}

/// Erases in a row. If there are many, only the latest are shown.
pub fn erases(erases: impl DoubleEndedIterator<Item = Erase>) -> String {
    let mut latest: Vec<String> =
        erases.rev().take(SHOWN + 1).map(|erase| erase.to_string()).collect();
    if latest.len() > SHOWN {
        latest[SHOWN] = "…".to_owned();
    }
    latest.reverse();
    if latest.is_empty() { "none".to_owned() } else { latest.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ser_proto::{Inputs, TimeStamp};

    const EVENT: Recorded = Recorded {
        stamp_ms: 1_795_341_600_250,
        changed: 0x20_0001,
        state: 1,
        at_ms: 7,
        unrecorded: 0,
    };

    #[test]
    fn facts_are_told_one_a_line_and_in_a_column() {
        let wrong =
            Wrong::new("line: event 3 comes twice").fact("came", 1).fact("told before", "nothing");
        assert_eq!(
            wrong.to_string(),
            "line: event 3 comes twice\n  came         1\n  told before  nothing"
        );
    }

    #[test]
    fn an_entry_and_its_event_are_told_alike() {
        let entry = EVENT.to_entry();
        let text = "2026-11-22 10:00:00.250  changed 00200001  on 00000001";
        assert_eq!(EVENT.to_string(), text);
        assert_eq!(Told(&entry).to_string(), text);
        let time = TimeStamp { month: 13, ..entry.time };
        let never = Entry { time, state: Inputs(2), ..entry };
        let text = "2026-13-22T10:00:00.250, which is not a date  changed 00200001  on 00000002";
        assert_eq!(Told(&never).to_string(), text);
    }

    #[test]
    fn an_event_is_told_with_its_number() {
        let numbered = |number, event| Numbered { number, of: 5, event }.to_string();
        assert_eq!(numbered(4, Some(&EVENT)), format!("event 4 of 5: {EVENT}"));
        assert_eq!(numbered(5, None), "event 5 of 5: has not been yet");
        assert_eq!(numbered(0, None), "event 0 of 5: long past");
    }

    #[test]
    fn erases_say_where_they_can_have_been() {
        let erase = |from, to, certain| Erase { from, to, certain };
        let all = [erase(3, 3, true), erase(3, 7, true), erase(9, usize::MAX, false)];
        assert_eq!(erases(all.into_iter()), "at 3, between 3 and 7, (from 9 on)");
        assert_eq!(erases([].into_iter()), "none");
        let many = (0..10).map(|at| erase(at, at, true));
        assert_eq!(erases(many), "…, at 2, at 3, at 4, at 5, at 6, at 7, at 8, at 9");
    }
}
