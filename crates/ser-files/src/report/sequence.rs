//! The sequence of changes in words: a line for each, in the order of the timeline.

use std::collections::BTreeSet;

use ser_evidence::clock::Nominal;
use ser_evidence::incident::{Fold, Report, Row};
use ser_evidence::time::Moment;
use ser_evidence::timeline::{ChangeId, EventId, Order, Timeline};

use super::names;
use super::span::{doubt, since};
use super::{Clock, Document, elsewhere};

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
    /// Whether a bracket goes on over it: nothing else than `None` and `Inner`.
    pub(super) bracket: Sign,
}

/// Where a line stands in a bracket.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Sign {
    #[default]
    None,
    First,
    Inner,
    Last,
}

impl Sign {
    /// Of what stands right below a line, before the next one.
    pub(super) const fn below(self) -> Sign {
        match self {
            Sign::First | Sign::Inner => Sign::Inner,
            Sign::None | Sign::Last => Sign::None,
        }
    }

    /// Of what stands right above a line, after the one before.
    const fn above(self) -> Sign {
        match self {
            Sign::Inner | Sign::Last => Sign::Inner,
            Sign::None | Sign::First => Sign::None,
        }
    }
}

/// All lines. Chatter is folded unless the document wants it row by row.
pub(super) fn lines<'d>(document: &Document<'d>, clock: &Clock) -> Vec<Line<'d>> {
    let rows = shown_rows(document);
    let brackets = brackets(document.timeline, &rows);
    let mut lines = Vec::with_capacity(rows.len());
    let mut previous = None;
    for (row, bracket) in rows.iter().zip(&brackets) {
        let sign = bracket.sign.above();
        let remarks = remarks_ahead(document, row, previous);
        lines.extend(remarks.map(|remark| Line::Remark(Remark { bracket: sign, ..remark })));
        lines.push(Line::Change(change(document, row, previous, bracket, clock)));
        previous = Some(row.change);
    }
    let incident = &document.report.incident;
    let last = incident.gaps.iter().filter(|(event, _)| {
        document.timeline.held(*event).is_none() || !incident.events.contains(event)
    });
    let last = last.filter_map(|&(event, index)| gap(document.timeline, event, index));
    lines.extend(last.map(Line::Remark));
    lines
}

/// All rows, or those that are not folded away.
fn shown_rows<'d>(document: &Document<'d>) -> Vec<&'d Row> {
    let folded: BTreeSet<ChangeId> = match document.unfold {
        true => BTreeSet::new(),
        false => {
            let folds = document.report.chatter.iter();
            folds.flat_map(|fold| fold.changes.iter().skip(1).copied()).collect()
        }
    };
    document.report.rows.iter().filter(|row| !folded.contains(&row.change)).collect()
}

fn change<'d>(
    document: &Document<'d>,
    row: &'d Row,
    previous: Option<ChangeId>,
    bracket: &Bracket,
    clock: &Clock,
) -> ChangeLine<'d> {
    let Document { timeline, report, .. } = *document;
    let ChangeId { event, input } = row.change;
    let first = report.rows.first().map(|row| row.change).filter(|first| *first != row.change);
    let delta = |from: Option<ChangeId>| {
        let us = from.and_then(|from| timeline.delta(from, row.change).middle_us());
        us.map(since).unwrap_or_default()
    };
    let time = timeline.time(event).map(Moment::us);
    let off = doubt_us(timeline, row.change);
    ChangeLine {
        row,
        bracket: bracket.sign,
        time: time.map_or("not known".to_owned(), |at| clock.time(at)),
        since_first: delta(first),
        since_previous: delta(previous),
        doubt: off.map_or("?".to_owned(), |us| format!("± {}", doubt(us))),
        recorder: names::recorder(timeline, event),
        point: names::point(timeline, row.point, input),
        state: names::state(timeline, row.point, row.on),
        is_abnormal: names::is_abnormal(timeline, row.point, row.on) == Some(true),
        is_first: report.first_out.includes(timeline, row.change),
        entry: timeline.held(event).map_or(String::new(), |held| held.sequence.to_string()),
        fold: fold_of(report, row.change).filter(|_| !document.unfold),
        notes: notes(document, row, previous, bracket, clock),
    }
}

/// How far a change may be off, either way, in microseconds.
pub(super) fn doubt_us(timeline: &Timeline<'_>, change: ChangeId) -> Option<i64> {
    let bounds = timeline.moved_on(change.event, Some(change.input));
    bounds.values().next().and_then(|&(lo, hi)| Some(hi?.saturating_sub(lo?) / 2))
}

fn fold_of(report: &Report, first: ChangeId) -> Option<&Fold> {
    report.chatter.iter().find(|fold| fold.first == first)
}

/// Chatter as `chatter ×15, last +144.0 ms`.
pub(super) fn chatter(timeline: &Timeline<'_>, fold: &Fold) -> String {
    let last = fold.changes.last().copied();
    let lasted = last.and_then(|last| timeline.delta(fold.first, last).middle_us());
    let lasted = lasted.map_or(String::new(), |us| format!(", last {}", since(us)));
    format!("chatter ×{}{lasted}", fold.changes.len())
}

/// Where a row stands among those whose order is not known.
#[derive(Clone, Debug, Default)]
struct Bracket {
    sign: Sign,
    /// At the end of one: what is said about it.
    note: Option<String>,
}

/// Neighbours whose order is not known are in one bracket.
fn brackets(timeline: &Timeline<'_>, rows: &[&Row]) -> Vec<Bracket> {
    let is_unknown = |one: &Row, other: &Row| {
        timeline.order(one.change.event, other.change.event) == Order::Unknown
    };
    let mut brackets = vec![Bracket::default(); rows.len()];
    let mut first = 0;
    while first < rows.len() {
        let mut last = first;
        // A row belongs to it if its order to any of them is not known.
        while let Some(next) = rows.get(last + 1)
            && rows
                .get(first..=last)
                .is_some_and(|these| these.iter().any(|row| is_unknown(row, next)))
        {
            last += 1;
        }
        if last > first {
            for (place, bracket) in
                brackets.iter_mut().enumerate().skip(first).take(last + 1 - first)
            {
                bracket.sign = match place {
                    place if place == first => Sign::First,
                    place if place == last => Sign::Last,
                    _ => Sign::Inner,
                };
            }
            if let (Some(bracket), Some(these)) = (brackets.get_mut(last), rows.get(first..=last)) {
                bracket.note = Some(unknown_within(timeline, these));
            }
        }
        first = last + 1;
    }
    brackets
}

/// How far apart the truth of neighbours of unknown order may be.
fn unknown_within(timeline: &Timeline<'_>, rows: &[&Row]) -> String {
    if let [one, other] = rows
        && timeline.same_movement(one.change) == Some(other.change)
    {
        return "the same contact on both".to_owned();
    }
    let mut widest = 0;
    for (place, one) in rows.iter().enumerate() {
        for other in rows.iter().skip(place + 1) {
            if timeline.order(one.change.event, other.change.event) != Order::Unknown {
                continue;
            }
            let delta = timeline.delta(one.change, other.change);
            match (delta.lo_us, delta.hi_us) {
                (Some(lo), Some(hi)) => widest = widest.max(lo.abs()).max(hi.abs()),
                _ => return "order not known".to_owned(),
            }
        }
    }
    format!("order unknown within {}", doubt(widest))
}

/// What else is to be said about a change.
fn notes(
    document: &Document<'_>,
    row: &Row,
    previous: Option<ChangeId>,
    bracket: &Bracket,
    clock: &Clock,
) -> Vec<String> {
    let Document { timeline, report, .. } = *document;
    let is_first = report.first_out.includes(timeline, row.change);
    let mut notes = Vec::new();
    if is_first {
        let is_known = report.first_out.known().is_some();
        notes.push(if is_known { "first-out" } else { "maybe first-out" }.to_owned());
    }
    if previous.is_some_and(|previous| previous.event == row.change.event) {
        notes.push("same millisecond".to_owned());
    }
    notes.extend(fold_of(report, row.change).map(|fold| chatter(timeline, fold)));
    notes.extend(local_time_note(timeline, row.change.event, clock));
    notes.extend(elsewhere::note(timeline, row.change.event, clock));
    let shift = timeline.shift_us(row.change.event);
    if shift != 0 {
        notes.push(format!("shifted by hand {}", since(shift)));
    }
    notes.extend(bracket.note.clone());
    notes
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

/// What is to be said ahead of a row.
fn remarks_ahead(
    document: &Document<'_>,
    row: &Row,
    previous: Option<ChangeId>,
) -> impl Iterator<Item = Remark> {
    let Document { timeline, report, .. } = *document;
    let event = row.change.event;
    let begins_entry = previous.is_none_or(|previous| previous.event != event);
    let gaps = report.incident.gaps.iter().filter(|(ahead_of, _)| *ahead_of == event);
    let gaps: Vec<Remark> =
        gaps.filter_map(|&(event, index)| gap(timeline, event, index)).collect();
    // Ahead of the first entry of a log, nothing was stamped by the clock as it was before.
    let was_set = event.place != 0 && report.incident.clock_sets.contains(&event);
    let set = was_set.then(|| Remark {
        recorder: names::recorder(timeline, event),
        text: "the clock was set here".to_owned(),
        is_loss: false,
        bracket: Sign::None,
    });
    gaps.into_iter().chain(set).filter(move |_| begins_entry)
}

fn gap(timeline: &Timeline<'_>, event: EventId, index: usize) -> Option<Remark> {
    let gap = timeline.life(event)?.gaps.get(index)?;
    let (recorder, text) = (names::recorder(timeline, event), super::missing(gap.lost, gap.why));
    Some(Remark { recorder, text, is_loss: true, bracket: Sign::None })
}
