//! The status as JSON for programs. What the recorder does not say is `null`.

use ser_client::LogPosition;
use ser_proto::{ClockReading, Configuration, Identity};
use serde_json::{Value, json};

use super::clock::Clock;
use super::facts::Facts;
use crate::commands::config::auto_report_name;
use crate::commands::diagnostics::counters_json;
use crate::commands::filter::Shown;
use crate::output::Points;

pub(super) fn status(facts: &Facts, recorder: &str, points: &Points) -> Value {
    let LogPosition { total, next_slot } = facts.position;
    let counters = facts.counters.as_deref();
    let filters = facts.filters.as_deref().map(|filters| {
        let counters = counters.unwrap_or_default();
        Shown { recorder, filters, points, counters }.filters_json()
    });
    json!({
        "recorder": recorder,
        "inputs": facts.model().map(ser_proto::Model::inputs),
        "recording": facts.mode.map(|mode| mode.recording),
        "version": facts.mode.map(|mode| mode.version),
        "total": total,
        "next_entry": u32::from(next_slot) + 1,
        "latest": facts.latest.map(|(number, entry, _)| json!({
            "entry": number,
            "time": entry.time.to_string(),
            "changed": entry.changed.numbers().collect::<Vec<_>>(),
            "state": entry.state.numbers().collect::<Vec<_>>(),
        })),
        "settings": facts.configuration.as_ref().map(settings),
        "identity": facts.identity.as_ref().map(|known| identity(known, facts.counts_last())),
        "clock": facts.clock.as_ref().map(clock),
        "filters": filters,
        "counters": counters.map(|counters| counters_json(counters, None)),
    })
}

fn settings(settings: &Configuration) -> Value {
    let Configuration { size, baud, auto_report, report_address, auto_print } = settings;
    json!({
        "size": size,
        "line_baud": baud.bits_per_second(),
        "auto_report": auto_report_name(*auto_report),
        "report_to": report_address,
        "auto_print": auto_print,
    })
}

fn identity(identity: &Identity, counts_last: bool) -> Value {
    let Identity {
        level, firmware, capabilities, id, power_ups, life, log_capacity, guard, ..
    } = identity;
    json!({
        "level": level,
        "firmware": firmware.to_string(),
        "capabilities": capabilities.0,
        "id": id.map(|id| id.to_string()),
        "power_ups": power_ups,
        "life": life,
        "counts_last": counts_last,
        "log_capacity": log_capacity,
        "guard": guard.code(),
    })
}

fn clock(clock: &Clock) -> Value {
    let Clock { reading, ahead_us, reference, is_of_site } = clock;
    let ClockReading { clock_us, source, age_s, doubt_us, drift_ppb, tick_us, life, .. } = reading;
    json!({
        "clock_us": clock_us,
        "source": source.code(),
        "age_s": age_s,
        "doubt_us": doubt_us,
        "drift_ppb": drift_ppb,
        "on_for_us": tick_us,
        "life": life,
        "next_sequence": reading.next_sequence,
        "ahead_us": ahead_us.map(|(lo, hi)| [lo, hi]),
        "ahead_of": if *is_of_site { reference.to_string() } else { "local time".to_owned() },
    })
}
