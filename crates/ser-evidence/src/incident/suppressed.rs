//! Changes that a recorder left out of its log around an incident: no entry tells of them, and an
//! input that chattered must not be taken for a quiet one.

use std::collections::BTreeMap;

use super::pick::Incident;
use crate::clock::Home;
use crate::record::{HostReading, Suppressed};
use crate::time::{Moment, Utc};
use crate::timeline::{EventId, Timeline};

/// What is known of changes that were left out around an incident.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LeftOut {
    /// Inputs and how many of their changes were left out at the most, none of them 0. They need not
    /// all belong to the incident: nobody looked closer to it.
    pub changes: BTreeMap<u8, u64>,
    /// The last look that was proven to be before the incident; `None` if they are counted from the
    /// recorder's power-up on.
    pub from: Option<HostReading>,
    /// The last look that counts.
    pub until: HostReading,
    /// Whether that look is proven to be after the incident. Otherwise there may be more.
    pub is_to_end: bool,
}

/// What was left out of the log of a recorder in the incident. `None` if nobody looked.
pub(super) fn of(
    timeline: &Timeline<'_>,
    incident: &Incident,
    looks: &[Suppressed],
) -> Option<LeftOut> {
    let (&first, &last) = incident.events.first().zip(incident.events.last())?;
    let mut sorted: Vec<&Suppressed> = looks.iter().collect();
    sorted.sort_by_key(|look| (look.to.utc, look.to.monotonic));
    let mut sum: Option<LeftOut> = None;
    for power_up in sorted.chunk_by(|one, next| next.continues(one)) {
        let Some(&newest) = power_up.last() else { continue };
        if is_after(timeline, &newest.switched_on(), last) {
            break;
        }
        if is_before(timeline, &newest.to, first) {
            continue;
        }
        let is_before = |look: &&&Suppressed| is_before(timeline, &look.to, first);
        let base = power_up.iter().rev().find(is_before).copied();
        let after = power_up.iter().find(|look| is_after(timeline, &look.from, last)).copied();
        let top = after.unwrap_or(newest);
        let sum = sum.get_or_insert(LeftOut {
            changes: BTreeMap::new(),
            from: base.map(|base| base.to),
            until: top.to,
            is_to_end: false,
        });
        (sum.until, sum.is_to_end) = (top.to, after.is_some());
        for (&input, &count) in &top.left_out {
            let before = base.and_then(|base| base.left_out.get(&input)).copied().unwrap_or(0);
            let more = u64::from(count.saturating_sub(before));
            if more > 0 {
                *sum.changes.entry(input).or_default() += more;
            }
        }
        if after.is_some() {
            break;
        }
    }
    sum
}

/// Whether a change of an input in the incident may be one that was left out.
pub(super) fn may_lack(
    timeline: &Timeline<'_>,
    incident: &Incident,
    recorder: u32,
    input: u8,
) -> bool {
    let history = timeline.history().recorders.get(recorder as usize);
    let left_out = history.and_then(|history| of(timeline, incident, &history.suppressed));
    left_out.is_some_and(|left_out| left_out.changes.contains_key(&input))
}

/// Whether a reading is proven to be before an event.
fn is_before(timeline: &Timeline<'_>, reading: &HostReading, event: EventId) -> bool {
    let here =
        timeline.moved_on(event, None).get(&Home::Boot(reading.boot)).and_then(|ends| ends.0);
    let in_utc = timeline.moved_utc(event, None).lo();
    here.is_some_and(|lo| reading.monotonic.us() < lo)
        || utc_ends(timeline, reading).zip(in_utc).is_some_and(|((_, hi), lo)| hi < lo)
}

/// Whether a reading is proven to be after an event.
fn is_after(timeline: &Timeline<'_>, reading: &HostReading, event: EventId) -> bool {
    let here =
        timeline.moved_on(event, None).get(&Home::Boot(reading.boot)).and_then(|ends| ends.1);
    let in_utc = timeline.moved_utc(event, None).hi();
    here.is_some_and(|hi| reading.monotonic.us() > hi)
        || utc_ends(timeline, reading).zip(in_utc).is_some_and(|((lo, _), hi)| lo > hi)
}

/// The time of a reading in UTC, if it is known how far the host may be from it.
fn utc_ends(timeline: &Timeline<'_>, reading: &HostReading) -> Option<(Moment<Utc>, Moment<Utc>)> {
    let doubt = reading.utc_doubt_us.or(timeline.site().utc_doubt_us)?;
    let doubt = i64::try_from(doubt).ok()?;
    let end = |us: i64| Moment::<Utc>::from_us(reading.utc.us().saturating_add(us));
    Some((end(-doubt), end(doubt)))
}
