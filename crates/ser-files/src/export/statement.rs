//! What a file says about itself to people: where it comes from, and what is missing in it.

use std::io::{self, Write};

use ser_evidence::clock::Finding;
use ser_evidence::timeline::{EventId, Item, Timeline};

use super::axis::Axis;
use super::channels::recorder_name;
use super::selection::Selection;
use super::survey::Survey;
use crate::digits::rfc3339;
use crate::missing::{NotReached, missing};
use crate::names::harmless;
use crate::span::duration;

/// Where an export comes from.
#[derive(Clone, Copy, Debug)]
pub struct Origin<'a> {
    /// The program that makes it, with its version.
    pub program: &'a str,
    /// SHA-256 of the site file, if there is one.
    pub site_digest: Option<&'a str>,
    /// Recorders that were to be read and were not, and why.
    pub not_reached: &'a [NotReached],
    /// Lines of sources that could not be read.
    pub damaged_lines: u64,
}

/// Writes everything that people have to know, a line each, with this line end.
pub(super) fn write(
    out: &mut dyn Write,
    timeline: &Timeline<'_>,
    selection: &Selection,
    survey: &Survey,
    origin: &Origin<'_>,
    end: &str,
) -> io::Result<()> {
    let site = timeline.site();
    let mut line = |text: &str| write!(out, "{text}{end}");
    line(&format!("Written by {}", harmless(origin.program)))?;
    if !site.name.is_empty() {
        line(&format!("Site: {}", harmless(&site.name)))?;
    }
    if let Some(digest) = origin.site_digest {
        line(&format!("SHA-256 of the site file: {digest}"))?;
    }
    if let Some(span) = survey.span {
        let time = |us| rfc3339(us).unwrap_or_default();
        line(&format!("Entries from {} to {}", time(span.first_us), time(span.last_us)))?;
    }
    for missed in origin.not_reached {
        let (name, why) = (harmless(&missed.recorder), harmless(&missed.why));
        line(&format!("NOT READ: {name} could not be reached: {why}"))?;
    }
    for (recorder, history) in timeline.history().recorders.iter().enumerate() {
        let is_told =
            || origin.not_reached.iter().any(|missed| missed.recorder == history.recorder.name);
        if history.is_not_reached && !is_told() {
            line(&format!("NOT READ: {} could not be reached", recorder_name(timeline, recorder)))?;
        }
    }
    if origin.damaged_lines > 0 {
        line(&format!("NOT READ: {} damaged lines of the sources", origin.damaged_lines))?;
    }
    for shift in &site.shifts {
        let name = site.recorders.get(shift.recorder.0).map_or("", |found| found.name.as_str());
        let (by, why) = (duration(shift.us), harmless(&shift.why));
        line(&format!("Shifted by hand: {} by {by}: {why}", harmless(name)))?;
    }
    if survey.counted.timeless > 0 {
        let count = survey.counted.timeless;
        line(&format!("LEFT OUT: {count} entries without a time (the clock was never set)"))?;
    }
    for text in doubts(timeline) {
        line(&text)?;
    }
    completeness(out, timeline, selection, survey, end)
}

/// What does not fit together.
fn doubts(timeline: &Timeline<'_>) -> Vec<String> {
    let mut texts = Vec::new();
    for (recorder, history) in timeline.history().recorders.iter().enumerate() {
        let count = history.conflicts.len();
        if count > 0 {
            let name = recorder_name(timeline, recorder);
            texts
                .push(format!("CONTRADICTION: {name}: {count} entries were read twice and differ"));
        }
    }
    let contradicts = |finding: &&Finding| !matches!(finding, Finding::NotPlaced { .. });
    if timeline.findings().iter().any(|finding| contradicts(&finding))
        || !timeline.out_of_order().is_empty()
    {
        texts.push("CONTRADICTION: what is known of the clocks does not fit together".to_owned());
    }
    texts
}

/// For each recorder, what is missing, or that nothing is known to be.
fn completeness(
    out: &mut dyn Write,
    timeline: &Timeline<'_>,
    selection: &Selection,
    survey: &Survey,
    end: &str,
) -> io::Result<()> {
    // Most often there is nothing to look for among millions of entries.
    let mut losses = survey.counted.losses;
    for item in selection.items(timeline).take_while(|_| survey.counted.losses > 0) {
        if let Item::Gap(event, index) = item {
            write!(out, "{}{end}", loss(timeline, survey.axis, event, index))?;
            losses -= 1;
        }
        if losses == 0 {
            break;
        }
    }
    for (recorder, (entries, is_broken)) in survey.recorders.iter().enumerate() {
        let name = recorder_name(timeline, recorder);
        let of = match (entries, is_broken) {
            (_, true) => "INCOMPLETE, see above",
            (0, false) => "nothing was recorded, or nothing was read",
            (_, false) => "nothing is known to be missing between them",
        };
        write!(out, "{name}: {entries} entries, {of}{end}")?;
    }
    Ok(())
}

/// As `MISSING: U1-SER1: 37 entries missing (overwritten), after sequence 120, from … until …`.
fn loss(timeline: &Timeline<'_>, axis: Axis, event: EventId, index: usize) -> String {
    let name = recorder_name(timeline, event.recorder as usize);
    let gap = timeline.life(event).and_then(|life| life.gaps.get(index));
    let Some(gap) = gap else { return String::new() };
    let time = |event: EventId| axis.at(timeline, event).and_then(rfc3339);
    let before = event.place.checked_sub(1).map(|place| EventId { place, ..event });
    let from = before.and_then(time).map_or(String::new(), |time| format!(", from {time}"));
    let until = time(event).map_or(String::new(), |time| format!(", until {time}"));
    let what = missing(gap.lost, gap.why);
    format!("MISSING: {name}: {what}, after sequence {}{from}{until}", gap.after)
}
