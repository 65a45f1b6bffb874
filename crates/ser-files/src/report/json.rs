//! The report as JSON.

use std::io::{self, Write};

use ser_console::is_obeyed;
use ser_evidence::clock::{Home, Nominal};
use ser_evidence::incident::{ClockState, FirstOut, LeftOut, StretchEnd, Verdict};
use ser_evidence::timeline::{ChangeId, Delta, EventId};
use serde_json::{Value, json};

use super::Document;
use super::marks::Marks;
use super::verdict::{self, Lists};
use crate::digits::rfc3339;
use crate::names;

/// The version of the layout. A change that old readers would misread gets the next number.
const SCHEMA: u32 = 1;

/// Writes a report as one JSON object.
///
/// # Errors
/// If `out` does not take it.
pub fn write(out: &mut dyn Write, document: &Document<'_>) -> io::Result<()> {
    let text = serde_json::to_string_pretty(&object(document))?;
    // Inside of strings nothing is left that a terminal would obey.
    let mut harmless = String::with_capacity(text.len());
    for letter in text.chars() {
        if letter != '\n' && is_obeyed(letter) {
            harmless.push_str(&format!("\\u{:04x}", u32::from(letter)));
        } else {
            harmless.push(letter);
        }
    }
    writeln!(out, "{harmless}")
}

fn object(document: &Document<'_>) -> Value {
    let Document { timeline, report, .. } = *document;
    let site = timeline.site();
    let digest: String = report.digest.iter().map(|byte| format!("{byte:02x}")).collect();
    json!({
        "report": "incident",
        "schema": SCHEMA,
        "program": document.program,
        "site": site.name,
        "site_sha256": document.site_digest,
        "entries_sha256": digest,
        "archive_heads": document.archive_heads.iter().map(|head| json!({
            "recorder": head.recorder,
            "collector": head.collector,
            "sha256": head.digest,
        })).collect::<Vec<_>>(),
        "is_incomplete": document.is_incomplete(),
        "damaged_lines": document.damaged_lines,
        "doubtful_hours": document.doubtful_hours,
        "entries_before": report.incident.earlier.len(),
        "entries_after": report.incident.later,
        "verdict": verdict_of(document),
        "first_out": first_out(document, &report.first_out),
        "groups": report.groups.iter().map(|(id, first)| json!({
            "group": site.groups.get(id.0).map(|group| &group.name),
            "first_out": first_out(document, first),
        })).collect::<Vec<_>>(),
        "recorders": recorders(document),
        "not_reached": document.not_reached.iter().map(|missed| json!({
            "recorder": missed.recorder,
            "why": missed.why,
        })).collect::<Vec<_>>(),
        "shifts": site.shifts.iter().map(|shift| json!({
            "recorder": site.recorders.get(shift.recorder.0).map(|found| &found.name),
            "us": shift.us,
            "from": rfc3339(shift.from.us()),
            "to": rfc3339(shift.to.us()),
            "why": shift.why,
        })).collect::<Vec<_>>(),
        "sequence": sequence(document),
        "steps": steps(document),
        "operations": operations(document),
        "disagreements": disagreements(document),
        "abnormal": report.abnormal.iter().map(|abnormal| json!({
            "point": site.points.get(abnormal.point.0).map(|point| &point.name),
            "on": abnormal.on,
            "since": abnormal.since.map(|since| change(document, since)),
        })).collect::<Vec<_>>(),
    })
}

/// The three lines that answer, whole.
fn verdict_of(document: &Document<'_>) -> Value {
    let Document { timeline, report, .. } = *document;
    let clock = super::outcome::clock(document);
    let first = (&report.first_out, Lists::Whole);
    json!({
        "first_out": verdict::first_out(timeline, report, first, &clock),
        "operated": verdict::all_operated(document, Lists::Whole),
        "wrong": verdict::wrong(document, Lists::Whole),
    })
}

/// By what a change is found in the sequence.
fn change(document: &Document<'_>, change: ChangeId) -> Value {
    json!({
        "recorder": recorder(document, change.event),
        "life": life(document, change.event),
        "sequence": sequence_of(document, change.event),
        "input": change.input,
    })
}

fn life(document: &Document<'_>, event: EventId) -> Option<String> {
    document.timeline.life(event).map(|life| life.name().to_string())
}

fn sequence_of(document: &Document<'_>, event: EventId) -> Option<u64> {
    document.timeline.held(event).map(|held| held.sequence)
}

fn recorder<'d>(document: &Document<'d>, event: EventId) -> Option<&'d str> {
    Some(document.timeline.recorder(event)?.recorder.name.as_str())
}

fn first_out(document: &Document<'_>, first: &FirstOut) -> Value {
    json!({
        "is_known": first.known().is_some(),
        "candidates": first
            .changes
            .iter()
            .map(|&candidate| json!({
                "recorder": recorder(document, candidate.event),
                "life": life(document, candidate.event),
                "sequence": sequence_of(document, candidate.event),
                "input": candidate.input,
                "same_movement": document.timeline.same_movement(candidate)
                    .map(|same| change(document, same)),
            }))
            .collect::<Vec<_>>(),
        "missing_on": first
            .gaps
            .iter()
            .map(|&(event, _)| recorder(document, event))
            .collect::<Vec<_>>(),
        "not_read_since": first
            .unread
            .iter()
            .map(|&recorder| verdict::recorder_name(document.timeline, recorder))
            .collect::<Vec<_>>(),
    })
}

fn recorders(document: &Document<'_>) -> Vec<Value> {
    let timeline = document.timeline;
    let each = document.report.completeness.iter();
    each.map(|of| {
        let history = timeline.history().recorders.get(of.recorder as usize);
        json!({
            "recorder": history.map(|history| &history.recorder.name),
            "entries": of.entries,
            "is_complete": of.is_complete(),
            "unbroken_from": of.unbroken.map(|(first, _)| stretch_end(document, first)),
            "unbroken_to": of.unbroken.map(|(_, last)| stretch_end(document, last)),
            "read_until": of.read_until.and_then(|reading| rfc3339(reading.utc.us())),
            "missing": of.gaps.iter().map(|(gap, _)| json!({
                "after": gap.after,
                "what": super::missing(gap.lost, gap.why),
            })).collect::<Vec<_>>(),
            "conflicts": of.conflicts,
            "without_time": of.timeless,
            "left_out": of.left_out.as_ref().map(left_out),
            "clock": clock_of(of.clock),
        })
    })
    .collect()
}

/// What chatter filters left out.
fn left_out(found: &LeftOut) -> Value {
    let LeftOut { changes, from, until, is_to_end } = found;
    let input = |(&input, &at_most): (&u8, &u64)| json!({ "input": input, "at_most": at_most });
    json!({
        "changes": changes.iter().map(input).collect::<Vec<_>>(),
        "from": from.and_then(|reading| rfc3339(reading.utc.us())),
        "until": rfc3339(until.utc.us()),
        "is_to_end": is_to_end,
    })
}

/// An end of what is complete, with what is known of the clock there.
fn stretch_end(document: &Document<'_>, end: StretchEnd) -> Value {
    let time = document.timeline.time(end.event).map(ser_evidence::time::Moment::us);
    json!({
        "life": life(document, end.event),
        "sequence": sequence_of(document, end.event),
        "time": time.and_then(rfc3339),
        "clock": clock_of(end.clock),
    })
}

fn clock_of(clock: ClockState) -> Value {
    match clock {
        ClockState::NoEntry => Value::Null,
        ClockState::NotObserved => json!({
            "scale": Value::Null, "order_doubt_us": Value::Null, "utc_doubt_us": Value::Null,
        }),
        ClockState::Observed { home, order_doubt_us, utc_doubt_us } => json!({
            "scale": match home {
                Home::Boot(boot) => boot.to_string(),
                Home::Utc => "UTC".to_owned(),
            },
            "order_doubt_us": order_doubt_us,
            "utc_doubt_us": utc_doubt_us,
        }),
    }
}

fn sequence(document: &Document<'_>) -> Vec<Value> {
    let Document { timeline, report, .. } = *document;
    let site = timeline.site();
    let first = report.rows.first().map(|row| row.change);
    let marks = Marks::new(document);
    let mut previous: Option<ChangeId> = None;
    let mut rows = Vec::new();
    for row in &report.rows {
        let ChangeId { event, input } = row.change;
        let Some(held) = timeline.held(event) else { continue };
        let point = row.point.and_then(|point| site.points.get(point.0));
        let utc = timeline.moved_utc(event, Some(input));
        let since =
            |from: Option<ChangeId>| from.map(|from| delta(timeline.delta(from, row.change)));
        rows.push(json!({
            "time": timeline.time(event).map(ser_evidence::time::Moment::us).and_then(rfc3339),
            "earliest": utc.lo().and_then(|lo| rfc3339(lo.us())),
            "latest": utc.hi().and_then(|hi| rfc3339(hi.us())),
            "shown": held.entry.time.to_string(),
            "may_also_be": match timeline.nominal(event) {
                Nominal::Ambiguous(_, late) if !utc.is_known() => rfc3339(late.us()),
                _ => None,
            },
            "since_first": since(first),
            "since_previous": since(previous),
            "order_to_previous": previous.map(|previous| {
                format!("{:?}", timeline.order(previous.event, event)).to_lowercase()
            }),
            "recorder": recorder(document, event),
            "life": timeline.life(event).map(|life| life.name().to_string()),
            "sequence": held.sequence,
            "entry": held.number,
            "input": input,
            "point": point.map(|point| &point.name),
            "on": row.on,
            "state": point.and_then(|point| names::state_of(point, row.on)),
            "chatter": row.chatter,
            "shifted_us": timeline.shift_us(event),
            "clock_was_set_before": marks.is_set_ahead_of(event),
        }));
        previous = Some(row.change);
    }
    rows
}

fn delta(delta: Delta) -> Value {
    json!({ "least_us": delta.lo_us, "most_us": delta.hi_us })
}

fn steps(document: &Document<'_>) -> Vec<Value> {
    let Document { timeline, report, .. } = *document;
    let each = report.steps.iter();
    each.map(|step| {
        let expectation = timeline.site().expectations.get(step.expectation);
        let why = match step.verdict {
            Verdict::NotDecidable(why) => Some(verdict::why_undecidable(why)),
            _ => None,
        };
        json!({
            "name": expectation.map(|expectation| &expectation.name),
            "verdict": match step.verdict {
                Verdict::InTime => "in time",
                Verdict::Early => "early",
                Verdict::Late => "late",
                Verdict::Missing => "missing",
                Verdict::NotDecidable(_) => "not decidable",
            },
            "why": why,
            "after": change(document, step.after),
            "then": step.then.map(|then| change(document, then)),
            "took": step.delta.map(delta),
            "expected": expectation.map(|expectation| json!({
                "least_us": expectation.within_us.0,
                "most_us": expectation.within_us.1,
            })),
        })
    })
    .collect()
}

fn operations(document: &Document<'_>) -> Vec<Value> {
    let each = document.report.operations.iter();
    each.map(|operation| {
        json!({
            "equipment": operation.equipment,
            "opened": operation.opened,
            "command": operation.command.map(|command| change(document, command)),
            "contact": change(document, operation.contact),
            "took": operation.took.map(delta),
            "bounce": operation.bounce.map(|bounce| json!({
                "changes": bounce.changes,
                "lasted": delta(bounce.lasted),
            })),
            "returned": operation.returned.map(delta),
        })
    })
    .collect()
}

fn disagreements(document: &Document<'_>) -> Vec<Value> {
    let each = document.report.disagreements.iter();
    each.map(|disagreement| {
        json!({
            "equipment": disagreement.equipment,
            "both_on": disagreement.both_on,
            "since": disagreement.since.map(|since| change(document, since)),
            "until": disagreement.until.map(|until| change(document, until)),
            "lasted": disagreement.lasted.map(delta),
        })
    })
    .collect()
}
