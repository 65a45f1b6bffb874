//! The verdict: what was first, what operated, what is wrong.

use std::collections::HashSet;

use ser_evidence::clock::Finding;
use ser_evidence::incident::{
    Abnormal, Completeness, Disagreement, Doubt, FirstOut, Operation, Report, Row, StepResult,
    Verdict,
};
use ser_evidence::record::{Lost, Why};
use ser_evidence::timeline::{ChangeId, ContactTrouble, EventId, Timeline};

use super::names::{self, harmless};
use super::span::{doubt, duration};
use super::{Clock, Document, elsewhere, missing};

/// How long lists in sentences are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Lists {
    /// All of it.
    Whole,
    /// Some, and how many more: for people, who find the rest in other sections.
    Short,
}

impl Lists {
    /// How many names a sentence has.
    const NAMES: usize = 8;
    /// How many sentences there are.
    const SENTENCES: usize = 16;

    /// `a, b and c`, or `a, b and 7 more`.
    fn names(self, items: impl Iterator<Item = String>) -> String {
        let mut items: Vec<String> = items.collect();
        self.shorten(&mut items, Lists::NAMES);
        list(items.into_iter())
    }

    /// Leaves so many, if there are more than one more.
    fn shorten(self, items: &mut Vec<String>, most: usize) {
        if self == Lists::Short && items.len() > most + 1 {
            let more = items.len() - most;
            items.truncate(most);
            items.push(format!("{more} more"));
        }
    }
}

/// Between so many changes it is reckoned how far apart they may be, each with each.
const MOST_COMPARED: usize = 300;

/// What was first, in words.
pub(super) fn first_out(
    timeline: &Timeline<'_>,
    report: &Report,
    (first, lists): (&FirstOut, Lists),
    clock: &Clock,
) -> String {
    let named = |change: &ChangeId| {
        let row = row_of(report, *change);
        row.map_or_else(String::new, |row| names::change(timeline, row))
    };
    if let Some(only) = first.known() {
        let at = timeline.time(only.event).map(|at| clock.time(at.us()));
        let at = at.filter(|_| !elsewhere::is_timeless(timeline, only.event));
        return format!("{}, {}", named(&only), at.as_deref().unwrap_or("time not known"));
    }
    let mut text = match first.changes.as_slice() {
        [] => "not known".to_owned(),
        [only] => named(only),
        [one, .., other] if one.event == other.event => {
            format!("in the same millisecond: {}", lists.names(first.changes.iter().map(named)))
        }
        several => format!(
            "not certain{}, one of: {}",
            within(timeline, several),
            lists.names(several.iter().map(named))
        ),
    };
    if !first.unread.is_empty() {
        let names = first.unread.iter().map(|&recorder| recorder_name(timeline, recorder));
        text += &format!("; or something on {}, which was not read since", lists.names(names));
    }
    if !first.gaps.is_empty() {
        let of = |(event, _): &(_, usize)| names::recorder(timeline, *event);
        let mut recorders: Vec<String> = first.gaps.iter().map(of).collect();
        recorders.sort_unstable();
        recorders.dedup();
        text +=
            &format!("; or one of the entries missing on {}", lists.names(recorders.into_iter()));
    }
    let before = match first.earlier {
        0 => return text,
        1 => "1 entry of the incident is".to_owned(),
        entries => format!("{entries} entries of the incident are"),
    };
    format!("not known: {before} before the time asked for; first of what is shown: {text}")
}

/// Between which bounds nobody knows which of these was first.
fn within(timeline: &Timeline<'_>, changes: &[ChangeId]) -> String {
    if changes.len() > MOST_COMPARED {
        return String::new();
    }
    let widest = changes
        .iter()
        .enumerate()
        .flat_map(|(place, &one)| changes.iter().skip(place + 1).map(move |&other| (one, other)))
        .filter(|(one, other)| one.event != other.event)
        .map(|(one, other)| {
            let delta = timeline.delta(one, other);
            Some(delta.lo_us?.abs().max(delta.hi_us?.abs()))
        })
        .collect::<Option<Vec<i64>>>();
    match widest.and_then(|widest| widest.into_iter().max()) {
        Some(us) => format!(" within {}", doubt(us)),
        None => String::new(),
    }
}

/// What breakers did, in words.
pub(super) fn operated(operation: &Operation) -> String {
    let command = if operation.opened { "trip" } else { "close command" };
    let mut text = format!("{} {}", harmless(&operation.equipment), moved(operation.opened));
    if let Some(us) = operation.took.and_then(ser_evidence::timeline::Delta::middle_us) {
        text += &format!(" {} after its {command}", duration(us));
    }
    if let Some(bounce) = operation.bounce {
        let lasted = bounce.lasted.middle_us().map(duration).unwrap_or_default();
        // Away and back again.
        text += &match bounce.changes.div_ceil(2) {
            1 => format!(" (bounced once in {lasted})"),
            times => format!(" (bounced {times} times in {lasted})"),
        };
    }
    if let Some(returned) = operation.returned {
        let after = returned.middle_us().map(|us| format!(" after {}", duration(us)));
        text += &format!(", and {} again{}", moved(!operation.opened), after.unwrap_or_default());
    }
    text
}

const fn moved(opened: bool) -> &'static str {
    if opened { "opened" } else { "closed" }
}

/// A breaker that did not stay where it was told to go.
fn operation_trouble(operation: &Operation) -> Option<String> {
    let lasted = operation.returned?.middle_us();
    let lasted = lasted.map(|us| format!(" for {}", duration(us))).unwrap_or_default();
    let (went, back) = (moved(operation.opened), moved(!operation.opened));
    Some(format!("{} {went}{lasted} and {back} again", harmless(&operation.equipment)))
}

/// What all breakers did, in words.
pub(super) fn all_operated(document: &Document<'_>, lists: Lists) -> Vec<String> {
    let operations = document.report.operations.iter();
    let mut all: Vec<String> = operations.map(operated).collect();
    lists.shorten(&mut all, Lists::SENTENCES);
    all
}

/// Everything that is wrong, each in a few words, the worst first.
pub(super) fn wrong(document: &Document<'_>, lists: Lists) -> Vec<String> {
    let Document { timeline, report, .. } = *document;
    let mut wrong = Vec::new();
    for step in &report.steps {
        wrong.extend(step_trouble(timeline, step));
    }
    wrong.extend(report.operations.iter().filter_map(operation_trouble));
    wrong.extend(
        document
            .not_reached
            .iter()
            .map(|missed| format!("{} not reached", harmless(&missed.recorder))),
    );
    wrong.extend(damaged(document));
    wrong.extend(doubtful_hours(document));
    // That a list of another device ends is the least of what may be wrong.
    let (ended, others): (Vec<_>, Vec<_>) =
        report.completeness.iter().partition(|of| is_ended_list(timeline, of));
    wrong.extend(others.into_iter().filter_map(|of| incompleteness(timeline, of)));
    for disagreement in &report.disagreements {
        wrong.extend(disagreement_trouble(disagreement));
    }
    for fold in &report.chatter {
        if let Some(row) = row_of(report, fold.first) {
            let point = names::point(timeline, row.point, row.change.input);
            let recorder = names::recorder(timeline, row.change.event);
            let changes = fold.changes.len();
            let more = match left_out(report, row.change) {
                Some(more) => format!(", and up to {more} more left out"),
                None => String::new(),
            };
            wrong.push(format!("{point} ({recorder}) chattered ({changes} changes{more})"));
        }
    }
    let moved = report.abnormal.iter().filter(|abnormal| abnormal.since.is_some());
    let names: Vec<String> = moved.map(|abnormal| abnormal_name(timeline, abnormal)).collect();
    if !names.is_empty() {
        wrong.push(format!("not returned to normal: {}", lists.names(names.into_iter())));
    }
    let contradicts = |finding: &&Finding| !matches!(finding, Finding::NotPlaced { .. });
    let clocks = timeline.findings().iter().filter(contradicts).count();
    if clocks + timeline.out_of_order().len() > 0 {
        wrong.push("what is known of the clocks does not fit together".to_owned());
    }
    wrong.extend(contact_trouble(document));
    wrong.extend(ended.into_iter().filter_map(|of| incompleteness(timeline, of)));
    wrong.dedup();
    lists.shorten(&mut wrong, Lists::SENTENCES);
    wrong
}

/// Contacts on two recorders that did not move alike in the incident.
fn contact_trouble(document: &Document<'_>) -> Vec<String> {
    let Document { timeline, report, .. } = *document;
    let findings = timeline.contact_findings();
    let here: HashSet<EventId> = match findings {
        [] => HashSet::new(),
        _ => report.incident.events.iter().copied().collect(),
    };
    let told = findings.iter().filter(|finding| here.contains(&finding.change.event));
    let told = told.map(|finding| {
        let point = names::full_point(timeline, finding.point);
        let other = names::full_point(timeline, finding.other);
        match finding.trouble {
            ContactTrouble::Missing => format!("{point} moved and {other} did not"),
            ContactTrouble::Apart(_) => {
                format!("{point} and {other} are one contact and moved at different times")
            }
        }
    });
    told.collect()
}

/// Whether nothing is wrong with an imported list but that it goes no further than the incident.
fn is_ended_list(timeline: &Timeline<'_>, of: &Completeness) -> bool {
    let history = timeline.history().recorders.get(of.recorder as usize);
    history.is_some_and(|history| history.stamps.is_some())
        && of.gaps.is_empty()
        && of.conflicts == 0
        && of.timeless == 0
        && !of.is_complete()
}

fn step_trouble(timeline: &Timeline<'_>, step: &StepResult) -> Option<String> {
    let expectation = timeline.site().expectations.get(step.expectation)?;
    let name = harmless(&expectation.name);
    let took = step.delta.and_then(ser_evidence::timeline::Delta::middle_us).map(duration);
    let took = took.map_or_else(String::new, |took| format!(" ({took})"));
    match step.verdict {
        Verdict::InTime => None,
        Verdict::Early => Some(format!("{name}: early{took}")),
        Verdict::Late => Some(format!("{name}: late{took}")),
        Verdict::Missing => Some(format!("{name}: missing")),
        Verdict::NotDecidable(_) => Some(format!("{name}: not decidable{took}")),
    }
}

/// How many changes of the same input a chatter filter may have left out, if it has.
fn left_out(report: &Report, change: ChangeId) -> Option<u64> {
    let of = report.completeness.iter().find(|of| of.recorder == change.event.recorder)?;
    of.left_out.as_ref()?.changes.get(&change.input).copied()
}

/// Why a step cannot be decided.
pub(super) fn why_undecidable(why: Doubt) -> &'static str {
    match why {
        Doubt::Straddles => "the doubt reaches over an end of the window",
        Doubt::NoCommonTime => "nothing is known of the time between the two",
        Doubt::UnknownState => "one of the two changed to a state that is not known",
        Doubt::Gap => "an entry may be missing",
        Doubt::LeftOut => "changes of its input may have been left out, because it chattered",
        Doubt::NotReadSince => "its log was not read since",
    }
}

/// Lines of the sources that could not be read: nobody knows what was in them.
pub(super) fn damaged(document: &Document<'_>) -> Option<String> {
    match document.damaged_lines {
        0 => None,
        1 => Some("1 line of the sources could not be read".to_owned()),
        lines => Some(format!("{lines} lines of the sources could not be read")),
    }
}

/// Entries of imported lists that may be at either of two times.
fn doubtful_hours(document: &Document<'_>) -> Option<String> {
    let entries = match document.doubtful_hours {
        0 => return None,
        1 => "1 entry of the sources".to_owned(),
        entries => format!("{entries} entries of the sources"),
    };
    Some(format!(
        "{entries} may be at another time by an hour (the local hour came twice or was left out)"
    ))
}

/// What is missing of a recorder, if anything.
pub(super) fn incompleteness(timeline: &Timeline<'_>, of: &Completeness) -> Option<String> {
    let name = recorder_name(timeline, of.recorder);
    let mut text = missing_in_all(of.gaps.iter().map(|(gap, _)| (gap.lost, gap.why)));
    if of.conflicts > 0 {
        text.push(format!("{} entries contradict others", of.conflicts));
    }
    if of.timeless > 0 {
        text.push(format!("{} entries without a time (the clock was never set)", of.timeless));
    }
    if is_ended_list(timeline, of) {
        text.push("the imported list goes no further than the incident".to_owned());
    } else if text.is_empty() && !of.is_complete() {
        text.push("not known to be read after the end of the incident".to_owned());
    }
    (!text.is_empty()).then(|| format!("{name}: {}", text.join(", ")))
}

/// What is missing in several places: entries that are missing for one reason are counted together.
fn missing_in_all(gaps: impl Iterator<Item = (Lost, Why)>) -> Vec<String> {
    let mut exactly: Vec<(Why, u32, u32)> = Vec::new();
    let mut others = Vec::new();
    for (lost, why) in gaps {
        match (lost, exactly.iter_mut().find(|(known, ..)| *known == why)) {
            (Lost::Exactly(count), Some((_, sum, places))) => {
                (*sum, *places) = (sum.saturating_add(count), *places + 1);
            }
            (Lost::Exactly(count), None) => exactly.push((why, count, 1)),
            _ => others.push(missing(lost, why)),
        }
    }
    let counted = exactly.into_iter().map(|(why, sum, places)| {
        let text = missing(Lost::Exactly(sum), why);
        match places {
            1 => text,
            _ => text.replacen(" missing", &format!(" missing in {places} places"), 1),
        }
    });
    let mut all: Vec<String> = counted.chain(others).collect();
    all.dedup();
    all
}

/// Contacts that disagree while the breaker travels are as they should be.
fn disagreement_trouble(disagreement: &Disagreement) -> Option<String> {
    let what = if disagreement.both_on { "both on" } else { "both off" };
    let equipment = harmless(&disagreement.equipment);
    match (disagreement.until, disagreement.lasted) {
        (None, _) => Some(format!("52a and 52b of {equipment} disagree at the end ({what})")),
        (Some(_), Some(lasted)) if disagreement.both_on => {
            let lasted = lasted.middle_us().map(duration).unwrap_or_default();
            Some(format!("52a and 52b of {equipment} were both on for {lasted}"))
        }
        _ => None,
    }
}

/// A point and the state that is not its normal one.
pub(super) fn abnormal_name(timeline: &Timeline<'_>, abnormal: &Abnormal) -> String {
    let state = names::state(timeline, Some(abnormal.point), abnormal.on);
    format!("{} {state}", names::point(timeline, Some(abnormal.point), 0))
}

/// The name of a recorder of the history.
pub(super) fn recorder_name(timeline: &Timeline<'_>, index: u32) -> String {
    let found = timeline.history().recorders.get(index as usize);
    found.map_or_else(String::new, |found| harmless(&found.recorder.name))
}

/// The row of a change.
pub(super) fn row_of(report: &Report, change: ChangeId) -> Option<&Row> {
    report.rows.iter().find(|row| row.change == change)
}

/// `a, b and c`.
pub(super) fn list(items: impl Iterator<Item = String>) -> String {
    let items: Vec<String> = items.collect();
    match items.split_last() {
        Some((last, [])) => last.clone(),
        Some((last, rest)) => format!("{} and {last}", rest.join(", ")),
        None => String::new(),
    }
}
