//! The report as text for a terminal.

mod sequence;
mod sources;

use std::io::{self, Write};

use ser_evidence::incident::{StepResult, Verdict};

use super::names;
use super::span::{doubt, duration};
use super::style::Styles;
use super::table::{Align, Cell, Table, wrapped};
use super::verdict;
use super::{Clock, Document};

/// How wide lines of sentences are.
const WIDTH: usize = 96;

/// Writes a report.
///
/// # Errors
/// If `out` does not take it.
pub fn write(out: &mut dyn Write, document: &Document<'_>, styles: Styles) -> io::Result<()> {
    let clock = Clock::in_zone(document.timeline.site().time_zone.clone());
    headline(out, document, styles, &clock)?;
    verdict_lines(out, document, styles, &clock)?;
    sources::write(out, document, styles, &clock)?;
    sequence::write(out, document, styles, &clock)?;
    groups(out, document, styles, &clock)?;
    steps(out, document, styles)?;
    breakers(out, document, styles)?;
    normal(out, document, styles)
}

/// The site, and from when to when.
fn headline(
    out: &mut dyn Write,
    document: &Document<'_>,
    styles: Styles,
    clock: &Clock,
) -> io::Result<()> {
    let Document { timeline, report, .. } = *document;
    let events = &report.incident.events;
    let at = |event: Option<&_>| {
        event.and_then(|&event| timeline.time(event).map(ser_evidence::time::Moment::us))
    };
    let name = names::harmless(&timeline.site().name);
    let title = if name.is_empty() { "Incident".to_owned() } else { name };
    let span = match (at(events.first()), at(events.last())) {
        (Some(first), Some(last)) if clock.date(first) == clock.date(last) => format!(
            "{} to {} ({})",
            clock.date_and_time(first),
            clock.time(last),
            clock.zone(first)
        ),
        (Some(first), Some(last)) => format!(
            "{} to {} ({})",
            clock.date_and_time(first),
            clock.date_and_time(last),
            clock.zone(first)
        ),
        _ => "time not known".to_owned(),
    };
    let style = styles.title;
    writeln!(out, "{style}{title}{style:#}  {span}\n")
}

fn verdict_lines(
    out: &mut dyn Write,
    document: &Document<'_>,
    styles: Styles,
    clock: &Clock,
) -> io::Result<()> {
    let Document { timeline, report, .. } = *document;
    let first = verdict::first_out(timeline, report, &report.first_out, clock);
    labelled(out, "first-out", &[first], styles.first_out)?;
    let operated: Vec<String> =
        report.operations.iter().map(|operation| verdict::operated(timeline, operation)).collect();
    let operated = if operated.is_empty() { vec!["no breaker".to_owned()] } else { operated };
    labelled(out, "operated", &operated, styles.title)?;
    match verdict::wrong(document) {
        wrong if wrong.is_empty() => labelled(out, "wrong", &["nothing".to_owned()], styles.title),
        wrong => labelled(out, "wrong", &wrong, styles.alarm),
    }
}

/// A label and what belongs to it, wrapped.
fn labelled(
    out: &mut dyn Write,
    label: &str,
    items: &[String],
    style: anstyle::Style,
) -> io::Result<()> {
    const INDENT: usize = 11;
    let lines = wrapped(&items.join("; "), WIDTH - INDENT);
    for (number, line) in lines.iter().enumerate() {
        let label = if number == 0 { label } else { "" };
        let pad = INDENT - label.len();
        writeln!(out, "{style}{label}{style:#}{:pad$}{line}", "")?;
    }
    Ok(())
}

fn heading(out: &mut dyn Write, text: &str, styles: Styles) -> io::Result<()> {
    let style = styles.title;
    writeln!(out, "\n{style}{text}{style:#}")
}

/// What was first in each group.
fn groups(
    out: &mut dyn Write,
    document: &Document<'_>,
    styles: Styles,
    clock: &Clock,
) -> io::Result<()> {
    let Document { timeline, report, .. } = *document;
    if report.groups.is_empty() {
        return Ok(());
    }
    heading(out, "First in each group", styles)?;
    for (id, first) in &report.groups {
        let name = timeline.site().groups.get(id.0).map(|group| names::harmless(&group.name));
        let first = verdict::first_out(timeline, report, first, clock);
        writeln!(out, "{}: {first}", name.unwrap_or_default())?;
    }
    Ok(())
}

fn steps(out: &mut dyn Write, document: &Document<'_>, styles: Styles) -> io::Result<()> {
    let Document { timeline, report, .. } = *document;
    if timeline.site().expectations.is_empty() {
        return Ok(());
    }
    heading(out, "Expected steps", styles)?;
    if report.steps.is_empty() {
        return writeln!(out, "nothing in this incident begins one");
    }
    let mut table = Table::new(vec![
        ("result", Align::Left),
        ("step", Align::Left),
        ("took", Align::Right),
        ("expected", Align::Left),
        ("", Align::Wrapped),
    ]);
    for step in &report.steps {
        table.row(step_row(document, step, styles));
    }
    table.write(out, styles.faint)
}

fn step_row(document: &Document<'_>, step: &StepResult, styles: Styles) -> Vec<Cell> {
    let timeline = document.timeline;
    let Some(expectation) = timeline.site().expectations.get(step.expectation) else {
        return Vec::new();
    };
    let (result, style) = match step.verdict {
        Verdict::InTime => ("in time", anstyle::Style::new()),
        Verdict::Early => ("early", styles.alarm),
        Verdict::Late => ("late", styles.alarm),
        Verdict::Missing => ("missing", styles.alarm),
        Verdict::NotDecidable(_) => ("not decidable", styles.alarm),
    };
    let took = step.delta.and_then(|delta| Some((delta.middle_us()?, delta.doubt_us()?)));
    let took = took.map(|(us, off)| format!("{} ± {}", duration(us), doubt(off)));
    let (from, to) = expectation.within_us;
    let note = match step.verdict {
        Verdict::NotDecidable(why) => verdict::why_undecidable(why).to_owned(),
        Verdict::Missing => format!("no {}", names::edge(timeline, expectation.then)),
        _ => String::new(),
    };
    vec![
        Cell::styled(result, style),
        Cell::from(names::harmless(&expectation.name)),
        Cell::from(took.unwrap_or_default()),
        Cell::from(format!("{} to {}", duration(from), duration(to))),
        Cell::from(note),
    ]
}

fn breakers(out: &mut dyn Write, document: &Document<'_>, styles: Styles) -> io::Result<()> {
    let Document { timeline, report, .. } = *document;
    if report.operations.is_empty() && report.disagreements.is_empty() {
        return Ok(());
    }
    heading(out, "Breakers", styles)?;
    for operation in &report.operations {
        let off = operation.took.and_then(ser_evidence::timeline::Delta::doubt_us);
        let off = off.map_or_else(String::new, |off| format!(", ± {}", doubt(off)));
        writeln!(out, "{}{off}", verdict::operated(timeline, operation))?;
    }
    for disagreement in &report.disagreements {
        let what = if disagreement.both_on { "on" } else { "off" };
        let lasted = match (disagreement.lasted, disagreement.until) {
            (Some(lasted), _) => match (lasted.middle_us(), lasted.doubt_us()) {
                (Some(us), Some(off)) => format!("for {} ± {}", duration(us), doubt(off)),
                _ => "for an unknown time".to_owned(),
            },
            (None, Some(_)) => "since before the incident, then no longer".to_owned(),
            (None, None) => "still at the end".to_owned(),
        };
        let equipment = names::harmless(&disagreement.equipment);
        writeln!(out, "{equipment}: 52a and 52b both {what} {lasted}")?;
    }
    Ok(())
}

fn normal(out: &mut dyn Write, document: &Document<'_>, styles: Styles) -> io::Result<()> {
    let Document { timeline, report, .. } = *document;
    if report.abnormal.is_empty() {
        return Ok(());
    }
    heading(out, "Not normal at the end", styles)?;
    for abnormal in &report.abnormal {
        let name = verdict::abnormal_name(timeline, abnormal);
        let since = match abnormal.since {
            Some(_) => "",
            None => "  (since before the incident)",
        };
        let style = styles.abnormal;
        writeln!(out, "{style}{name}{style:#}{since}")?;
    }
    Ok(())
}
