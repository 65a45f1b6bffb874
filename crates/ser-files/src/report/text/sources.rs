//! What the report is made from: recorders, their completeness and their clocks, shifts, digests.

use std::io::{self, Write};

use ser_evidence::clock::{Finding, LinkReason};
use ser_evidence::incident::{ClockState, Completeness};
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
        ("complete", Align::Left),
        ("clock", Align::Left),
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
    writeln!(
        out,
        "{faint}{} entries, sha256 {digest}{faint:#}",
        document.report.incident.events.len()
    )?;
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

/// From when to when nothing is missing.
fn complete(timeline: &Timeline<'_>, of: &Completeness, clock: &Clock) -> String {
    let at = |event: EventId| {
        timeline.time(event).map(ser_evidence::time::Moment::us).map(|at| clock.date_and_time(at))
    };
    let read = of.read_until.map(|reading| clock.date_and_time(reading.utc.us()));
    let Some((first, last)) = of.unbroken else {
        return read.map_or_else(
            || "no entries".to_owned(),
            |read| format!("no entries, read until {read}"),
        );
    };
    let until = read.or_else(|| at(last)).unwrap_or_else(|| "?".to_owned());
    let Some(from) = at(first) else { return "time not known".to_owned() };
    // The date once, if it is the same.
    let date = from.split_inclusive(' ').next().unwrap_or_default();
    format!("{from} to {}", until.strip_prefix(date).unwrap_or(&until))
}

fn clock_text(state: ClockState) -> String {
    match state {
        ClockState::NotObserved => "never observed: its times are as it showed them".to_owned(),
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
