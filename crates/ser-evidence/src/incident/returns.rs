//! What has not returned to normal at the end of an incident.

use super::Row;
use super::pick::Incident;
use super::points::Points;
use crate::site::PointId;
use crate::timeline::{ChangeId, EventId, Timeline};

/// A point that is not in its normal state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Abnormal {
    /// The point.
    pub point: PointId,
    /// Whether it is on.
    pub on: bool,
    /// Since when; `None`: since before the incident. It may be in one of its entries that came
    /// [before the time asked for](Incident::earlier).
    pub since: Option<ChangeId>,
}

/// All points that are known not to be in their normal state at the end, in the order of the site.
pub(super) fn abnormal(
    timeline: &Timeline<'_>,
    points: &Points,
    incident: &Incident,
    rows: &[Row],
) -> Vec<Abnormal> {
    let site = timeline.site().points.iter().enumerate();
    site.filter_map(|(index, point)| {
        let (id, normal) = (PointId(index), point.normal?);
        let last = rows.iter().rfind(|row| row.point == Some(id));
        let on = match last {
            Some(row) => row.on?,
            None => state_before(timeline, points, incident, id)?,
        };
        let since = || match last {
            Some(row) => Some(row.change),
            None => earlier(timeline, points, incident, id),
        };
        (on != normal).then(|| Abnormal { point: id, on, since: since() })
    })
    .collect()
}

/// The last change of a point in the incident, before the time that was asked for.
fn earlier(
    timeline: &Timeline<'_>,
    points: &Points,
    incident: &Incident,
    point: PointId,
) -> Option<ChangeId> {
    let described = timeline.site().points.get(point.0)?;
    let recorder = points.recorder(described.recorder)?;
    let input = described.input;
    let moved = |event: &&EventId| {
        event.recorder == recorder
            && timeline.held(**event).is_some_and(|held| held.entry.changed.contains(input))
    };
    incident.earlier.iter().rfind(moved).map(|&event| ChangeId { event, input })
}

/// The state of a point before the incident, if its recorder shows it.
pub(super) fn state_before(
    timeline: &Timeline<'_>,
    points: &Points,
    incident: &Incident,
    point: PointId,
) -> Option<bool> {
    let described = timeline.site().points.get(point.0)?;
    let recorder = points.recorder(described.recorder)?;
    let of_recorder = |event: &&EventId| event.recorder == recorder;
    if let Some(&first) = incident.events.iter().find(of_recorder) {
        let held = timeline.held(first)?;
        let changed = held.entry.changed.contains(described.input);
        return held.state_of(described.input).map(|on| on != changed);
    }
    // Nothing happened there: it is as the last entry before left it.
    let begins = incident.events.first().and_then(|&first| timeline.sort_key(first))?;
    let last = timeline.last_before(recorder, begins)?;
    timeline.held(last)?.state_of(described.input)
}
