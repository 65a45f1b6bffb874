//! The sections of a page that are words: tables and lists.

use maud::{Markup, html};
use ser_evidence::incident::Fold;
use ser_evidence::site::PointId;

use super::picture::Lanes;
use crate::names;
use crate::report::sequence::{self, ChangeLine, Line, Remark, Sign};
use crate::report::{Clock, Document, outcome, sources, verdict};
use crate::span::since;

/// A table in a box of its own, which scrolls where it has no room. `named_by` is the heading of its
/// section; columns of numbers are [`NUMBER`].
fn table(named_by: &str, titles: &[(&str, &str)], rows: &Markup) -> Markup {
    html! {
        div.scroll tabindex="0" role="group" aria-labelledby=(named_by) {
            table {
                thead { tr {
                    @for (title, class) in titles { th.(class) scope="col" { (title) } }
                } }
                tbody { (rows) }
            }
        }
    }
}

/// The classes of columns.
const NUMBER: &str = "number";
const TEXT: &str = "text";

/// Recorders, their completeness and their clocks.
pub(super) fn made_from(document: &Document<'_>, clock: &Clock) -> Markup {
    let titles = [("Recorder", TEXT), ("Entries", NUMBER), ("Complete", TEXT), ("Clock", TEXT)];
    let rows = html! {
        @for source in sources::recorders(document, clock) {
            tr {
                th scope="row" { (source.recorder) }
                td.number { (source.entries) }
                td.alarm[!source.is_complete] { (source.complete) }
                td { (source.clock) }
            }
        }
    };
    html! {
        section aria-labelledby="made-from" {
            h2 #made-from { "Made from" }
            (table("made-from", &titles, &rows))
            @for missed in sources::not_reached(document) { p.alarm { "Not reached: " (missed) } }
            @for changes in sources::left_out(document, clock) { p.alarm { "Left out: " (changes) } }
            @for finding in sources::findings(document.timeline) {
                p.alarm { "Clocks: " (finding) }
            }
            @for shift in sources::shifts(document.timeline, clock) {
                p { "Shifted by hand: " (shift) }
            }
        }
    }
}

/// A row for each change.
pub(super) fn sequence(document: &Document<'_>, lanes: Option<&Lanes>, clock: &Clock) -> Markup {
    html! {
        section aria-labelledby="sequence" {
            h2 #sequence { "Sequence" }
            div.scroll.tall tabindex="0" role="group" aria-labelledby="sequence" {
                table.sequence {
                    thead { tr {
                        th scope="col" { span.unseen { "Order" } }
                        th scope="col" { "Time" }
                        th.number scope="col" { "Δ first" }
                        th.number scope="col" { "Δ previous" }
                        th scope="col" { "Recorder" }
                        th scope="col" { "Point" }
                        th scope="col" { "State" }
                        th.number scope="col" { "Doubt" }
                        th.number scope="col" { "Entry" }
                        th scope="col" { "Notes" }
                    } }
                    tbody {
                        @for line in sequence::lines(document, clock) {
                            (row(document, &line, lanes, clock))
                        }
                    }
                }
            }
        }
    }
}

fn row(document: &Document<'_>, line: &Line<'_>, lanes: Option<&Lanes>, clock: &Clock) -> Markup {
    match line {
        Line::Change(change) => change_row(document, change, lanes, clock),
        Line::Remark(remark) => remark_row(remark),
    }
}

fn change_row(
    document: &Document<'_>,
    line: &ChangeLine<'_>,
    lanes: Option<&Lanes>,
    clock: &Clock,
) -> Markup {
    let lane = lanes.and_then(|lanes| lanes.of(line.row.change));
    // Chatter has a note of its own, which unfolds.
    let notes =
        line.notes.iter().filter(|note| line.fold.is_none() || !note.starts_with("chatter"));
    let notes: Vec<&str> = notes.map(String::as_str).collect();
    html! {
        tr.first[line.is_first].chattering[line.fold.is_some()] data-lane=[lane] {
            (bracket(line.bracket))
            td.time { (line.time) }
            td.number { (line.since_first) }
            td.number { (line.since_previous) }
            (recorder(&line.recorder))
            td {
                @match lane {
                    Some(lane) => a href={ "#lane-" (lane) } { (line.point) },
                    None => (line.point),
                }
            }
            td.state.abnormal[line.is_abnormal] {
                (line.state)
                @if line.is_abnormal { " " span.flag { "not normal" } }
            }
            td.number.faint { (line.doubt) }
            td.number { (line.entry) }
            td { (notes.join("; ")) }
        }
        @if let Some(fold) = line.fold {
            tr.folded {
                (bracket(line.bracket.below()))
                td colspan="9" { (chatter(document, (fold, line.row.point), clock)) }
            }
        }
    }
}

/// Changes of which nobody knows when they were.
pub(super) fn timeless(document: &Document<'_>) -> Markup {
    let lines = sequence::timeless(document);
    let titles = [
        ("Its clock showed", TEXT),
        ("Recorder", TEXT),
        ("Point", TEXT),
        ("State", TEXT),
        ("Entry", NUMBER),
        ("Notes", TEXT),
    ];
    let rows = html! {
        @for line in &lines {
            tr {
                td.time { (line.showed) }
                td { (line.recorder) }
                td { (line.point) }
                td { (line.state) }
                td.number { (line.entry) }
                td { (line.note) }
            }
        }
    };
    html! {
        @if !lines.is_empty() {
            section aria-labelledby="timeless" {
                h2 #timeless { "Time not known" }
                p { "The clock was never set. These came before the next entry of their recorder." }
                (table("timeless", &titles, &rows))
            }
        }
    }
}

/// The recorder of a row. The middle of a long name is left out: it stands in each row, and the table
/// of recorders has all of it.
fn recorder(name: &str) -> Markup {
    const START: usize = 24;
    const END: usize = 12;
    let letters: Vec<char> = name.chars().collect();
    match (letters.first_chunk::<START>(), letters.last_chunk::<END>()) {
        (Some(start), Some(end)) if letters.len() > START + END + 1 => html! {
            td title=(name) { (start.iter().collect::<String>()) "…" (end.iter().collect::<String>()) }
        },
        _ => html! { td { (name) } },
    }
}

/// The cell of the bracket around rows whose order is not known.
fn bracket(sign: Sign) -> Markup {
    let (class, order) = match sign {
        Sign::None => (None, None),
        Sign::First => (Some("bracket begins"), Some("order not known, from here")),
        Sign::Inner => (Some("bracket"), Some("order not known")),
        Sign::Passed => (Some("bracket passed"), Some("order to some others not known")),
        Sign::Last => (Some("bracket ends"), Some("order not known, to here")),
    };
    html! {
        td class=[class] { @if let Some(order) = order { span.unseen { (order) } } }
    }
}

/// The changes that are folded into the row above.
fn chatter(
    document: &Document<'_>,
    (fold, point): (&Fold, Option<PointId>),
    clock: &Clock,
) -> Markup {
    let timeline = document.timeline;
    let changes = fold.changes.iter().map(|&change| {
        let on = timeline.held(change.event).and_then(|held| held.state_of(change.input));
        let state = names::state(timeline, point, on);
        let at = timeline.time(change.event).map(|at| clock.time(at.us())).unwrap_or_default();
        let after = timeline.delta(fold.first, change).middle_us().map(since).unwrap_or_default();
        (at, after, state)
    });
    html! {
        details {
            summary { (sequence::chatter(timeline, fold)) }
            ol {
                @for (at, after, state) in changes {
                    li { (at) " " span.faint { (after) } " " (state) }
                }
            }
        }
    }
}

fn remark_row(remark: &Remark) -> Markup {
    html! {
        tr.remark.loss[remark.is_loss] {
            (bracket(remark.bracket))
            td.time { "–" }
            td.number { "–" }
            td.number { "–" }
            (recorder(&remark.recorder))
            td colspan="5" { (remark.text) }
        }
    }
}

/// What was first in each group.
pub(super) fn groups(document: &Document<'_>, clock: &Clock) -> Markup {
    let groups = outcome::groups(document, clock);
    html! {
        @if !groups.is_empty() {
            section {
                h2 { "First in each group" }
                dl { @for (name, first) in groups { dt { (name) } dd { (first) } } }
            }
        }
    }
}

/// Expected steps.
pub(super) fn steps(document: &Document<'_>) -> Markup {
    let steps = outcome::steps(document);
    let titles =
        [("Result", TEXT), ("Step", TEXT), ("Took", NUMBER), ("Expected", TEXT), ("Notes", TEXT)];
    let rows = html! {
        @for step in &steps {
            tr {
                td class=(if step.is_in_time { "good" } else { "alarm" }) { (step.result) }
                th scope="row" { (step.name) }
                td.number { (step.took) }
                td { (step.expected) }
                td { (step.note) }
            }
        }
    };
    html! {
        @if !document.timeline.site().expectations.is_empty() {
            section aria-labelledby="steps" {
                h2 #steps { "Expected steps" }
                @if steps.is_empty() {
                    p { "Nothing in this incident begins one." }
                } @else {
                    (table("steps", &titles, &rows))
                }
            }
        }
    }
}

/// What breakers did.
pub(super) fn breakers(document: &Document<'_>) -> Markup {
    list("Breakers", &outcome::breakers(document))
}

/// What is not normal at the end.
pub(super) fn not_normal(document: &Document<'_>) -> Markup {
    let lines = outcome::not_normal(document).into_iter().map(|(name, since)| match since {
        Some(since) => format!("{name} ({since})"),
        None => name,
    });
    list("Not normal at the end", &lines.collect::<Vec<_>>())
}

/// What is missing, so that the last thing on the page says whether all is there.
pub(super) fn missing(document: &Document<'_>) -> Markup {
    let Document { timeline, report, .. } = *document;
    let of_recorders = report.completeness.iter();
    let mut missing: Vec<String> =
        of_recorders.filter_map(|of| verdict::incompleteness(timeline, of)).collect();
    missing.extend(sources::not_reached(document).iter().map(|who| format!("not reached: {who}")));
    missing.extend(verdict::damaged(document));
    match missing.is_empty() {
        true => html! { section { h2 { "Missing" } p { "Nothing." } } },
        false => list("Missing", &missing),
    }
}

fn list(title: &str, lines: &[String]) -> Markup {
    html! {
        @if !lines.is_empty() {
            section { h2 { (title) } ul { @for line in lines { li { (line) } } } }
        }
    }
}
