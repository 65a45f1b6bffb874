//! What the report is made from: recorders, their completeness and their clocks, shifts, digests.

use std::io::{self, Write};

use ser_evidence::clock::{Finding, Home, LinkReason};
use ser_evidence::incident::{ClockState, Completeness, StretchEnd};
use ser_evidence::record::HostReading;
use ser_evidence::timeline::{EventId, Timeline};

use super::{heading, names};
use crate::report::span::{doubt, duration};
use crate::report::style::Styles;
use crate::report::table::{Align, Cell, Table};
use crate::report::verdict;
use crate::report::{Clock, Document};

pub(super) fn write(
    out: &mut dyn Write,
    document: &Document<'_>,
    styles: Styles,
    clock: &Clock,
) -> io::Result<()> {
    heading(out, "Made from", styles)?;
    let mut table = Table::new(vec![
        ("recorder", Align::Left),
        ("entries", Align::Right),
        ("complete", Align::Wrapped),
        ("clock", Align::Wrapped),
    ]);
    for of in &document.report.completeness {
        table.row(row(document, of, styles, clock));
    }
    table.write(out, styles.faint)?;
    for missed in document.not_reached {
        let (recorder, why) = (names::harmless(&missed.recorder), names::harmless(&missed.why));
        let style = styles.alarm;
        writeln!(out, "{style}not reached{style:#} {recorder}: {why}")?;
    }
    findings(out, document.timeline, styles)?;
    shifts(out, document.timeline, clock)?;
    let faint = styles.faint;
    let digest: String = document.report.digest.iter().map(|byte| format!("{byte:02x}")).collect();
    let entries = match document.report.incident.events.len() {
        1 => "1 entry".to_owned(),
        count => format!("{count} entries"),
    };
    writeln!(out, "{faint}{entries}, sha256 {digest}{faint:#}")?;
    let site = document.site_digest.as_ref();
    let site = site.map_or_else(String::new, |digest| format!(", site file sha256 {digest}"));
    writeln!(out, "{faint}{}{site}{faint:#}", document.program)
}

fn row(document: &Document<'_>, of: &Completeness, styles: Styles, clock: &Clock) -> Vec<Cell> {
    let timeline = document.timeline;
    let name = verdict::recorder_name(timeline, of.recorder);
    let is_missed =
        document.not_reached.iter().any(|missed| names::harmless(&missed.recorder) == name);
    let complete = match verdict::incompleteness(timeline, of) {
        Some(text) => {
            let text = text.strip_prefix(&format!("{name}: ")).unwrap_or(&text).to_owned();
            Cell::styled(if is_missed { "not reached".to_owned() } else { text }, styles.alarm)
        }
        None => Cell::from(complete(timeline, of, clock)),
    };
    vec![
        Cell::from(name),
        Cell::from(of.entries.to_string()),
        complete,
        Cell::from(clock_text(of.clock)),
    ]
}

/// From when to when nothing is missing: in times if both ends are known on one scale, else by the
/// numbers of the entries.
fn complete(timeline: &Timeline<'_>, of: &Completeness, clock: &Clock) -> String {
    let read = of.read_until.map(|reading| clock.date_and_time(reading.utc.us()));
    let Some((first, last)) = of.unbroken else {
        return read.map_or_else(
            || "no entries until then".to_owned(),
            |read| format!("no entries until then, read until {read}"),
        );
    };
    let (from, until) = (entry_end(timeline, first), entry_end(timeline, last));
    let until = of.read_until.map(|reading| read_end(timeline, reading)).or(until);
    if let Some((from, until)) = from.zip(until).filter(|(from, until)| from.1 == until.1) {
        return span(&from, &until, clock);
    }
    let sequence =
        |end: StretchEnd| timeline.held(end.event).map_or(0, |held| held.sequence).to_string();
    let entries = match first.event == last.event {
        true => format!("entry {}", sequence(first)),
        false => format!("entries {} to {}", sequence(first), sequence(last)),
    };
    read.map_or_else(|| entries.clone(), |read| format!("{entries}, read until {read}"))
}

/// A moment in UTC with its doubt, and the scale on which that holds.
type End = ((i64, Option<i64>), Home);

/// When an entry was recorded, if its clock was observed.
fn entry_end(timeline: &Timeline<'_>, end: StretchEnd) -> Option<End> {
    let at = timeline.time(end.event)?.us();
    match end.clock {
        ClockState::Observed { utc_doubt_us: Some(us), .. } => Some(((at, Some(us)), Home::Utc)),
        ClockState::Observed { home, order_doubt_us, .. } => {
            Some(((at, order_doubt_us?.into()), home))
        }
        ClockState::NotObserved | ClockState::NoEntry => None,
    }
}

/// When a recorder was read last, by the host that did.
fn read_end(timeline: &Timeline<'_>, reading: HostReading) -> End {
    let doubt = reading.utc_doubt_us.or(timeline.site().utc_doubt_us);
    let doubt = doubt.and_then(|us| i64::try_from(us).ok());
    let scale = doubt.map_or(Home::Boot(reading.boot), |_| Home::Utc);
    ((reading.utc.us(), doubt), scale)
}

/// As `2026-11-22 11:00:00.250 ± 2.1 ms to 11:05:00.000 ± 1 ms`.
fn span((from, scale): &End, (until, _): &End, clock: &Clock) -> String {
    let with_doubt = |text: &str, us: Option<i64>| match us {
        Some(us) => format!("{text} ± {}", doubt(us)),
        None => text.to_owned(),
    };
    let (begins, ends) = (clock.date_and_time(from.0), clock.date_and_time(until.0));
    // The date once, if it is the same.
    let date = begins.split_inclusive(' ').next().unwrap_or_default();
    let ends = with_doubt(ends.strip_prefix(date).unwrap_or(&ends), until.1);
    let by = if *scale == Home::Utc { "" } else { " by the clock of the host" };
    format!("{} to {ends}{by}", with_doubt(&begins, from.1))
}

fn clock_text(state: ClockState) -> String {
    match state {
        ClockState::NoEntry => "no entries, so no times".to_owned(),
        ClockState::NotObserved => "never observed: times as it showed them".to_owned(),
        ClockState::Observed { order_doubt_us, utc_doubt_us, .. } => {
            let order = order_doubt_us.map_or("order not known".to_owned(), |us| {
                format!("± {} among recorders", doubt(us))
            });
            let utc = utc_doubt_us
                .map_or("UTC not known".to_owned(), |us| format!("± {} of UTC", doubt(us)));
            format!("{order}, {utc}")
        }
    }
}

/// What does not fit together.
fn findings(out: &mut dyn Write, timeline: &Timeline<'_>, styles: Styles) -> io::Result<()> {
    let name = |recorder: usize| {
        verdict::recorder_name(timeline, u32::try_from(recorder).unwrap_or(u32::MAX))
    };
    let style = styles.alarm;
    for finding in timeline.findings() {
        let text = match finding {
            Finding::Contradiction { recorder, .. } => format!(
                "{}: two observations of its clock contradict each other; what either allows is used",
                name(*recorder)
            ),
            Finding::NotPlaced { recorder, .. } => format!(
                "{}: an observation of its clock cannot be placed among its entries and is not used",
                name(*recorder)
            ),
            Finding::WrongLink { recorders: [one, other], why } => {
                let by = match why {
                    LinkReason::Broadcast(_) => "a broadcast",
                    LinkReason::Contact(..) => "a contact that both watch",
                };
                format!("{} and {}: {by} contradicts their clocks", name(*one), name(*other))
            }
            Finding::HostStepped(_) => {
                "the clock of a host was set between its observations".to_owned()
            }
        };
        writeln!(out, "{style}clocks{style:#} {text}")?;
    }
    for (one, other) in timeline.out_of_order() {
        let sequence = |event: &EventId| timeline.held(*event).map_or(0, |held| held.sequence);
        writeln!(
            out,
            "{style}clocks{style:#} {}: entry {} came before entry {}, and what is known of its clock \
             says otherwise",
            names::recorder(timeline, *one),
            sequence(one),
            sequence(other)
        )?;
    }
    Ok(())
}

/// What was added by hand.
fn shifts(out: &mut dyn Write, timeline: &Timeline<'_>, clock: &Clock) -> io::Result<()> {
    for shift in &timeline.site().shifts {
        let recorder = timeline.site().recorders.get(shift.recorder.0);
        let recorder = recorder.map_or_else(String::new, |found| names::harmless(&found.name));
        writeln!(
            out,
            "shifted by hand: {recorder} by {} from {} to {} ({})",
            duration(shift.us),
            clock.date_and_time(shift.from.us()),
            clock.date_and_time(shift.to.us()),
            names::harmless(&shift.why)
        )?;
    }
    Ok(())
}
