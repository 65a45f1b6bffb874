//! The sequence of changes in words: a line for each, in the order of the timeline.

use std::collections::{BTreeMap, HashMap, HashSet};

use ser_evidence::clock::Nominal;
use ser_evidence::incident::{Fold, Row};
use ser_evidence::time::Moment;
use ser_evidence::timeline::{ChangeId, EventId, Timeline};

pub(super) use super::brackets::Sign;
use super::brackets::{Bracket, brackets};
use super::marks::Marks;
use super::span::{doubt, since};
use super::{Clock, Document, clock_sets, elsewhere, names};

/// A line of the sequence.
#[derive(Debug)]
pub(super) enum Line<'d> {
    /// Something changed.
    Change(ChangeLine<'d>),
    /// Something is to be said about a place of a log.
    Remark(Remark),
}

/// A change in words. Empty texts are what nobody knows, or what says nothing here.
#[derive(Debug)]
pub(super) struct ChangeLine<'d> {
    pub(super) row: &'d Row,
    /// Where it stands in a bracket of lines whose order is not known.
    pub(super) bracket: Sign,
    pub(super) time: String,
    pub(super) since_first: String,
    pub(super) since_previous: String,
    pub(super) doubt: String,
    pub(super) recorder: String,
    pub(super) point: String,
    pub(super) state: String,
    /// Whether the state is not the normal one.
    pub(super) is_abnormal: bool,
    /// Whether it may have been first.
    pub(super) is_first: bool,
    /// The entry's sequence.
    pub(super) entry: String,
    /// The chatter that is folded into this line.
    pub(super) fold: Option<&'d Fold>,
    pub(super) notes: Vec<String>,
}

/// A line that is no change.
#[derive(Debug)]
pub(super) struct Remark {
    pub(super) recorder: String,
    pub(super) text: String,
    /// Whether something is missing here.
    pub(super) is_loss: bool,
    /// The bracket that goes on over it.
    pub(super) bracket: Sign,
}

/// A change of an entry of which nobody knows when it was.
#[derive(Debug)]
pub(super) struct TimelessLine {
    pub(super) recorder: String,
    pub(super) point: String,
    pub(super) state: String,
    pub(super) entry: String,
    /// What the clock showed.
    pub(super) showed: String,
    pub(super) note: &'static str,
}

/// All lines. Chatter is folded unless the document wants it row by row.
pub(super) fn lines<'d>(document: &Document<'d>, clock: &Clock) -> Vec<Line<'d>> {
    let timeline = document.timeline;
    let rows = shown_rows(document);
    let brackets = brackets(timeline, &rows);
    let told = Told {
        document,
        clock,
        marks: Marks::new(document),
        first: rows.first().map(|row| row.change),
        showed: elsewhere::notes(timeline, &rows, clock),
    };
    let mut sets = told.clock_sets(&rows);
    let mut lines = Vec::with_capacity(rows.len());
    let mut previous = None;
    for (place, (row, bracket)) in rows.iter().zip(&brackets).enumerate() {
        let gaps = told.gaps_ahead_of(row, previous);
        let remarks = gaps.into_iter().chain(sets.remove(&place).into_iter().flatten());
        let sign = bracket.sign.above();
        lines.extend(remarks.map(|remark| Line::Remark(Remark { bracket: sign, ..remark })));
        lines.push(Line::Change(told.change(row, previous, bracket)));
        previous = Some(row.change);
    }
    let incident = &document.report.incident;
    let events: HashSet<EventId> = incident.events.iter().copied().collect();
    let last = incident.gaps.iter().filter(|(event, _)| !events.contains(event));
    let last = last.filter_map(|&(event, index)| gap(timeline, event, index));
    lines.extend(last.map(Line::Remark));
    lines
}

/// Changes whose time nobody knows, in the order of the list.
pub(super) fn timeless(document: &Document<'_>) -> Vec<TimelessLine> {
    let Document { timeline, report, .. } = *document;
    let rows = report.rows.iter().filter(|row| elsewhere::is_timeless(timeline, row.change.event));
    let mut rows = rows.peekable();
    let marks = rows.peek().is_some().then(|| Marks::new(document));
    rows.map(|row| {
        let ChangeId { event, input } = row.change;
        let held = timeline.held(event);
        TimelessLine {
            recorder: names::recorder(timeline, event),
            point: names::point(timeline, row.point, input),
            state: names::state(timeline, row.point, row.on),
            entry: held.map_or(String::new(), |held| held.sequence.to_string()),
            showed: held
                .map_or(String::new(), |held| held.entry.time.to_string().replace('T', " ")),
            note: marks.as_ref().and_then(|marks| marks.first(row.change)).unwrap_or_default(),
        }
    })
    .collect()
}

/// All rows that have a time, or those of them that are not folded away.
fn shown_rows<'d>(document: &Document<'d>) -> Vec<&'d Row> {
    let Document { timeline, report, .. } = *document;
    let folded: HashSet<ChangeId> = match document.unfold {
        true => HashSet::new(),
        false => {
            let folds = report.chatter.iter();
            folds.flat_map(|fold| fold.changes.iter().skip(1).copied()).collect()
        }
    };
    let is_shown = |row: &&Row| {
        !folded.contains(&row.change) && !elsewhere::is_timeless(timeline, row.change.event)
    };
    report.rows.iter().filter(is_shown).collect()
}

/// What all lines are made from.
struct Told<'a, 'd> {
    document: &'a Document<'d>,
    clock: &'a Clock,
    marks: Marks<'d>,
    /// The first row.
    first: Option<ChangeId>,
    /// What clocks showed, for rows that are not listed at that.
    showed: HashMap<EventId, String>,
}

impl<'d> Told<'_, 'd> {
    fn change(
        &self,
        row: &'d Row,
        previous: Option<ChangeId>,
        bracket: &Bracket,
    ) -> ChangeLine<'d> {
        let timeline = self.document.timeline;
        let ChangeId { event, input } = row.change;
        let first = self.first.filter(|first| *first != row.change);
        let delta = |from: Option<ChangeId>| {
            let us = from.and_then(|from| timeline.delta(from, row.change).middle_us());
            us.map(since).unwrap_or_default()
        };
        let time = timeline.time(event).map(Moment::us);
        let off = doubt_us(timeline, row.change);
        ChangeLine {
            row,
            bracket: bracket.sign,
            time: time.map_or("not known".to_owned(), |at| self.clock.time(at)),
            since_first: delta(first),
            since_previous: delta(previous),
            doubt: off.map_or("?".to_owned(), |us| format!("± {}", doubt(us))),
            recorder: names::recorder(timeline, event),
            point: names::point(timeline, row.point, input),
            state: names::state(timeline, row.point, row.on),
            is_abnormal: names::is_abnormal(timeline, row.point, row.on) == Some(true),
            is_first: self.marks.is_first(row.change),
            entry: timeline.held(event).map_or(String::new(), |held| held.sequence.to_string()),
            fold: self.marks.fold(row.change).filter(|_| !self.document.unfold),
            notes: self.notes(row, previous, bracket),
        }
    }

    /// What else is to be said about a change.
    fn notes(&self, row: &Row, previous: Option<ChangeId>, bracket: &Bracket) -> Vec<String> {
        let timeline = self.document.timeline;
        let event = row.change.event;
        let begins_entry = previous.is_none_or(|previous| previous.event != event);
        let mut notes = Vec::new();
        notes.extend(self.marks.first(row.change).map(str::to_owned));
        if !begins_entry {
            notes.push("same millisecond".to_owned());
        }
        notes.extend(self.marks.fold(row.change).map(|fold| chatter(timeline, fold)));
        notes.extend(local_time_note(timeline, event, self.clock));
        notes.extend(self.showed.get(&event).filter(|_| begins_entry).cloned());
        let shift = timeline.shift_us(event);
        if shift != 0 {
            notes.push(format!("shifted by hand {}", since(shift)));
        }
        notes.extend(bracket.note.clone());
        notes
    }

    /// What is missing ahead of a row.
    fn gaps_ahead_of(&self, row: &Row, previous: Option<ChangeId>) -> Vec<Remark> {
        let event = row.change.event;
        if previous.is_some_and(|previous| previous.event == event) {
            return Vec::new();
        }
        let gaps = self.marks.gaps_ahead_of(event).iter();
        gaps.filter_map(|&index| gap(self.document.timeline, event, index)).collect()
    }

    /// When clocks were set, by the place of the row that comes next: by the time itself if that is
    /// known, but never on the other side of a row of the same recorder.
    fn clock_sets(&self, rows: &[&Row]) -> BTreeMap<usize, Vec<Remark>> {
        let timeline = self.document.timeline;
        let mut sets: BTreeMap<usize, Vec<Remark>> = BTreeMap::new();
        // The row after the last one of each recorder so far.
        let mut after_last: HashMap<u32, usize> = HashMap::new();
        for (place, row) in rows.iter().enumerate() {
            let event = row.change.event;
            let first = after_last.insert(event.recorder, place + 1).unwrap_or(0);
            let begins_entry = place
                .checked_sub(1)
                .and_then(|before| rows.get(before))
                .is_none_or(|before| before.change.event != event);
            if !begins_entry || !self.marks.is_set_ahead_of(event) {
                continue;
            }
            let Some(set) = clock_sets::ahead_of(timeline, event, self.clock) else { continue };
            let is_later = |row: &&Row| set.at_us < timeline.time(row.change.event).map(Moment::us);
            let between = rows.get(first..place).unwrap_or_default();
            let before = set.at_us.and_then(|_| between.iter().position(is_later));
            let recorder = names::recorder(timeline, event);
            let remark = Remark { recorder, text: set.text, is_loss: false, bracket: Sign::None };
            sets.entry(before.map_or(place, |before| first + before)).or_default().push(remark);
        }
        sets
    }
}

/// How far a change may be off, either way, in microseconds.
pub(super) fn doubt_us(timeline: &Timeline<'_>, change: ChangeId) -> Option<i64> {
    let bounds = timeline.moved_on(change.event, Some(change.input));
    bounds.values().next().and_then(|&(lo, hi)| Some(hi?.saturating_sub(lo?) / 2))
}

/// Chatter as `chatter ×15, last +144.0 ms`.
pub(super) fn chatter(timeline: &Timeline<'_>, fold: &Fold) -> String {
    let last = fold.changes.last().copied();
    let lasted = last.and_then(|last| timeline.delta(fold.first, last).middle_us());
    let lasted = lasted.map_or(String::new(), |us| format!(", last {}", since(us)));
    format!("chatter ×{}{lasted}", fold.changes.len())
}

/// What is to be said of a local time that nobody observed.
fn local_time_note(timeline: &Timeline<'_>, event: EventId, clock: &Clock) -> Option<String> {
    if timeline.moved_utc(event, None).is_known() {
        return None;
    }
    match timeline.nominal(event) {
        Nominal::Ambiguous(early, late) => Some(format!(
            "this hour came twice: {} or {}",
            clock.date_and_time_with_offset(early.us()),
            clock.date_and_time_with_offset(late.us())
        )),
        Nominal::Missing(_) => Some("this hour was left out".to_owned()),
        Nominal::Time(_) | Nominal::NotKnown => None,
    }
}

fn gap(timeline: &Timeline<'_>, event: EventId, index: usize) -> Option<Remark> {
    let gap = timeline.life(event)?.gaps.get(index)?;
    let (recorder, text) = (names::recorder(timeline, event), super::missing(gap.lost, gap.why));
    Some(Remark { recorder, text, is_loss: true, bracket: Sign::None })
}
