//! Events as one JSON object, with names and times.

use std::io::{self, Write};

use ser_evidence::time::Moment;
use ser_evidence::timeline::{ChangeId, EventId, Item, Timeline};
use ser_files::missing_text;
use serde_json::{Value, json};

use super::filter::Filter;
use crate::output::{PROGRAM, json_to};

/// The version of the object.
const SCHEMA: u32 = 1;

/// Writes events and losses in their order.
pub(super) fn write(
    out: &mut dyn Write,
    timeline: &Timeline<'_>,
    items: &[Item],
    filter: &Filter,
) -> io::Result<()> {
    let points = ser_evidence::incident::Points::new(timeline);
    let mut rows = Vec::new();
    for item in items {
        match *item {
            Item::Entry(event) => {
                let Some(held) = timeline.held(event) else { continue };
                let changes = held.entry.changed.numbers();
                let changes = changes.filter(|&input| filter.wants(ChangeId { event, input }));
                let changes = changes.map(|input| {
                    let point = points.of(ChangeId { event, input });
                    let point = point.and_then(|point| timeline.site().points.get(point.0));
                    let on = held.state_of(input);
                    let state = point.zip(on).map(|(point, on)| match on {
                        true => &point.on,
                        false => &point.off,
                    });
                    json!({
                        "input": input,
                        "point": point.map(|point| &point.name),
                        "on": on,
                        "state": state,
                    })
                });
                let changes: Vec<Value> = changes.collect();
                rows.push(event_row(timeline, event, &changes));
            }
            Item::Gap(event, index) => {
                let gap = timeline.life(event).and_then(|life| life.gaps.get(index));
                rows.extend(gap.map(|gap| {
                    json!({
                        "recorder": recorder(timeline, event),
                        "life": life(timeline, event),
                        "after": gap.after,
                        "missing": missing_text(gap.lost, gap.why),
                    })
                }));
            }
            Item::ClockSet(_) => {}
        }
    }
    json_to(out, &json!({ "schema": SCHEMA, "program": PROGRAM, "events": rows }))
}

fn event_row(timeline: &Timeline<'_>, event: EventId, changes: &[Value]) -> Value {
    let held = timeline.held(event);
    let utc = timeline.moved_utc(event, None);
    json!({
        "time": timeline.time(event).and_then(|at| rfc3339(at.us())),
        "earliest": utc.lo().map(Moment::us).and_then(rfc3339),
        "latest": utc.hi().map(Moment::us).and_then(rfc3339),
        "shown": held.map(|held| held.entry.time.to_string()),
        "recorder": recorder(timeline, event),
        "life": life(timeline, event),
        "sequence": held.map(|held| held.sequence),
        "entry": held.map(|held| held.number),
        "changes": changes,
    })
}

fn recorder(timeline: &Timeline<'_>, event: EventId) -> Option<String> {
    timeline.recorder(event).map(|history| history.recorder.name.clone())
}

fn life(timeline: &Timeline<'_>, event: EventId) -> Option<String> {
    timeline.life(event).map(|life| life.name().to_string())
}

fn rfc3339(us: i64) -> Option<String> {
    let at = jiff::Timestamp::from_microsecond(us).ok()?;
    Some(at.strftime("%Y-%m-%dT%H:%M:%S.%6fZ").to_string())
}
