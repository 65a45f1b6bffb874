//! The names of things, made fit for a line of text.

use ser_console::Harmless;
use ser_evidence::incident::Row;
use ser_evidence::site::{Edge, Point, PointId};
use ser_evidence::timeline::{ChangeId, EventId, Timeline};

/// The name of a recorder.
pub(crate) fn recorder(timeline: &Timeline<'_>, event: EventId) -> String {
    timeline.recorder(event).map_or(String::new(), |found| harmless(&found.recorder.name))
}

/// The name of a point; `input 7` if it has none.
pub(crate) fn point(timeline: &Timeline<'_>, id: Option<PointId>, input: u8) -> String {
    let named = id.and_then(|id| point_of(timeline, id));
    named.map_or_else(|| format!("input {input}"), |point| harmless(&point.name))
}

/// The name of a point, with that of its recorder: `U1-SER1/52-1 closed`.
pub(crate) fn full_point(timeline: &Timeline<'_>, id: PointId) -> String {
    let named = point_of(timeline, id);
    let recorder = named.and_then(|point| timeline.site().recorders.get(point.recorder.0));
    let recorder = recorder.map_or(String::new(), |found| harmless(&found.name));
    format!("{recorder}/{}", point(timeline, Some(id), 0))
}

/// What is said of a state that no source tells.
pub(crate) const UNKNOWN_STATE: &str = "state not known";

/// What a state is called.
pub(crate) fn state(
    timeline: &Timeline<'_>,
    id: Option<PointId>,
    on: impl Into<Option<bool>>,
) -> String {
    let on = on.into();
    let called = match id.and_then(|id| point_of(timeline, id)) {
        Some(point) => state_of(point, on).map(harmless),
        None => on.map(|on| (if on { "ON" } else { "OFF" }).to_owned()),
    };
    called.unwrap_or_else(|| UNKNOWN_STATE.to_owned())
}

/// What the site calls a state of a point. One that is not known has a name only where both states
/// are called alike: what a device says of itself has one word.
pub(crate) fn state_of(point: &Point, on: Option<bool>) -> Option<&str> {
    match on {
        Some(true) => Some(&point.on),
        Some(false) => Some(&point.off),
        None => (point.on == point.off).then_some(&point.on),
    }
}

/// A change in a sentence: `52-1 closed OPEN (U1-SER1)`. If two recorders saw it, both are named.
pub(crate) fn change(timeline: &Timeline<'_>, row: &Row) -> String {
    let ChangeId { event, input } = row.change;
    let same = timeline.same_movement(row.change);
    let also =
        same.map_or(String::new(), |same| format!(" and {}", recorder(timeline, same.event)));
    format!(
        "{} {} ({}{also})",
        point(timeline, row.point, input),
        state(timeline, row.point, row.on),
        recorder(timeline, event)
    )
}

/// An edge in a sentence: `52-1 closed OPEN`.
pub(crate) fn edge(timeline: &Timeline<'_>, edge: Edge) -> String {
    format!(
        "{} {}",
        point(timeline, Some(edge.point), 0),
        state(timeline, Some(edge.point), edge.on)
    )
}

/// Whether this is not the normal state of a point; `None` if it has no normal one, or if the state
/// is not known.
pub(crate) fn is_abnormal(
    timeline: &Timeline<'_>,
    id: Option<PointId>,
    on: impl Into<Option<bool>>,
) -> Option<bool> {
    Some(point_of(timeline, id?)?.normal? != on.into()?)
}

/// A point of the site.
pub(crate) fn point_of<'t>(timeline: &Timeline<'t>, id: PointId) -> Option<&'t Point> {
    timeline.site().points.get(id.0)
}

/// Text from outside on one line.
pub(crate) fn harmless(text: &str) -> String {
    Harmless(text).line()
}
