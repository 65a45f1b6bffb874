//! The messages of our extension as text.

use chrono::DateTime;
use ser_proto::{ClockReading, ClockSource, Counters, Filters, Identity, InputFilter};

pub(super) fn identity_text(identity: &Identity) -> String {
    let Identity { level, model, firmware, capabilities, id, power_ups, life, log_capacity, guard } =
        identity;
    let id = id.map_or("no id".to_string(), |id| format!("id {id}"));
    format!(
        "identity: {} inputs, firmware {firmware}, {id}; level {level}, with {capabilities}; \
         power-up {power_ups}, life {life}; a log of up to {log_capacity} entries; {guard}",
        model.inputs()
    )
}

pub(super) fn question_text(token: u16) -> String {
    format!("query the clock, token {token:04X}h")
}

pub(super) fn clock_text(reading: &ClockReading) -> String {
    let ClockReading { token, clock_us, source, age_s, tick_us, life, next_sequence, .. } = reading;
    let source = match source {
        ClockSource::NeverSet => source.to_string(),
        source => format!("{source} {age_s} s ago"),
    };
    let doubt = reading
        .doubt_us
        .map_or("doubt not known".to_string(), |doubt_us| format!("doubt {doubt_us} us"));
    let drift = reading
        .drift_ppb
        .map_or("drift not known".to_string(), |drift_ppb| format!("drift {drift_ppb} ppb"));
    let mark = reading.last_mark.map_or("no mark yet".to_string(), |mark| {
        format!("last mark {:04X}h at {}", mark.token, date_text(mark.clock_us))
    });
    format!(
        "clock: {}, {source}, {doubt}, {drift}; token {token:04X}h, {tick_us} us after power-up; \
         life {life}, next sequence {next_sequence}; {mark}",
        date_text(*clock_us)
    )
}

/// A date with microseconds; the number where there is no such date.
fn date_text(clock_us: i64) -> String {
    DateTime::from_timestamp_micros(clock_us).map_or(format!("{clock_us} us since 1970"), |time| {
        time.naive_utc().format("%Y-%m-%dT%H:%M:%S%.6f").to_string()
    })
}

pub(super) fn setting_text(input: Option<u8>, filter: &InputFilter) -> String {
    match input {
        Some(input) => format!("set the filter of input {input}: {filter}"),
        None => format!("set the filters of all inputs: {filter}"),
    }
}

pub(super) fn filters_text(filters: &Filters) -> String {
    let first = filters.first;
    match filters.filters.len() {
        0 => format!("filters: none from input {first} on"),
        1 => format!("filters of input {first}"),
        count => format!("filters of {count} inputs from input {first} on"),
    }
}

pub(super) fn filter_lines(filters: &Filters) -> Vec<String> {
    filters.inputs().map(|(input, filter)| format!("{input:>5}  {filter}")).collect()
}

pub(super) fn counters_text(counters: &Counters) -> String {
    let first = counters.first.id();
    let end = match counters.next {
        Some(next) => format!("more from id {} on", next.id()),
        None => "no more".to_string(),
    };
    match counters.values.len() {
        0 => format!("counters: none from id {first} on; {end}"),
        1 => format!("1 counter, id {first}; {end}"),
        count => format!("{count} counters from id {first} on; {end}"),
    }
}

pub(super) fn counter_lines(counters: &Counters) -> Vec<String> {
    let line = |(counter, value): (ser_proto::Counter, u32)| {
        let name = counter.name().unwrap_or("not known here");
        format!("{:>5}  {name}  {value}", counter.id())
    };
    counters.counters().map(line).collect()
}
