//! What the incident was and what came of it, in words: its time, the first of each group, expected
//! steps, breakers, and what is not normal at the end.

use ser_evidence::incident::{Disagreement, StepResult, Verdict};
use ser_evidence::time::Moment;
use ser_evidence::timeline::{Delta, EventId};

use super::span::{doubt, duration};
use super::verdict::{self, Lists};
use super::{Clock, Document, elsewhere, names};

/// The name of the site.
pub(super) fn title(document: &Document<'_>) -> String {
    let name = names::harmless(&document.timeline.site().name);
    if name.is_empty() { "Incident".to_owned() } else { name }
}

/// The clock by which the times of an incident are shown.
pub(super) fn clock(document: &Document<'_>) -> Clock {
    let clock = Clock::in_zone(document.timeline.site().time_zone.clone());
    match ends(document) {
        Some((first, last)) => clock.over(first, last),
        None => clock,
    }
}

/// From when to when, in the zone of the site.
pub(super) fn window(document: &Document<'_>, clock: &Clock) -> String {
    let Some((first, last)) = ends(document) else { return "time not known".to_owned() };
    let (from, to) = (clock.date_and_time(first), clock.time(last));
    let goes_on = match document.report.incident.later {
        0 => String::new(),
        1 => "; 1 more entry of the incident is after the time asked for".to_owned(),
        entries => {
            format!("; {entries} more entries of the incident are after the time asked for")
        }
    };
    format!("{from} to {to} ({}){goes_on}", clock.zone(first))
}

/// When the first and the last entry were, in UTC, of those whose time is known.
fn ends(document: &Document<'_>) -> Option<(i64, i64)> {
    let Document { timeline, report, .. } = *document;
    let at = |event: &EventId| timeline.time(*event).map(Moment::us);
    let mut timed = report.incident.events.iter();
    let is_timed = |event: &&EventId| !elsewhere::is_timeless(timeline, **event);
    let first = timed.find(is_timed)?;
    at(first).zip(at(timed.rfind(is_timed).unwrap_or(first)))
}

/// Each group that wants to know, and what was first in it.
pub(super) fn groups(document: &Document<'_>, clock: &Clock) -> Vec<(String, String)> {
    let Document { timeline, report, .. } = *document;
    let groups = report.groups.iter().map(|(id, first)| {
        let group = timeline.site().groups.get(id.0);
        let name = group.map(|group| names::harmless(&group.name)).unwrap_or_default();
        (name, verdict::first_out(timeline, report, (first, Lists::Short), clock))
    });
    groups.collect()
}

/// An expected step in words.
#[derive(Debug)]
pub(super) struct Step {
    pub(super) result: &'static str,
    pub(super) is_in_time: bool,
    pub(super) name: String,
    pub(super) took: String,
    pub(super) expected: String,
    pub(super) note: String,
}

/// All steps that began.
pub(super) fn steps(document: &Document<'_>) -> Vec<Step> {
    document.report.steps.iter().filter_map(|step| self::step(document, step)).collect()
}

/// What a verdict is called.
pub(super) const fn result(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::InTime => "in time",
        Verdict::Early => "early",
        Verdict::Late => "late",
        Verdict::Missing => "missing",
        Verdict::NotDecidable(_) => "not decidable",
    }
}

fn step(document: &Document<'_>, step: &StepResult) -> Option<Step> {
    let timeline = document.timeline;
    let expectation = timeline.site().expectations.get(step.expectation)?;
    let took = step.delta.and_then(|delta| Some((delta.middle_us()?, delta.doubt_us()?)));
    let took = took.map(|(us, off)| format!("{} ± {}", duration(us), doubt(off)));
    let (from, to) = expectation.within_us;
    let note = match step.verdict {
        Verdict::NotDecidable(why) => verdict::why_undecidable(why).to_owned(),
        Verdict::Missing => format!("no {}", names::edge(timeline, expectation.then)),
        Verdict::InTime | Verdict::Early | Verdict::Late => String::new(),
    };
    Some(Step {
        result: result(step.verdict),
        is_in_time: step.verdict == Verdict::InTime,
        name: names::harmless(&expectation.name),
        took: took.unwrap_or_default(),
        expected: format!("{} to {}", duration(from), duration(to)),
        note,
    })
}

/// What breakers did, and contact pairs that disagreed.
pub(super) fn breakers(document: &Document<'_>) -> Vec<String> {
    let report = document.report;
    let operated = report.operations.iter().map(|operation| {
        let off = operation.took.and_then(Delta::doubt_us);
        let off = off.map_or_else(String::new, |off| format!(", ± {}", doubt(off)));
        format!("{}{off}", verdict::operated(operation))
    });
    operated.chain(report.disagreements.iter().map(disagreement)).collect()
}

fn disagreement(of: &Disagreement) -> String {
    let what = if of.both_on { "on" } else { "off" };
    let lasted = match (of.lasted, of.until) {
        (Some(lasted), _) => match (lasted.middle_us(), lasted.doubt_us()) {
            (Some(us), Some(off)) => format!("for {} ± {}", duration(us), doubt(off)),
            _ => "for an unknown time".to_owned(),
        },
        (None, Some(_)) => "since before what is shown, then no longer".to_owned(),
        (None, None) => "still at the end".to_owned(),
    };
    format!("{}: 52a and 52b both {what} {lasted}", names::harmless(&of.equipment))
}

/// Points and states that are not normal at the end, and since when where that is to be said.
pub(super) fn not_normal(document: &Document<'_>) -> Vec<(String, Option<&'static str>)> {
    let Document { timeline, report, .. } = *document;
    let lines = report.abnormal.iter().map(|abnormal| {
        let since = abnormal.since.is_none().then_some("since before the incident");
        (verdict::abnormal_name(timeline, abnormal), since)
    });
    lines.collect()
}
