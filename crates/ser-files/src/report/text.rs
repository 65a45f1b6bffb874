//! The report as text for a terminal.

mod sequence;
mod sources;

use std::io::{self, Write};

use super::style::Styles;
use super::table::{Align, Cell, Table, wrapped};
use super::verdict::{self, Lists};
use super::{Clock, Document, outcome};

/// How wide lines of sentences are.
const WIDTH: usize = 96;

/// Writes a report.
///
/// # Errors
/// If `out` does not take it.
pub fn write(out: &mut dyn Write, document: &Document<'_>, styles: Styles) -> io::Result<()> {
    let clock = outcome::clock(document);
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
    let (style, title) = (styles.title, outcome::title(document));
    writeln!(out, "{style}{title}{style:#}  {}\n", outcome::window(document, clock))
}

fn verdict_lines(
    out: &mut dyn Write,
    document: &Document<'_>,
    styles: Styles,
    clock: &Clock,
) -> io::Result<()> {
    let Document { timeline, report, .. } = *document;
    let first = verdict::first_out(timeline, report, (&report.first_out, Lists::Short), clock);
    labelled(out, "first-out", &[first], styles.first_out)?;
    let operated = verdict::all_operated(document, Lists::Short);
    let operated = if operated.is_empty() { vec!["no breaker".to_owned()] } else { operated };
    labelled(out, "operated", &operated, styles.title)?;
    match verdict::wrong(document, Lists::Short) {
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
    let groups = outcome::groups(document, clock);
    if groups.is_empty() {
        return Ok(());
    }
    heading(out, "First in each group", styles)?;
    groups.iter().try_for_each(|(name, first)| writeln!(out, "{name}: {first}"))
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
    for step in outcome::steps(document) {
        let style = if step.is_in_time { anstyle::Style::new() } else { styles.alarm };
        table.row(vec![
            Cell::styled(step.result, style),
            Cell::from(step.name),
            Cell::from(step.took),
            Cell::from(step.expected),
            Cell::from(step.note),
        ]);
    }
    table.write(out, styles.faint)
}

fn breakers(out: &mut dyn Write, document: &Document<'_>, styles: Styles) -> io::Result<()> {
    let lines = outcome::breakers(document);
    if lines.is_empty() {
        return Ok(());
    }
    heading(out, "Breakers", styles)?;
    lines.iter().try_for_each(|line| writeln!(out, "{line}"))
}

fn normal(out: &mut dyn Write, document: &Document<'_>, styles: Styles) -> io::Result<()> {
    let lines = outcome::not_normal(document);
    if lines.is_empty() {
        return Ok(());
    }
    heading(out, "Not normal at the end", styles)?;
    let style = styles.abnormal;
    for (name, since) in lines {
        let since = since.map_or_else(String::new, |since| format!("  ({since})"));
        writeln!(out, "{style}{name}{style:#}{since}")?;
    }
    Ok(())
}
