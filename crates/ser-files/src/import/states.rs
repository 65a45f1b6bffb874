//! Which word means on, and which off.
//!
//! Words that people use everywhere are known. Of others, the map says it; without one, the first
//! word that a point shows is taken for on, which is told. With that, only the side is chosen: the
//! point is shown with its own words.

use std::collections::{BTreeMap, BTreeSet};

use super::list::{Texts, To};
use super::map::Map;
use super::notes::Notes;
use super::timed::Timed;

/// Words that belong together: on, off.
const PAIRS: [(&str, &str); 20] = [
    ("asserted", "deasserted"),
    ("closed", "open"),
    ("close", "open"),
    ("on", "off"),
    ("trip", "reset"),
    ("tripped", "reset"),
    ("operate", "reset"),
    ("operated", "reset"),
    ("pickup", "dropout"),
    ("start", "reset"),
    ("active", "inactive"),
    ("alarm", "normal"),
    ("high", "low"),
    ("true", "false"),
    ("1", "0"),
    ("enabled", "disabled"),
    ("yes", "no"),
    ("closed", "opened"),
    ("in", "out"),
    ("hi", "lo"),
];

/// What the words of each point mean.
#[derive(Debug, Default)]
pub(super) struct Meanings {
    /// Whether a word of a point means on. What is not there has no meaning.
    on: BTreeMap<(usize, usize), bool>,
    /// Words of points that are only a part of another word.
    parts: BTreeSet<(usize, usize)>,
    /// What is shown for on and off.
    texts: BTreeMap<usize, [Option<String>; 2]>,
    /// Points that have no state.
    events: BTreeMap<usize, ()>,
}

/// Why nobody knows what a change made of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NoState {
    /// This word is a third one.
    Third(usize),
    /// This word is only a part of another one.
    Part(usize),
    /// There is no word, and other rows of this point have one.
    NoWord,
}

impl Meanings {
    /// Goes through all rows in their order.
    pub(super) fn of(
        lists: &[Timed],
        (points, words): (&Texts, &Texts),
        map: &Map,
        notes: &mut Notes,
    ) -> Meanings {
        let mut by_point: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        let mut meanings = Meanings::default();
        for change in lists.iter().flat_map(|list| &list.rows).flat_map(|row| &row.changes) {
            match change.to {
                To::Word(word) => {
                    let known = by_point.entry(change.point).or_default();
                    // A point has two words or three, whatever a file holds.
                    if known.len() < 16 && !known.contains(&word) {
                        known.push(word);
                    }
                }
                To::Event => _ = meanings.events.insert(change.point, ()),
                To::State(_) | To::Unseen => {}
            }
        }
        for (point, known) in by_point {
            meanings.decide(point, points.get(point), &known, words, map, notes);
        }
        meanings
    }

    fn decide(
        &mut self,
        point: usize,
        name: &str,
        known: &[usize],
        words: &Texts,
        map: &Map,
        notes: &mut Notes,
    ) {
        let mut sides: Vec<Option<bool>> = known
            .iter()
            .map(|word| map.side(name, words.get(*word)).or_else(|| usual(words.get(*word))))
            .collect();
        let has = |sides: &[Option<bool>], side| sides.contains(&Some(side));
        for place in 0..sides.len() {
            let word = known.get(place).map_or("", |word| words.get(*word));
            if sides.get(place) != Some(&None) || is_part(word, known, words) {
                continue;
            }
            let side = match (has(&sides, true), has(&sides, false)) {
                (false, _) => true,
                (true, false) => false,
                (true, true) => continue,
            };
            if let (Some(place), Some(word)) = (sides.get_mut(place), known.get(place)) {
                *place = Some(side);
                let side = if side { "on" } else { "off" };
                let word = words.get(*word);
                notes.remark(
                    None,
                    format!("{word:?} of {name:?} is taken for {side}; --map can say otherwise"),
                );
            }
        }
        let mut texts = [None, None];
        for (side, word) in sides.iter().zip(known) {
            let Some(side) = *side else {
                if is_part(words.get(*word), known, words) {
                    self.parts.insert((point, *word));
                }
                continue;
            };
            self.on.insert((point, *word), side);
            let Some(text) = texts.get_mut(usize::from(!side)) else { continue };
            let word = words.get(*word);
            let shown = text.get_or_insert_with(|| word.to_owned());
            if shown.to_lowercase() != word.to_lowercase() {
                let side = if side { "on" } else { "off" };
                notes.remark(
                    None,
                    format!(
                        "{shown:?} and {word:?} of {name:?} both mean {side}; {shown:?} is shown"
                    ),
                );
            }
        }
        self.texts.insert(point, texts);
    }

    /// What a change makes of a point: on, off, or something without a state. An error if its word
    /// means nothing.
    pub(super) fn state(&self, point: usize, to: To) -> Result<Option<bool>, NoState> {
        match to {
            To::State(is_on) => Ok(Some(is_on)),
            To::Word(word) => match self.on.get(&(point, word)) {
                Some(is_on) => Ok(Some(*is_on)),
                None if self.parts.contains(&(point, word)) => Err(NoState::Part(word)),
                None => Err(NoState::Third(word)),
            },
            To::Event if self.texts.contains_key(&point) => Err(NoState::NoWord),
            To::Event | To::Unseen => Ok(None),
        }
    }

    /// What is shown when a point is on, and when it is off.
    pub(super) fn texts(&self, point: usize) -> [String; 2] {
        if self.events.contains_key(&point) && !self.texts.contains_key(&point) {
            return ["event".to_owned(), "event".to_owned()];
        }
        match self.texts.get(&point) {
            Some([Some(on), Some(off)]) => [on.clone(), off.clone()],
            Some([Some(on), None]) => [on.clone(), opposite(on)],
            Some([None, Some(off)]) => [opposite(off), off.clone()],
            _ => ["ON".to_owned(), "OFF".to_owned()],
        }
    }
}

/// Whether a word that nobody knows is the beginning of one that is known, or that the same point
/// shows: it was cut off.
fn is_part(word: &str, of_point: &[usize], words: &Texts) -> bool {
    let word = word.to_lowercase();
    let begins = |whole: &str| whole.len() > word.len() && whole.starts_with(&word);
    PAIRS.iter().any(|(on, off)| begins(on) || begins(off))
        || of_point.iter().any(|other| begins(&words.get(*other).to_lowercase()))
}

/// Whether everybody takes this word for on, or for off.
fn usual(word: &str) -> Option<bool> {
    let word = word.to_lowercase();
    PAIRS.iter().find_map(|(on, off)| match word == *on {
        true => Some(true),
        false => (word == *off).then_some(false),
    })
}

/// The word for the other state, written in the same manner.
fn opposite(word: &str) -> String {
    let lower = word.to_lowercase();
    let other = PAIRS.iter().find_map(|(on, off)| match lower == *on {
        true => Some(*off),
        false => (lower == *off).then_some(*on),
    });
    let Some(other) = other else { return format!("not {}", shortened(word)) };
    let is_upper = !word.chars().any(char::is_lowercase);
    let is_capital = word.chars().next().is_some_and(char::is_uppercase);
    match other.split_at_checked(1) {
        Some(_) if is_upper => other.to_uppercase(),
        Some((first, rest)) if is_capital => first.to_uppercase() + rest,
        _ => other.to_owned(),
    }
}

/// So that the word with something before it is not too long either.
fn shortened(word: &str) -> String {
    word.chars().take(190).collect::<String>().trim().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_other_word_is_written_in_the_same_manner() {
        assert_eq!(opposite("Asserted"), "Deasserted");
        assert_eq!(opposite("CLOSED"), "OPEN");
        assert_eq!(opposite("dropout"), "pickup");
        assert_eq!(opposite("BLOCKED"), "not BLOCKED");
        assert_eq!(usual("Tripped"), Some(true));
        assert_eq!(usual("Opened"), Some(false));
        assert_eq!(usual("BLOCKED"), None);
    }
}
