//! What was expected to follow, and whether it did.

use std::collections::BTreeSet;

use super::Row;
use super::completeness::is_covered_until;
use super::pick::Incident;
use super::points::Points;
use super::suppressed;
use crate::site::{Edge, Expectation};
use crate::timeline::{ChangeId, Delta, EventId, Timeline};

/// One expectation, each time that its beginning happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StepResult {
    /// Index of the expectation in the site.
    pub expectation: usize,
    /// What started it.
    pub after: ChangeId,
    /// What followed, if it did.
    pub then: Option<ChangeId>,
    /// The time between them.
    pub delta: Option<Delta>,
    /// Whether that is as expected.
    pub verdict: Verdict,
}

/// Whether something happened as expected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// In the window.
    InTime,
    /// Before it.
    Early,
    /// After it.
    Late,
    /// It did not happen, and it would have been recorded.
    Missing,
    /// It cannot be said.
    NotDecidable(Doubt),
}

/// Why a verdict cannot be given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Doubt {
    /// What is known of the time reaches over an end of the window.
    Straddles,
    /// Nothing is known of the time between the two.
    NoCommonTime,
    /// One of the two changed, and its source does not say to what.
    UnknownState,
    /// Something is missing in the log that should show it.
    Gap,
    /// Changes of the input that should show it may have been left out, because it chattered.
    LeftOut,
    /// The log that should show it was not read later than this.
    NotReadSince,
}

/// The results of all expectations whose beginning is in the incident.
pub(super) fn results(
    timeline: &Timeline<'_>,
    points: &Points,
    incident: &Incident,
    rows: &[Row],
) -> Vec<StepResult> {
    let mut results = Vec::new();
    for (index, expectation) in timeline.site().expectations.iter().enumerate() {
        let mut taken = BTreeSet::new();
        let beginnings: Vec<&Row> =
            rows.iter().filter(|row| may_be(row, expectation.after)).collect();
        for (place, after) in beginnings.iter().enumerate() {
            let next = beginnings.get(place + 1).map(|row| row.change);
            let (has_begun, after) = (after.on.is_some(), after.change);
            let mut followers = rows.iter().filter(|row| may_be(row, expectation.then));
            let follows = |row: &&Row| {
                !taken.contains(&row.change) && is_between(timeline, after, row.change, next)
            };
            let then = followers.find(follows).map(|row| row.change);
            let then = then.or_else(|| outside(timeline, points, expectation, after, next));
            taken.extend(then);
            let delta = then.map(|then| timeline.delta(after, then));
            let verdict = match (then, delta) {
                (Some(then), _) if !is_state_known(timeline, then) => UNKNOWN_STATE,
                _ if !has_begun => UNKNOWN_STATE,
                (_, Some(delta)) => in_window(delta, expectation.within_us),
                _ => absent(timeline, points, incident, expectation, after),
            };
            results.push(StepResult { expectation: index, after, then, delta, verdict });
        }
    }
    results
}

const UNKNOWN_STATE: Verdict = Verdict::NotDecidable(Doubt::UnknownState);

/// Whether a row shows this edge, or a change of its point to a state that nobody knows.
fn may_be(row: &Row, edge: Edge) -> bool {
    row.point == Some(edge.point) && row.on.is_none_or(|on| on == edge.on)
}

fn is_state_known(timeline: &Timeline<'_>, change: ChangeId) -> bool {
    timeline.held(change.event).is_some_and(|held| held.known.contains(change.input))
}

/// Whether a change may have followed one and not yet the next of its kind.
fn is_between(
    timeline: &Timeline<'_>,
    after: ChangeId,
    then: ChangeId,
    next: Option<ChangeId>,
) -> bool {
    let is_not_before = |one: ChangeId, other: ChangeId| {
        timeline.delta(one, other).hi_us.is_none_or(|most| most >= 0)
    };
    is_not_before(after, then) && next.is_none_or(|next| is_not_before(then, next))
}

/// What followed and is not among the rows of the incident: after a quiet time, or after its end.
fn outside(
    timeline: &Timeline<'_>,
    points: &Points,
    expectation: &Expectation,
    after: ChangeId,
    next: Option<ChangeId>,
) -> Option<ChangeId> {
    let Edge { point, on } = expectation.then;
    let point = timeline.site().points.get(point.0)?;
    let recorder = points.recorder(point.recorder)?;
    let begins = timeline.sort_key(after.event)?;
    let until = begins.saturating_add(expectation.within_us.1).saturating_add(SLACK_US);
    let lives = (0_u32..).zip(&timeline.history().recorders.get(recorder as usize)?.lives);
    let mut found: Vec<(i64, ChangeId)> = Vec::new();
    for (life, of_life) in lives {
        for (place, held) in (0_u32..).zip(&of_life.entries) {
            let is_it = held.entry.changed.contains(point.input)
                && held.state_of(point.input).is_none_or(|state| state == on);
            let change = ChangeId { event: EventId { recorder, life, place }, input: point.input };
            let key = is_it.then(|| timeline.sort_key(change.event)).flatten();
            found.extend(key.filter(|key| (begins..=until).contains(key)).map(|key| (key, change)));
        }
    }
    found.sort_unstable();
    let mut changes = found.into_iter().map(|(_, change)| change);
    changes.find(|&change| is_between(timeline, after, change, next))
}

/// Clocks may be so far apart that what followed in time seems to be later, in microseconds.
const SLACK_US: i64 = 1_000_000;

fn in_window(delta: Delta, (earliest, latest): (i64, i64)) -> Verdict {
    let (Some(lo), Some(hi)) = (delta.lo_us, delta.hi_us) else {
        return Verdict::NotDecidable(Doubt::NoCommonTime);
    };
    match () {
        () if lo >= earliest && hi <= latest => Verdict::InTime,
        () if hi < earliest => Verdict::Early,
        () if lo > latest => Verdict::Late,
        () => Verdict::NotDecidable(Doubt::Straddles),
    }
}

/// What did not follow is missing only if it would have been seen.
fn absent(
    timeline: &Timeline<'_>,
    points: &Points,
    incident: &Incident,
    expectation: &Expectation,
    after: ChangeId,
) -> Verdict {
    let point = timeline.site().points.get(expectation.then.point.0);
    let recorder = point.and_then(|point| points.recorder(point.recorder));
    let Some(recorder) = recorder else { return Verdict::NotDecidable(Doubt::NotReadSince) };
    if incident.gaps.iter().any(|(event, _)| event.recorder == recorder) {
        return Verdict::NotDecidable(Doubt::Gap);
    }
    if point.is_some_and(|point| suppressed::may_lack(timeline, incident, recorder, point.input)) {
        return Verdict::NotDecidable(Doubt::LeftOut);
    }
    match is_covered_until(timeline, recorder, after, expectation.within_us.1) {
        true => Verdict::Missing,
        false => Verdict::NotDecidable(Doubt::NotReadSince),
    }
}
