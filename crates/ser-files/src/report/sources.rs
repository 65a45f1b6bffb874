//! What a report is made from, in words: recorders, their completeness and their clocks, shifts,
//! digests.

use ser_evidence::clock::{Finding, Home, LinkReason};
use ser_evidence::incident::{ClockState, Completeness, LeftOut, StretchEnd};
use ser_evidence::record::HostReading;
use ser_evidence::timeline::{EventId, Timeline};

use super::names;
use super::span::{doubt, duration};
use super::{Clock, Document, elsewhere, verdict};

/// A recorder in words.
#[derive(Debug)]
pub(super) struct Source {
    pub(super) recorder: String,
    /// How many of its entries are in the incident.
    pub(super) entries: usize,
    /// From when to when nothing is missing, or what is.
    pub(super) complete: String,
    pub(super) is_complete: bool,
    pub(super) clock: String,
}

/// All recorders.
pub(super) fn recorders(document: &Document<'_>, clock: &Clock) -> Vec<Source> {
    document.report.completeness.iter().map(|of| source(document, of, clock)).collect()
}

fn source(document: &Document<'_>, of: &Completeness, clock: &Clock) -> Source {
    let timeline = document.timeline;
    let name = verdict::recorder_name(timeline, of.recorder);
    let is_missed =
        document.not_reached.iter().any(|missed| names::harmless(&missed.recorder) == name);
    let wrong = verdict::incompleteness(timeline, of);
    let is_complete = wrong.is_none();
    let complete = match wrong {
        Some(_) if is_missed => "not reached".to_owned(),
        Some(text) => text.strip_prefix(&format!("{name}: ")).unwrap_or(&text).to_owned(),
        None => complete(timeline, of, clock),
    };
    let (entries, clock) = (of.entries, clock_text(document, of));
    Source { recorder: name, entries, complete, is_complete, clock }
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

/// Whether a row of a recorder is listed elsewhere than its clock said.
fn has_row_elsewhere(document: &Document<'_>, recorder: u32) -> bool {
    let mut events = document.report.incident.events.iter();
    events.any(|&event| {
        event.recorder == recorder && elsewhere::is_elsewhere(document.timeline, event)
    })
}

fn clock_text(document: &Document<'_>, of: &Completeness) -> String {
    match of.clock {
        ClockState::NoEntry => "no entries, so no times".to_owned(),
        ClockState::NotObserved if has_row_elsewhere(document, of.recorder) => {
            "never observed, and set: times as it showed them, or what it showed in a note"
                .to_owned()
        }
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

/// Changes that chatter filters left out, an input each: in no list of entries they can be seen.
pub(super) fn left_out(document: &Document<'_>, clock: &Clock) -> Vec<String> {
    let timeline = document.timeline;
    let mut lines = Vec::new();
    for of in &document.report.completeness {
        let Some(LeftOut { changes, from, until, is_to_end }) = &of.left_out else { continue };
        let time = |reading: &HostReading| clock.date_and_time(reading.utc.us());
        let from = from.as_ref().map_or("its power-up".to_owned(), time);
        let more = if *is_to_end { "" } else { "; nobody has looked since" };
        for (&input, &count) in changes {
            lines.push(format!(
                "{}: {}, up to {count} {} by its chatter filter, between {from} and {}{more}",
                verdict::recorder_name(timeline, of.recorder),
                input_name(timeline, of.recorder, input),
                if count == 1 { "change" } else { "changes" },
                time(until),
            ));
        }
    }
    lines
}

/// As `input 3 (52-1 closed)`.
fn input_name(timeline: &Timeline<'_>, recorder: u32, input: u8) -> String {
    let history = timeline.history().recorders.get(recorder as usize);
    let id = history.and_then(|history| history.site);
    let mut points = timeline.site().points.iter();
    match points.find(|point| Some(point.recorder) == id && point.input == input) {
        Some(point) => format!("input {input} ({})", names::harmless(&point.name)),
        None => format!("input {input}"),
    }
}

/// Recorders that were not reached, each with the reason.
pub(super) fn not_reached(document: &Document<'_>) -> Vec<String> {
    let line = |missed: &super::NotReached| {
        format!("{}: {}", names::harmless(&missed.recorder), names::harmless(&missed.why))
    };
    document.not_reached.iter().map(line).collect()
}

/// What does not fit together.
pub(super) fn findings(timeline: &Timeline<'_>) -> Vec<String> {
    let name = |recorder: usize| {
        verdict::recorder_name(timeline, u32::try_from(recorder).unwrap_or(u32::MAX))
    };
    // Where there is no entry, there is nothing that an observation could say anything about.
    let has_entries = |recorder: usize| {
        let history = timeline.history().recorders.get(recorder);
        history.is_some_and(|history| history.lives.iter().any(|life| !life.entries.is_empty()))
    };
    let is_told = |finding: &&Finding| match finding {
        Finding::NotPlaced { recorder, .. } => has_entries(*recorder),
        _ => true,
    };
    let of_clocks = timeline.findings().iter().filter(is_told).map(|finding| match finding {
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
    });
    let sequence = |event: &EventId| timeline.held(*event).map_or(0, |held| held.sequence);
    let of_entries = timeline.out_of_order().iter().map(|(one, other)| {
        format!(
            "{}: entry {} came before entry {}, and what is known of its clock says otherwise",
            names::recorder(timeline, *one),
            sequence(one),
            sequence(other)
        )
    });
    let mut findings: Vec<String> = of_clocks.chain(of_entries).collect();
    findings.dedup();
    findings
}

/// What was added by hand.
pub(super) fn shifts(timeline: &Timeline<'_>, clock: &Clock) -> Vec<String> {
    let line = |shift: &ser_evidence::site::Shift| {
        let recorder = timeline.site().recorders.get(shift.recorder.0);
        let recorder = recorder.map_or_else(String::new, |found| names::harmless(&found.name));
        format!(
            "{recorder} by {} from {} to {} ({})",
            duration(shift.us),
            clock.date_and_time(shift.from.us()),
            clock.date_and_time(shift.to.us()),
            names::harmless(&shift.why)
        )
    };
    timeline.site().shifts.iter().map(line).collect()
}

/// As `28 entries, sha256 651a…`: anybody can check that it is about the same entries.
pub(super) fn entries(document: &Document<'_>) -> String {
    let digest: String = document.report.digest.iter().map(|byte| format!("{byte:02x}")).collect();
    match document.report.incident.events.len() {
        1 => format!("1 entry, sha256 {digest}"),
        count => format!("{count} entries, sha256 {digest}"),
    }
}

/// As `archive head of U1-SER1 by cellar: sha256 5f1c…`, for each chain of a recorder with entries
/// in the incident.
pub(super) fn archive_heads(document: &Document<'_>) -> Vec<String> {
    let timeline = document.timeline;
    let has_entries = |head: &&super::ArchiveHead| {
        document.report.completeness.iter().any(|of| {
            let history = timeline.history().recorders.get(of.recorder as usize);
            of.entries > 0 && history.is_some_and(|found| found.recorder.name == head.recorder)
        })
    };
    let line = |head: &super::ArchiveHead| {
        let [recorder, collector] =
            [&head.recorder, &head.collector].map(|name| names::harmless(name));
        format!("archive head of {recorder} by {collector}: sha256 {}", head.digest)
    };
    document.archive_heads.iter().filter(has_entries).map(line).collect()
}

/// The program and the site file, with their versions.
pub(super) fn made_by(document: &Document<'_>) -> String {
    let site = document.site_digest.as_ref();
    let site = site.map_or_else(String::new, |digest| format!(", site file sha256 {digest}"));
    format!("{}{site}", document.program)
}
