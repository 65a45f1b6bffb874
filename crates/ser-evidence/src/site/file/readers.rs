//! How each kind of table is read.

use jiff::tz::TimeZone;
use ser_proto::MAX_SIZE;
use toml::Spanned;
use toml::de::DeTable;

use super::fields::{Fields, LONG, NAME, Range};
use super::kind;
use super::tables::{
    EdgeText, ExpectTable, GroupTable, ObservationTable, Owner, PointTable, RecorderTable,
    ShiftTable, SiteTable,
};
use super::words::{MODELS, ROLES, STATES, word};
use crate::site::checks::{
    bad_baud, bad_clock, bad_time, few_changes, same_texts, slash_in_recorder, unknown_zone,
    upside_down,
};
use crate::site::diagnostic::Findings;
use crate::site::model::{Chatter, Delays, IncidentRules};
use crate::time::{Moment, Utc};

impl SiteTable {
    /// Reads all tables of a document.
    pub(in crate::site) fn read<'t>(
        document: &'t Spanned<DeTable<'t>>,
        findings: &mut Findings,
    ) -> SiteTable {
        let mut fields = Fields::new(document.get_ref(), &kind::SITE, 0..0, findings);
        fields.require("site", "\"Northfield\"");
        fields.require("time_zone", "\"Europe/Berlin\"");
        let mut site = SiteTable {
            name: fields.name("site", NAME, "\"Northfield\""),
            time_zone: zone(&mut fields),
            utc_doubt_us: fields.table("host", &kind::HOST).and_then(|mut host| {
                unsigned(host.thousandths("utc_doubt_ms", Range::TIME_MS, "20"))
            }),
            incident: fields
                .table("incident", &kind::INCIDENT)
                .map_or_else(IncidentRules::default, |mut table| incident(&mut table)),
            ..SiteTable::default()
        };
        let SiteTable { recorders, points, groups, expectations, observations, shifts, .. } =
            &mut site;
        fields.for_each("recorder", &kind::RECORDER, |table| recorders.push(recorder(table)));
        fields.for_each("point", &kind::POINT, |table| points.push(point(table)));
        fields.for_each("group", &kind::GROUP, |table| groups.push(group(table)));
        fields.for_each("expect", &kind::EXPECT, |table| expectations.push(expect(table)));
        fields.for_each("observation", &kind::OBSERVATION, |table| {
            observations.push(observation(table));
        });
        fields.for_each("shift", &kind::SHIFT, |table| shifts.push(shift(table)));
        site
    }
}

fn zone(fields: &mut Fields<'_, '_>) -> Option<TimeZone> {
    let name = fields.text("time_zone", "\"Europe/Berlin\"")?;
    unknown_zone::zone(fields.findings, (name.span(), name.get_ref()))
}

fn recorder(fields: &mut Fields<'_, '_>) -> RecorderTable {
    const PPM: Range = Range { least: 0, most: 1_000_000, words: "0 to 1000 ppm" };
    const BITS: Range = Range { least: 1, most: 1_000_000, words: "1 to 1000000 bits per second" };
    const ENTRIES: Range = Range { least: 1, most: MAX_SIZE as i64, words: "1 to 2048 entries" };
    fields.require("name", "\"U1-SER1\"");
    let name = fields.name("name", NAME, "\"U1-SER1\"");
    if let Some(name) = &name {
        slash_in_recorder::passes(fields.findings, &name.span(), name.get_ref());
    }
    let clock = fields.text("clock", "\"utc\"");
    let baud = fields.whole("baud", BITS, "19200");
    RecorderTable {
        name,
        port: fields.name("port", LONG, "\"/dev/ttyUSB0\""),
        baud: baud.and_then(|baud| bad_baud::rate(fields.findings, &baud.span(), *baud.get_ref())),
        model: word(fields, "model", "\"ser320\"", MODELS, |_| None),
        is_original: fields.switch("original").map(Spanned::into_inner),
        log_size: unsigned(fields.whole("log_size", ENTRIES, "2048")),
        clock: clock
            .and_then(|clock| bad_clock::rule(fields.findings, &clock.span(), clock.get_ref())),
        drift_ppb: unsigned(fields.thousandths("drift_ppm", PPM, "50")),
        wander_ppb: unsigned(fields.thousandths("wander_ppm", PPM, "5")),
        delays: fields
            .table("delay_ms", &kind::DELAYS)
            .map_or_else(Delays::default, |mut table| delays(&mut table)),
    }
}

fn delays(fields: &mut Fields<'_, '_>) -> Delays {
    const DELAY: Range = Range { least: 0, most: 1_000_000, words: "0 to 1000 ms" };
    let mut delay = |key| {
        let (shortest, longest) = right_way_round(fields, key, DELAY, "[0.01, 0.05]")?;
        Some((u32::try_from(shortest).ok()?, u32::try_from(longest).ok()?))
    };
    let default = Delays::default();
    Delays {
        closing_us: delay("closing").unwrap_or(default.closing_us),
        opening_us: delay("opening").unwrap_or(default.opening_us),
    }
}

fn owner(fields: &mut Fields<'_, '_>) -> Owner {
    Owner {
        head: fields.head(),
        what: fields.what(),
        is_named: fields.has("recorder"),
        name: fields.reference("recorder", "\"U1-SER1\""),
    }
}

fn point(fields: &mut Fields<'_, '_>) -> PointTable {
    const INPUT: Range = Range { least: 1, most: 32, words: "1 to 32" };
    fields.require("input", "7");
    fields.require("name", "\"52-1 closed\"");
    let (on, off) = (fields.name("on", NAME, "\"CLOSED\""), fields.name("off", NAME, "\"OPEN\""));
    if let (Some(on), Some(off)) = (&on, &off)
        && on.get_ref() == off.get_ref()
    {
        same_texts::found(fields.findings, off.span(), on.span());
    }
    // Somebody wrote the text of the state in place of the state.
    let says = |text: &Option<Spanned<String>>, word: &str| {
        text.as_ref().is_some_and(|text| text.get_ref().eq_ignore_ascii_case(word))
    };
    let state_of = |word: &str| match (says(&on, word), says(&off, word)) {
        (true, _) => Some("on"),
        (_, true) => Some("off"),
        _ => None,
    };
    let normal = word(fields, "normal", "\"on\"", STATES, state_of).map(Spanned::into_inner);
    let input = fields.whole("input", INPUT, "7");
    PointTable {
        recorder: owner(fields),
        input: input.and_then(|input| {
            Some(Spanned::new(input.span(), u8::try_from(input.into_inner()).ok()?))
        }),
        name: fields.name("name", NAME, "\"52-1 closed\""),
        role: word(fields, "role", "\"52a\"", ROLES, |_| None).map(Spanned::into_inner),
        equipment: fields.name("equipment", NAME, "\"52-1\"").map(Spanned::into_inner),
        group: fields.reference("group", "\"Feeder 1\""),
        on: on.map(Spanned::into_inner),
        off: off.map(Spanned::into_inner),
        normal,
        same_as: fields.reference("same_as", "\"U1-SER2/52-1 closed\""),
        inverted: fields.switch("inverted"),
    }
}

fn group(fields: &mut Fields<'_, '_>) -> GroupTable {
    fields.require("name", "\"Feeder 1\"");
    GroupTable {
        name: fields.name("name", NAME, "\"Feeder 1\""),
        first_out: fields.switch("first_out").is_some_and(Spanned::into_inner),
    }
}

fn expect(fields: &mut Fields<'_, '_>) -> ExpectTable {
    fields.require("name", "\"52-1 clears the fault\"");
    fields.require("after", "\"Relay trip output on\"");
    fields.require("then", "\"52-1 closed off\"");
    fields.require("within_ms", "[15, 50]");
    let mut edge = |key| {
        let text = fields.reference(key, "\"52-1 closed off\"")?;
        Some(EdgeText { key, text })
    };
    let (after, then) = (edge("after"), edge("then"));
    ExpectTable {
        name: fields.name("name", NAME, "\"52-1 clears the fault\""),
        after,
        then,
        within_us: right_way_round(fields, "within_ms", Range::TIME_MS, "[15, 50]"),
    }
}

fn observation(fields: &mut Fields<'_, '_>) -> ObservationTable {
    for (key, example) in [
        ("host_time", "\"2026-11-22T09:00:00Z\""),
        ("unit_time", "\"2026-11-22T09:00:00.120\""),
        ("doubt_ms", "100"),
    ] {
        fields.require(key, example);
    }
    let host_time = fields.time("host_time", "\"2026-11-22T09:00:00Z\"");
    let unit_time = fields.time("unit_time", "\"2026-11-22T09:00:00.120\"");
    let shown = |findings: &mut Findings, time: &Spanned<String>| {
        bad_time::shown(findings, (&time.span(), time.get_ref()), "unit_time")
    };
    ObservationTable {
        recorder: owner(fields),
        host_time: host_time
            .and_then(|time| utc(fields, "host_time", &time))
            .map(Spanned::into_inner),
        unit_time: unit_time.and_then(|time| shown(fields.findings, &time)),
        doubt_us: unsigned(fields.thousandths("doubt_ms", Range::TIME_MS, "100")),
    }
}

fn shift(fields: &mut Fields<'_, '_>) -> ShiftTable {
    const CENTURY_MS: i64 = 36_525 * 86_400_000;
    const SHIFT: Range = Range {
        least: -CENTURY_MS * 1000,
        most: CENTURY_MS * 1000,
        words: "at most a hundred years, either way",
    };
    for (key, example) in [
        ("ms", "-250"),
        ("from", "\"2026-11-22T08:00:00Z\""),
        ("to", "\"2026-11-22T12:00:00Z\""),
        ("why", "\"clock found 250 ms fast\""),
    ] {
        fields.require(key, example);
    }
    let from = fields.time("from", "\"2026-11-22T08:00:00Z\"");
    let to = fields.time("to", "\"2026-11-22T12:00:00Z\"");
    ShiftTable {
        recorder: owner(fields),
        us: fields.thousandths("ms", SHIFT, "-250").map(Spanned::into_inner),
        from: from.and_then(|time| utc(fields, "from", &time)),
        to: to.and_then(|time| utc(fields, "to", &time)),
        why: fields.name("why", LONG, "\"clock found 250 ms fast\"").map(Spanned::into_inner),
    }
}

fn incident(fields: &mut Fields<'_, '_>) -> IncidentRules {
    const QUIET: Range = Range { least: 1, most: 86_400_000, words: "more than 0, up to a day" };
    let IncidentRules { quiet_us, chatter } = IncidentRules::default();
    let quiet_ms = fields.thousandths("quiet_s", QUIET, "5").map(Spanned::into_inner);
    IncidentRules {
        quiet_us: quiet_ms.map_or(quiet_us, |ms| ms * 1000),
        chatter: fields
            .table("chatter", &kind::CHATTER)
            .map_or(chatter, |mut table| self::chatter(&mut table)),
    }
}

fn chatter(fields: &mut Fields<'_, '_>) -> Chatter {
    const CHANGES: Range = Range { least: 0, most: 1_000_000, words: "3 to 1000000" };
    const WITHIN: Range =
        Range { least: 1, most: 86_400_000_000, words: "more than 0, up to a day" };
    fields.require("changes", "4");
    fields.require("within_ms", "300");
    let default = IncidentRules::default().chatter;
    let changes = fields.whole("changes", CHANGES, "4");
    let changes = changes.filter(|changes| {
        few_changes::passes(fields.findings, &changes.span(), *changes.get_ref())
    });
    let within_us = fields.thousandths("within_ms", WITHIN, "300").map(Spanned::into_inner);
    Chatter {
        changes: unsigned(changes).unwrap_or(default.changes),
        within_us: within_us.unwrap_or(default.within_us),
    }
}

fn utc(
    fields: &mut Fields<'_, '_>,
    key: &str,
    time: &Spanned<String>,
) -> Option<Spanned<Moment<Utc>>> {
    let span = time.span();
    let moment = bad_time::utc(fields.findings, (&span, time.get_ref()), key)?;
    Some(Spanned::new(span, moment))
}

fn right_way_round(
    fields: &mut Fields<'_, '_>,
    key: &str,
    range: Range,
    example: &str,
) -> Option<(i64, i64)> {
    let window = fields.window(key, range, example)?;
    let (shortest, longest) = *window.get_ref();
    if shortest > longest {
        upside_down::found(fields.findings, window.span(), key);
        return None;
    }
    Some((shortest, longest))
}

/// A number whose range has been looked at, as another type.
fn unsigned<T: TryFrom<i64>>(number: Option<Spanned<i64>>) -> Option<T> {
    T::try_from(number?.into_inner()).ok()
}
