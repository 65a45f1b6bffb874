//! The status for people: a line for each fact, a blank line between the parts.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::io::{self, Write};

use chrono::DateTime;
use ser_proto::{
    ClockSource, Configuration, Counter, CounterGroup, CounterWeight, Guard, Identity, InputFilter,
};

use super::clock::Clock;
use super::facts::Facts;
use crate::commands::config::write_line_settings;
use crate::filter_text::{self, count, inputs};
use crate::output::{Palette, Points, ago, field, offset};

/// What is called how.
pub(super) struct Names<'a> {
    pub(super) points: &'a Points,
    pub(super) palette: Palette,
}

pub(super) fn write(out: &mut dyn Write, facts: &Facts, names: &Names<'_>) -> io::Result<()> {
    write_log(out, facts, names.points)?;
    if let Some(identity) = &facts.identity {
        writeln!(out)?;
        write_identity(out, identity, facts.counts_last())?;
    }
    if let Some(clock) = &facts.clock {
        writeln!(out)?;
        write_clock(out, clock)?;
    }
    if facts.filters.is_some() || facts.counters.is_some() {
        writeln!(out)?;
    }
    if let Some(filters) = &facts.filters {
        write_filters(out, filters, names.points)?;
    }
    if let Some(counters) = &facts.counters {
        write_counters(out, counters, names)?;
    }
    Ok(())
}

fn write_log(out: &mut dyn Write, facts: &Facts, points: &Points) -> io::Result<()> {
    let Facts { mode, position, configuration, latest, .. } = facts;
    if let Some(model) = facts.model() {
        field(out, "inputs", model.inputs())?;
    }
    if let Some(mode) = mode {
        field(out, "mode", if mode.recording { "recording" } else { "stopped" })?;
        field(out, "version", format_args!("{}.{:02}", mode.version / 100, mode.version % 100))?;
    }
    field(out, "events", format_args!("{} since the last erase (modulo 65536)", position.total))?;
    let next = u32::from(position.next_slot) + 1;
    match configuration {
        Some(Configuration { size, .. }) => {
            field(out, "next entry", format_args!("{next} of {size}"))?;
        }
        None => field(out, "next entry", next)?,
    }
    match latest {
        Some((number, entry, _)) => {
            field(out, "latest event", format_args!("{} (entry {number})", entry.time))?;
            field(out, "inputs on", points.on(entry.state))?;
        }
        None => field(out, "latest event", "none")?,
    }
    match configuration {
        Some(configuration) => write_line_settings(out, configuration),
        None => Ok(()),
    }
}

fn write_identity(out: &mut dyn Write, identity: &Identity, counts_last: bool) -> io::Result<()> {
    let Identity {
        level, firmware, capabilities, id, power_ups, life, log_capacity, guard, ..
    } = identity;
    field(out, "firmware", firmware)?;
    match id {
        Some(id) => field(out, "id", id)?,
        None => field(out, "id", "none: it was not given one")?,
    }
    match counts_last {
        true => field(out, "power-ups", power_ups)?,
        false => field(out, "power-ups", "not counted: it cannot keep the count")?,
    }
    field(out, "life of log", life)?;
    field(out, "log capacity", format_args!("{log_capacity} entries"))?;
    if *guard != Guard::None {
        field(out, "guard", guard)?;
    }
    field(out, "extension", format_args!("level {level}: {capabilities}"))
}

fn write_clock(out: &mut dyn Write, clock: &Clock) -> io::Result<()> {
    let Clock { reading, ahead_us, reference, is_of_site } = clock;
    let shown = DateTime::from_timestamp_micros(reading.clock_us);
    match shown {
        Some(shown) => field(out, "clock", shown.naive_utc().format("%Y-%m-%dT%H:%M:%S%.3f"))?,
        None => field(out, "clock", format_args!("{} us since 1970", reading.clock_us))?,
    }
    let since = ago(reading.age_s);
    match reading.source {
        ClockSource::NeverSet => {
            return field(
                out,
                "clock source",
                format_args!("never set since power-up, {since} ago"),
            );
        }
        ClockSource::Battery => {
            field(out, "clock source", format_args!("{}, read {since} ago", reading.source))?;
        }
        source => field(out, "clock source", format_args!("{source}, {since} ago"))?,
    }
    let zone = match is_of_site {
        true => reference.to_string(),
        false => "local time".to_owned(),
    };
    match ahead_us {
        Some(ahead) => {
            field(
                out,
                "clock offset",
                format_args!("{} to {zone} of this computer", offset(*ahead)),
            )?;
        }
        None => field(out, "clock offset", "not known: it shows no time that can be compared")?,
    }
    match reading.doubt_us {
        Some(doubt_us) => field(out, "clock doubt", format_args!("± {} ms", ms(doubt_us.into())))?,
        None => field(out, "clock doubt", "the recorder does not know how far it may be off")?,
    }
    match reading.drift_ppb {
        Some(drift_ppb) => {
            let way = if drift_ppb < 0 { "slow" } else { "fast" };
            let ppm = ms(drift_ppb.unsigned_abs().into());
            field(out, "clock drift", format_args!("{ppm} ppm {way}"))
        }
        None => Ok(()),
    }
}

/// Thousandths with as many decimals as there are.
fn ms(us: u64) -> String {
    let text = format!("{}.{:03}", us / 1000, us % 1000);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// The filter that most inputs have, and then the others.
fn write_filters(out: &mut dyn Write, filters: &[InputFilter], points: &Points) -> io::Result<()> {
    // By their texts: filters that read the same are the same.
    let mut groups: BTreeMap<String, Vec<u8>> = BTreeMap::new();
    for (input, filter) in (1..=u8::MAX).zip(filters) {
        groups.entry(filter_text::whole(filter)).or_default().push(input);
    }
    let mut groups: Vec<(String, Vec<u8>)> = groups.into_iter().collect();
    groups.sort_by_key(|(_, inputs)| (usize::MAX - inputs.len(), inputs.first().copied()));
    let mut name = "filters";
    let mut line = |value: &dyn Display| field(out, std::mem::take(&mut name), value);
    match groups.as_slice() {
        [] => Ok(()),
        [(filter, _)] => line(&format_args!("{filter}, on all inputs")),
        [(filter, _), others @ ..] => {
            line(&format_args!("{filter}, on all inputs but these:"))?;
            others.iter().try_for_each(|(filter, of)| {
                line(&format_args!("{}: {filter}", inputs(of, points)))
            })
        }
    }
}

/// What was lost and left out, and whether there is more to see.
fn write_counters(
    out: &mut dyn Write,
    counters: &[(Counter, u32)],
    names: &Names<'_>,
) -> io::Result<()> {
    let mut name = "left out";
    for (counter, value) in counters {
        let Some(input) = counter.suppressed_input().filter(|_| *value > 0) else { continue };
        let input = inputs(&[input], names.points);
        let changes = changes(*value);
        field(out, name, format_args!("{input}: {changes} by its chatter filter"))?;
        name = "";
    }
    let of_weight = |weight| {
        let is_here = move |(counter, value): &&(Counter, u32)| {
            *value > 0
                && counter.group() != CounterGroup::Inputs
                && counter.weight() == Some(weight)
        };
        counters.iter().filter(is_here)
    };
    let lost: Vec<String> = of_weight(CounterWeight::Lost)
        .map(|(counter, value)| format!("{counter} {}", count((*value).into())))
        .collect();
    let style = names.palette.alarm;
    match (lost.as_slice(), of_weight(CounterWeight::Trouble).count()) {
        ([], 0) => field(out, "counters", "no loss and no trouble since power-up"),
        ([], more) => field(out, "counters", format_args!("no loss; {}", trouble(more))),
        (lost, 0) => {
            field(out, "counters", format_args!("{style}{}{style:#}", lost.join(", ")))?;
            field(out, "", "ser-cli diagnostics says what that is")
        }
        (lost, more) => {
            field(out, "counters", format_args!("{style}{}{style:#}", lost.join(", ")))?;
            field(out, "", trouble(more))
        }
    }
}

fn trouble(counters: usize) -> String {
    let tell = if counters == 1 { "counter tells" } else { "counters tell" };
    format!("{counters} {tell} of trouble since power-up: ser-cli diagnostics")
}

fn changes(count: u32) -> String {
    match count {
        1 => "1 change".to_owned(),
        count => format!("{} changes", filter_text::count(count.into())),
    }
}

#[cfg(test)]
mod tests {
    use std::num::NonZeroU8;

    use ser_client::LogPosition;
    use ser_proto::{
        Capabilities, ChatterFilter, ClockReading, FirmwareVersion, Mode, Model, RecorderId,
    };

    use super::*;
    use crate::output::testing::{entry, points};
    use ser_observer::ClockSetting;

    fn text(facts: &Facts, points: &Points) -> String {
        let mut out = Vec::new();
        write(&mut out, facts, &Names { points, palette: Palette::plain() }).unwrap();
        String::from_utf8(out).unwrap()
    }

    fn original() -> Facts {
        Facts {
            position: LogPosition { total: 0, next_slot: 0 },
            mode: None,
            configuration: None,
            latest: None,
            identity: None,
            clock: None,
            filters: None,
            counters: None,
        }
    }

    #[test]
    fn everything_known_is_shown_and_nothing_else() {
        let facts = Facts {
            position: LogPosition { total: 7, next_slot: 7 },
            mode: Some(Mode { recording: true, version: 105 }),
            configuration: Some(Configuration::default()),
            latest: Some((7, entry("00.250", &[3], &[1, 3]), Model::Ser160)),
            ..original()
        };
        assert_eq!(
            text(&facts, &Points::default()),
            "inputs          16\n\
             mode            recording\n\
             version         1.05\n\
             events          7 since the last erase (modulo 65536)\n\
             next entry      8 of 2048\n\
             latest event    2026-11-22T10:00:00.250 (entry 7)\n\
             inputs on       1 3\n\
             line baud       9600\n\
             auto report     off\n\
             report to       0\n\
             auto print      off\n"
        );
        assert_eq!(
            text(&original(), &Points::default()),
            "events          0 since the last erase (modulo 65536)\n\
             next entry      1\n\
             latest event    none\n"
        );
    }

    fn reading() -> ClockReading {
        ClockReading {
            token: 1,
            clock_us: 1_795_341_600_250_999,
            source: ClockSource::HostOverRs232,
            age_s: 3725,
            doubt_us: Some(2000),
            drift_ppb: Some(-12_500),
            tick_us: 0,
            life: 259,
            next_sequence: 8,
            last_mark: None,
        }
    }

    fn clock(reading: ClockReading, ahead_us: Option<(i64, i64)>) -> Facts {
        let reference = ClockSetting::of_this_computer();
        let clock = Clock { reading, ahead_us, reference, is_of_site: false };
        Facts { clock: Some(clock), ..original() }
    }

    #[test]
    fn a_recorder_of_ours_says_who_it_is() {
        let capabilities = Capabilities::TIME.with(Capabilities::LASTING_COUNTS);
        let identity = Identity {
            level: 1,
            model: Model::Ser320,
            firmware: FirmwareVersion { major: 1, minor: 2, patch: 3 },
            capabilities,
            id: RecorderId::new(*b"number 12345"),
            power_ups: 42,
            life: 259,
            log_capacity: 2048,
            guard: Guard::None,
        };
        let shown = text(&Facts { identity: Some(identity), ..original() }, &Points::default());
        assert_eq!(
            shown,
            "inputs          32\n\
             events          0 since the last erase (modulo 65536)\n\
             next entry      1\n\
             latest event    none\n\
             \n\
             firmware        1.2.3\n\
             id              6e756d626572203132333435\n\
             power-ups       42\n\
             life of log     259\n\
             log capacity    2048 entries\n\
             extension       level 1: time, lasting counts\n"
        );
        let forgetful = Identity { capabilities: Capabilities::TIME, id: None, ..identity };
        let shown = text(&Facts { identity: Some(forgetful), ..original() }, &Points::default());
        assert!(shown.contains("id              none: it was not given one\n"), "{shown}");
        assert!(shown.contains("power-ups       not counted"), "{shown}");
    }

    #[test]
    fn a_clock_has_its_offset_its_doubt_and_where_its_time_is_from() {
        let shown = text(&clock(reading(), Some((-800, 1600))), &Points::default());
        let (_, shown) = shown.split_once("\n\n").unwrap();
        assert_eq!(
            shown,
            "clock           2026-11-22T10:00:00.250\n\
             clock source    set by a host over RS-232, 1 h 2 min ago\n\
             clock offset    +0.4 ± 1.2 ms to local time of this computer\n\
             clock doubt     ± 2 ms\n\
             clock drift     12.5 ppm slow\n"
        );
        let never = ClockReading { source: ClockSource::NeverSet, age_s: 5, ..reading() };
        let shown = text(&clock(never, None), &Points::default());
        assert!(shown.ends_with("clock source    never set since power-up, 5 s ago\n"), "{shown}");
    }

    #[test]
    fn filters_are_those_of_most_inputs_and_then_the_others() {
        let changes = NonZeroU8::new(10).unwrap();
        let chatter = Some(ChatterFilter { changes, window_ms: 1000, rearm_ms: 2000 });
        let five = InputFilter { debounce_ms: 5, chatter: None };
        let mut filters = vec![five; 16];
        let shown = |filters: &[InputFilter]| {
            let mut out = Vec::new();
            write_filters(&mut out, filters, &points()).unwrap();
            String::from_utf8(out).unwrap()
        };
        assert_eq!(shown(&filters), "filters         debounce 5 ms, on all inputs\n");
        filters[2] = InputFilter { debounce_ms: 5, chatter };
        filters[6] = InputFilter::OFF;
        filters[7] = InputFilter::OFF;
        assert_eq!(
            shown(&filters),
            "filters         debounce 5 ms, on all inputs but these:\n                \
             inputs 7, 8: off\n                \
             input 3 (52-1 closed): debounce 5 ms, chatter from 10 changes in 1 s, re-arm 2 s\n"
        );
    }

    #[test]
    fn what_was_lost_or_left_out_is_told_and_the_rest_pointed_at() {
        let shown = |counters: &[(Counter, u32)]| {
            let mut out = Vec::new();
            let names = Names { points: &points(), palette: Palette::plain() };
            write_counters(&mut out, counters, &names).unwrap();
            String::from_utf8(out).unwrap()
        };
        let input = Counter::suppressed(3).unwrap();
        let well = [(Counter::EDGES_LOST, 0), (Counter::BROADCASTS, 5), (input, 0)];
        assert_eq!(shown(&well), "counters        no loss and no trouble since power-up\n");
        assert_eq!(
            shown(&[(Counter::FRAMES_CHECKSUM, 2)]),
            "counters        no loss; 1 counter tells of trouble since power-up: ser-cli \
             diagnostics\n"
        );
        assert_eq!(
            shown(&[
                (Counter::FRAMES_CHECKSUM, 2),
                (Counter::EDGES_LOST, 1234),
                (Counter::SAMPLES_MISSED, 1),
                (input, 1234),
                (Counter::suppressed(4).unwrap(), 1),
            ]),
            "left out        input 3 (52-1 closed): 1,234 changes by its chatter filter\n                \
             input 4: 1 change by its chatter filter\n\
             counters        edges_lost 1,234, samples_missed 1\n                \
             1 counter tells of trouble since power-up: ser-cli diagnostics\n"
        );
    }
}
