//! Holds an archive against the books: nothing lost, nothing twice, nothing wrong.
//!
//! It shares no code with what it judges. An entry says by its own content which move it is, because
//! each move leads to a state that no other move leads to.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use ser_sim::Played;
use serde_json::Value;

use crate::plant::Book;
use crate::tables::{Entry, Tables, stamp_ms};

/// What is said of an archive.
#[derive(Debug, Default)]
pub(crate) struct Verdict {
    /// What no later row can put right.
    pub(crate) wrong: Vec<String>,
    /// What is not there, and not told. It may come.
    pub(crate) missing: Vec<String>,
}

impl Verdict {
    pub(crate) fn is_good(&self) -> bool {
        self.wrong.is_empty() && self.missing.is_empty()
    }
}

/// How many collectors have filled the archive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Filled {
    /// One, which knows of all that is there: it may call nothing lost that it has.
    ByOne,
    /// Several, one of which may have lost what another one has.
    BySeveral,
}

/// Whether a collector has read everything that there is, by its bookmarks.
pub(crate) fn has_read_all(books: &[Book], tables: &Tables, collector: &str) -> bool {
    books.iter().all(|book| {
        let Some((life, last)) = book.lives.last().and_then(|life| Some((life, life.last()?)))
        else {
            return false;
        };
        let sequence = life.len() as u64;
        let is_last = |entry: &&Entry| {
            entry.recorder == book.name
                && (entry.changed, entry.state) == (last.changed.0.into(), last.state.0.into())
        };
        let name = tables.entries.iter().find(is_last).map(|entry| entry.life);
        tables.bookmarks.iter().any(|bookmark| {
            (&bookmark.recorder, Some(bookmark.life)) == (&book.name, name)
                && bookmark.collector == collector
                && bookmark.sequence.cast_unsigned() == sequence
        })
    })
}

/// Judges an archive by the books of all recorders.
pub(crate) fn judge(books: &[Book], tables: &Tables, filled: Filled) -> Verdict {
    let mut verdict = Verdict::default();
    if tables.conflicts > 0 {
        verdict.wrong.push(format!("{} conflicts", tables.conflicts));
    }
    for book in books {
        let mut case = Case::open(book, tables, filled);
        case.identify();
        case.hear_gaps();
        case.count();
        case.check_promises();
        verdict.wrong.extend(case.wrong.iter().map(|wrong| format!("{}: {wrong}", book.name)));
        let missing = case.missing.iter().map(|missing| format!("{}: {missing}", book.name));
        verdict.missing.extend(missing);
    }
    let is_known = |name: &str| books.iter().any(|book| book.name == name);
    let stray = tables.entries.iter().filter(|entry| !is_known(&entry.recorder)).count();
    if stray > 0 {
        verdict.wrong.push(format!("{stray} entries of recorders that nobody has"));
    }
    verdict
}

/// What is known of a life of the log.
#[derive(Default)]
struct Life {
    /// Its name in the archive, if any entry of it is there.
    name: Option<i64>,
    there: BTreeSet<u64>,
    /// Numbers that are told to be overwritten.
    overwritten: BTreeSet<u64>,
    /// After which numbers it is told that the log began anew.
    anew_after: BTreeSet<u64>,
}

impl Life {
    /// Whether the entry is there, or told to be missing.
    fn is_accounted(&self, number: u64) -> bool {
        self.there.contains(&number) || self.overwritten.contains(&number)
    }

    /// The last number that is accounted for.
    fn last(&self) -> u64 {
        let last = |set: &BTreeSet<u64>| set.last().copied().unwrap_or(0);
        last(&self.there).max(last(&self.overwritten))
    }
}

/// One recorder.
struct Case<'t> {
    book: &'t Book,
    tables: &'t Tables,
    filled: Filled,
    entries: Vec<&'t Entry>,
    lives: Vec<Life>,
    by_name: BTreeMap<i64, usize>,
    /// Names of lives without an entry that are told to have ended.
    ended_empty: bool,
    wrong: Vec<String>,
    missing: Vec<String>,
}

impl<'t> Case<'t> {
    fn open(book: &'t Book, tables: &'t Tables, filled: Filled) -> Case<'t> {
        let entries = tables.entries.iter().filter(|entry| entry.recorder == book.name).collect();
        Case {
            book,
            tables,
            filled,
            entries,
            lives: book.lives.iter().map(|_| Life::default()).collect(),
            by_name: BTreeMap::new(),
            ended_empty: false,
            wrong: Vec::new(),
            missing: Vec::new(),
        }
    }

    /// Each entry is a move of this recorder, at its place in its life, with its stamp.
    fn identify(&mut self) {
        let mut moves: HashMap<(i64, i64), (usize, u64, &Played)> = HashMap::new();
        for (life, played) in self.book.lives.iter().enumerate() {
            for (number, moved) in (1..).zip(played) {
                let content = (moved.changed.0.into(), moved.state.0.into());
                moves.insert(content, (life, number, moved));
            }
        }
        let mut clocks: BTreeMap<usize, (i64, i64)> = BTreeMap::new();
        for entry in std::mem::take(&mut self.entries) {
            let Entry { life: name, sequence, .. } = *entry;
            let Some(&(life, number, moved)) = moves.get(&(entry.changed, entry.state)) else {
                self.wrong.push(format!("no move of this recorder: {entry:?}"));
                continue;
            };
            if *self.by_name.entry(name).or_insert(life) != life {
                self.wrong.push(format!("life {name:016x} is two lives of the books: {entry:?}"));
            }
            if *self.lives[life].name.get_or_insert(name) != name {
                self.wrong.push(format!("life {life} has two names: {entry:?}"));
            }
            if !self.lives[life].there.insert(number) {
                self.wrong.push(format!("twice: move {number} of life {life}, {entry:?}"));
            }
            let slot = (number - 1) % u64::from(self.book.size) + 1;
            if (sequence, entry.number) != (number.cast_signed(), slot.cast_signed()) {
                self.wrong.push(format!("it is move {number} of life {life}: {entry:?}"));
            }
            if entry.known != i64::from(u32::MAX) {
                self.wrong.push(format!("all inputs are known: {entry:?}"));
            }
            let Some(ms) = stamp_ms(entry.stamp) else {
                self.wrong.push(format!("no date: {entry:?}"));
                continue;
            };
            let clock = clocks.entry(life).or_insert((i64::MIN, i64::MAX));
            clock.0 = clock.0.max(ms - i64::from(moved.tick_after));
            clock.1 = clock.1.min(ms - i64::from(moved.tick_before));
            if clock.0 > clock.1 {
                self.wrong.push(format!("its stamp is not that of its tick: {entry:?} {moved:?}"));
            }
        }
    }

    /// What is told of losses.
    fn hear_gaps(&mut self) {
        for evidence in &self.tables.evidence {
            if evidence.recorder != self.book.name || evidence.kind != "gap" {
                continue;
            }
            let gap: Value = serde_json::from_str(&evidence.line).expect("a line of JSON");
            let after = gap["after"].as_u64();
            let (why, count) = (gap["why"].as_str(), gap["count"].as_str());
            let Some(&life) = self.by_name.get(&evidence.life) else {
                match (why, after) {
                    (Some("log began anew"), Some(0)) => self.ended_empty = true,
                    _ => self.wrong.push(format!("a gap of no life: {}", evidence.line)),
                }
                continue;
            };
            match (why, after, count, gap["lost"].as_u64()) {
                (Some("log began anew"), Some(after), Some("unknown"), None) => {
                    self.lives[life].anew_after.insert(after);
                }
                // Who comes to a full log has not seen how often its count has wrapped.
                (Some("overwritten"), Some(0), Some("at least"), Some(lost)) => {
                    self.overwritten(life, 1..=lost, &evidence.line);
                }
                (Some("overwritten"), Some(after), Some("exactly"), Some(lost)) => {
                    self.overwritten(life, after + 1..=after + lost, &evidence.line);
                }
                _ => self.wrong.push(format!("an unexpected gap: {}", evidence.line)),
            }
        }
    }

    fn overwritten(&mut self, life: usize, lost: std::ops::RangeInclusive<u64>, line: &str) {
        let moves = self.book.lives[life].len() as u64;
        if *lost.end() > moves {
            self.wrong.push(format!("of {moves} moves: {line}"));
        }
        for number in lost {
            let is_new = self.lives[life].overwritten.insert(number);
            let is_there = self.lives[life].there.contains(&number);
            if self.filled == Filled::ByOne && (!is_new || is_there) {
                self.wrong.push(format!("number {number} of life {life} is there: {line}"));
                return;
            }
        }
    }

    /// Nothing is missing that is not told.
    fn count(&mut self) {
        let mut told_before = false;
        for (place, (life, moves)) in self.lives.iter().zip(&self.book.lives).enumerate() {
            let (last, moves) = (life.last(), moves.len() as u64);
            let holes: Vec<u64> = (1..=last).filter(|&number| !life.is_accounted(number)).collect();
            if let (Some(first), Some(end)) = (holes.first(), holes.last()) {
                let count = holes.len();
                self.missing.push(format!("{count} of {first} to {end} in life {place}, untold"));
            }
            let is_current = place + 1 == self.lives.len();
            // Who has not read all that others have read tells of an earlier place.
            let is_told = match self.filled {
                Filled::ByOne => life.anew_after.contains(&last),
                Filled::BySeveral => !life.anew_after.is_empty(),
            };
            if last < moves && !is_told && (is_current || life.name.is_some() || !told_before) {
                self.missing.push(format!(
                    "what came after {last} of {moves} in life {place} of {}, untold",
                    self.lives.len()
                ));
            }
            let too_early = life.anew_after.iter().any(|&after| after < last);
            if self.filled == Filled::ByOne && too_early {
                let anew = &life.anew_after;
                self.wrong.push(format!("life {place} went on to {last} after {anew:?}"));
            }
            if is_current && !life.anew_after.is_empty() {
                self.wrong.push(format!("life {place} of {} is not over", self.lives.len()));
            }
            // A log that was read and ended is told, and so is everything until the next one that
            // was read.
            told_before = if life.name.is_some() { is_told } else { told_before };
        }
    }

    /// What is promised elsewhere is kept: bookmarks, and what was watched.
    fn check_promises(&mut self) {
        for bookmark in &self.tables.bookmarks {
            if bookmark.recorder == self.book.name {
                self.all_there(bookmark.life, bookmark.sequence.cast_unsigned(), "a bookmark");
            }
        }
        for evidence in &self.tables.evidence {
            if evidence.recorder == self.book.name && evidence.kind == "watched" {
                let watched: Value = serde_json::from_str(&evidence.line).expect("a line of JSON");
                let through = watched["through"].as_u64().unwrap_or(u64::MAX);
                self.all_there(evidence.life, through, "what was watched");
            }
        }
    }

    fn all_there(&mut self, name: i64, through: u64, what: &str) {
        let life = self.by_name.get(&name).map(|&life| &self.lives[life]);
        let is_there = match life {
            Some(life) => (1..=through).all(|number| life.is_accounted(number)),
            None => through == 0,
        };
        if !is_there {
            self.wrong.push(format!("{what} up to {through} of life {name:016x} is not there"));
        }
    }
}
