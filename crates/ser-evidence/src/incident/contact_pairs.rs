//! The two auxiliary contacts of a breaker, which should not agree for long: one is on when the
//! other is off.

use std::collections::BTreeMap;

use super::Row;
use super::pick::Incident;
use super::points::Points;
use super::returns::state_before;
use crate::site::{PointId, Role};
use crate::timeline::{ChangeId, Delta, Timeline};

/// Both contacts of a breaker were on, or both off.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Disagreement {
    /// The breaker, from the site.
    pub equipment: String,
    /// Whether both were on.
    pub both_on: bool,
    /// Since when; `None`: since before the first row.
    pub since: Option<ChangeId>,
    /// Until when; `None`: still at its end.
    pub until: Option<ChangeId>,
    /// For how long, if both are known.
    pub lasted: Option<Delta>,
}

/// The contacts of one breaker.
struct Pair {
    equipment: String,
    closed: PointId,
    open: PointId,
}

/// All times in the incident at which contacts of a pair disagreed.
pub(super) fn disagreements(
    timeline: &Timeline<'_>,
    points: &Points,
    incident: &Incident,
    rows: &[Row],
) -> Vec<Disagreement> {
    let pairs = pairs(timeline);
    pairs.iter().flat_map(|pair| of_pair(timeline, points, incident, rows, pair)).collect()
}

fn pairs(timeline: &Timeline<'_>) -> Vec<Pair> {
    let mut by_equipment: BTreeMap<&str, (Option<PointId>, Option<PointId>)> = BTreeMap::new();
    for (index, point) in timeline.site().points.iter().enumerate() {
        let Some(equipment) = &point.equipment else { continue };
        let pair = by_equipment.entry(equipment).or_default();
        match point.role {
            Some(Role::BreakerClosed) => pair.0 = pair.0.or(Some(PointId(index))),
            Some(Role::BreakerOpen) => pair.1 = pair.1.or(Some(PointId(index))),
            _ => {}
        }
    }
    let complete = |(equipment, (closed, open)): (&str, _)| {
        Some(Pair { equipment: equipment.to_owned(), closed: closed?, open: open? })
    };
    by_equipment.into_iter().filter_map(complete).collect()
}

fn of_pair(
    timeline: &Timeline<'_>,
    points: &Points,
    incident: &Incident,
    rows: &[Row],
    pair: &Pair,
) -> Vec<Disagreement> {
    let before = |point| state_before(timeline, points, incident, point);
    let (mut closed, mut open) = (before(pair.closed), before(pair.open));
    let mut found: Vec<Disagreement> = Vec::new();
    let mut current: Option<Disagreement> = None;
    let begin = |both_on: bool, since: Option<ChangeId>| Disagreement {
        equipment: pair.equipment.clone(),
        both_on,
        since,
        until: None,
        lasted: None,
    };
    if let Some(both_on) = closed.filter(|_| closed == open) {
        current = Some(begin(both_on, None));
    }
    let of_pair = |row: &&Row| [Some(pair.closed), Some(pair.open)].contains(&row.point);
    let mut moved = rows.iter().filter(of_pair).peekable();
    while let Some(row) = moved.next() {
        let contact = if row.point == Some(pair.closed) { &mut closed } else { &mut open };
        *contact = row.on;
        // Both in one sample count as one.
        if moved.peek().is_some_and(|next| next.change.event == row.change.event) {
            continue;
        }
        let both = closed.zip(open).filter(|(closed, open)| closed == open).map(|(on, _)| on);
        if current.as_ref().map(|current| current.both_on) == both {
            continue;
        }
        if let Some(mut ended) = current.take() {
            ended.until = Some(row.change);
            ended.lasted = ended.since.map(|since| timeline.delta(since, row.change));
            found.push(ended);
        }
        current = both.map(|both_on| begin(both_on, Some(row.change)));
    }
    found.extend(current);
    found
}
