//! A site as JSON for programs: every value that is in force, names in place of indices.

use ser_evidence::site::{
    Chatter, ClockRule, Edge, IncidentRules, Point, PointId, Recorder, RecorderId, Site,
};
use serde_json::{Value, json};

use crate::site_file::{model_name, role_name};

/// The whole site.
pub(super) fn site(site: &Site) -> Value {
    let IncidentRules { quiet_us, chatter: Chatter { changes, within_us } } = site.incident;
    json!({
        "site": site.name,
        "digest": site.digest.map(|digest| digest.to_string()),
        "time_zone": site.time_zone.iana_name(),
        "utc_doubt_us": site.utc_doubt_us,
        "recorders": site.recorders.iter().map(recorder).collect::<Vec<_>>(),
        "points": site.points.iter().map(|point| self::point(site, point)).collect::<Vec<_>>(),
        "groups": site.groups.iter().map(|group| {
            json!({ "name": group.name, "first_out": group.first_out })
        }).collect::<Vec<_>>(),
        "expectations": site.expectations.iter().map(|expect| json!({
            "name": expect.name,
            "after": edge(site, expect.after),
            "then": edge(site, expect.then),
            "within_us": [expect.within_us.0, expect.within_us.1],
        })).collect::<Vec<_>>(),
        "observations": site.observations.iter().map(|seen| json!({
            "recorder": recorder_name(site, seen.recorder),
            "host_time": utc(seen.host_time.us()),
            "unit_time": utc(seen.unit_time.us()).map(|time| time.trim_end_matches('Z').to_owned()),
            "doubt_us": seen.doubt_us,
        })).collect::<Vec<_>>(),
        "shifts": site.shifts.iter().map(|shift| json!({
            "recorder": recorder_name(site, shift.recorder),
            "us": shift.us,
            "from": utc(shift.from.us()),
            "to": utc(shift.to.us()),
            "why": shift.why,
        })).collect::<Vec<_>>(),
        "incident": {
            "quiet_us": quiet_us,
            "chatter": { "changes": changes, "within_us": within_us },
        },
    })
}

fn recorder(recorder: &Recorder) -> Value {
    json!({
        "name": recorder.name,
        "port": recorder.port,
        "model": recorder.model.map(model_name),
        "baud": recorder.baud.map(ser_proto::Baud::bits_per_second),
        "log_size": recorder.log_size,
        "original": recorder.is_original,
        "clock": match recorder.clock {
            ClockRule::Utc => json!("utc"),
            ClockRule::Local => json!("local"),
            ClockRule::Offset(seconds) => json!(seconds),
        },
        "drift_ppb": recorder.drift_ppb,
        "wander_ppb": recorder.wander_ppb,
        "delays_us": {
            "closing": [recorder.delays.closing_us.0, recorder.delays.closing_us.1],
            "opening": [recorder.delays.opening_us.0, recorder.delays.opening_us.1],
        },
    })
}

fn point(site: &Site, point: &Point) -> Value {
    let group = point.group.and_then(|group| site.groups.get(group.0));
    json!({
        "recorder": recorder_name(site, point.recorder),
        "input": point.input,
        "name": point.name,
        "role": point.role.map(role_name),
        "equipment": point.equipment,
        "group": group.map(|group| &group.name),
        "on": point.on,
        "off": point.off,
        "normal": point.normal.map(|on| if on { "on" } else { "off" }),
        "same_as": point.same_as.map(|other| place(site, other)),
        "inverted": point.inverted,
    })
}

fn edge(site: &Site, edge: Edge) -> Value {
    let mut place = place(site, edge.point);
    if let Some(fields) = place.as_object_mut() {
        fields.insert("to".to_owned(), json!(if edge.on { "on" } else { "off" }));
    }
    place
}

fn place(site: &Site, point: PointId) -> Value {
    let point = site.points.get(point.0);
    json!({
        "recorder": point.and_then(|point| recorder_name(site, point.recorder)),
        "point": point.map(|point| &point.name),
    })
}

fn recorder_name(site: &Site, recorder: RecorderId) -> Option<&String> {
    site.recorders.get(recorder.0).map(|recorder| &recorder.name)
}

fn utc(us: i64) -> Option<String> {
    jiff::Timestamp::from_microsecond(us).ok().map(|time| time.to_string())
}
