//! What is complete, and what is missing.

use super::pick::Incident;
use super::suppressed::{self, LeftOut};
use crate::clock::Home;
use crate::history::{LogGap, RecorderHistory};
use crate::record::{HostReading, Why};
use crate::time::{Bound, Moment, Utc};
use crate::timeline::{ChangeId, EventId, Timeline};

/// What is known of one recorder around an incident.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Completeness {
    /// The recorder, by its index in the history.
    pub recorder: u32,
    /// Its entries in the incident.
    pub entries: usize,
    /// What is missing in the incident, or right before it: the gap, and the entry after it.
    pub gaps: Vec<(LogGap, EventId)>,
    /// The first and the last entry of the stretch without a gap that the incident is in. Their
    /// clocks may be known differently well, so each end has what is known of its own.
    pub unbroken: Option<(StretchEnd, StretchEnd)>,
    /// When it was last read, by the host that did; `None` if no source says.
    pub read_until: Option<HostReading>,
    /// Whether it was read, or has an entry, after the end of the incident; or the end is its own.
    pub is_known_to_end: bool,
    /// Entries that contradict each other.
    pub conflicts: usize,
    /// Entries of which not even the day is known, because the clock was never set: they may belong
    /// to the incident.
    pub timeless: usize,
    /// What its chatter filters left out; `None` if nobody looked. It is no gap: the recorder was
    /// told to leave that out.
    pub left_out: Option<LeftOut>,
    /// What is known of its clock at its last entry in the incident, or before.
    pub clock: ClockState,
}

/// The first or the last entry of a stretch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StretchEnd {
    /// The entry.
    pub event: EventId,
    /// What is known of the clock that stamped it.
    pub clock: ClockState,
}

/// What is known of a recorder's clock at an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClockState {
    /// The recorder has no entry in the incident nor before, so there is no time to be known.
    NoEntry,
    /// Nobody observed it.
    NotObserved,
    /// It was observed: how far its times may be off, either way, on the scale on which recorders
    /// are compared, and in UTC.
    Observed {
        /// The scale on which it is compared.
        home: Home,
        /// On that scale, in microseconds.
        order_doubt_us: Option<i64>,
        /// In UTC, in microseconds; `None` if the host's own doubt is not known.
        utc_doubt_us: Option<i64>,
    },
}

impl Completeness {
    /// Whether nothing is missing in the incident, as far as anybody can say.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.gaps.is_empty() && self.conflicts == 0 && self.is_known_to_end
    }
}

/// For every recorder of the history.
pub(super) fn of_all(timeline: &Timeline<'_>, incident: &Incident) -> Vec<Completeness> {
    let recorders = timeline.history().recorders.iter().zip(0..);
    recorders.map(|(history, recorder)| of(timeline, incident, history, recorder)).collect()
}

fn of(
    timeline: &Timeline<'_>,
    incident: &Incident,
    history: &RecorderHistory,
    recorder: u32,
) -> Completeness {
    let here: Vec<EventId> =
        incident.events.iter().copied().filter(|event| event.recorder == recorder).collect();
    let gaps = incident.gaps.iter().filter(|(event, _)| event.recorder == recorder);
    let gaps: Vec<(LogGap, EventId)> = gaps
        .filter_map(|&(event, index)| Some((*timeline.life(event)?.gaps.get(index)?, event)))
        .collect();
    let last = incident.events.last().and_then(|&event| {
        let input = timeline.held(event)?.entry.changed.numbers().next()?;
        Some(ChangeId { event, input })
    });
    let near = here.last().copied().or_else(|| last_before(timeline, incident, recorder));
    let is_at_incident = |reading: &HostReading| Some((reading.boot, reading.monotonic, *reading));
    let readings = history.watched.iter().filter_map(|watched| is_at_incident(&watched.to));
    Completeness {
        recorder,
        entries: here.len(),
        gaps,
        unbroken: near.and_then(|event| unbroken(timeline, event)),
        read_until: readings.max_by_key(|(_, _, reading)| reading.utc).map(|(_, _, at)| at),
        is_known_to_end: last.is_some_and(|last| {
            last.event.recorder == recorder || is_covered_until(timeline, recorder, last, 0)
        }),
        conflicts: history.conflicts.len(),
        timeless: timeless(timeline, history, recorder),
        left_out: suppressed::of(timeline, incident, &history.suppressed),
        clock: near.map_or(ClockState::NoEntry, |event| clock(timeline, event)),
    }
}

/// Entries without a time. A life has times for all or for none.
fn timeless(timeline: &Timeline<'_>, history: &RecorderHistory, recorder: u32) -> usize {
    let lives = (0_u32..).zip(&history.lives);
    let without = lives.filter(|(life, _)| {
        timeline.sort_key(EventId { recorder, life: *life, place: 0 }).is_none()
    });
    without.map(|(_, life)| life.entries.len()).sum()
}

/// The last entry of a recorder before the incident.
fn last_before(timeline: &Timeline<'_>, incident: &Incident, recorder: u32) -> Option<EventId> {
    let begins = incident.events.first().and_then(|&first| timeline.sort_key(first))?;
    timeline.last_before(recorder, begins)
}

/// The stretch without a gap around an entry.
fn unbroken(timeline: &Timeline<'_>, event: EventId) -> Option<(StretchEnd, StretchEnd)> {
    let life = timeline.life(event)?;
    let place = event.place as usize;
    let gap = life.gaps.partition_point(|gap| gap.place <= place);
    let left_out = life.left_out.partition_point(|&left_out| left_out <= place);
    let gap_before = gap.checked_sub(1).and_then(|gap| life.gaps.get(gap)).map(|gap| gap.place);
    let left_out_before = left_out.checked_sub(1).and_then(|before| life.left_out.get(before));
    let first = gap_before.max(left_out_before.copied()).unwrap_or(0);
    let gap_after = life.gaps.get(gap).map(|gap| gap.place);
    let ends = [gap_after, life.left_out.get(left_out).copied(), Some(life.entries.len())];
    let end = ends.into_iter().flatten().min().unwrap_or(0);
    let at = |place: usize| {
        let event = EventId { place: u32::try_from(place).ok()?, ..event };
        Some(StretchEnd { event, clock: clock(timeline, event) })
    };
    Some((at(first)?, at(end.checked_sub(1)?)?))
}

fn clock(timeline: &Timeline<'_>, event: EventId) -> ClockState {
    let half = |width: i64| width / 2 + width % 2;
    let Some((&home, &(lo, hi))) = timeline.moved_on(event, None).iter().next() else {
        return ClockState::NotObserved;
    };
    let order_doubt_us = lo.zip(hi).map(|(lo, hi)| half(hi.saturating_sub(lo)));
    let utc_doubt_us = timeline.moved_utc(event, None).width_us().map(half);
    ClockState::Observed { home, order_doubt_us, utc_doubt_us }
}

/// Whether a recorder's log is known without a gap until so long after a change.
pub(super) fn is_covered_until(
    timeline: &Timeline<'_>,
    recorder: u32,
    after: ChangeId,
    us: i64,
) -> bool {
    let Some(history) = timeline.history().recorders.get(recorder as usize) else { return false };
    // An entry that is proven to be later than that.
    let later = (0_u32..).zip(&history.lives).any(|(life, entries)| {
        let last = entries.entries.len().checked_sub(1).and_then(|last| u32::try_from(last).ok());
        let Some(place) = last else { return false };
        let Some(input) =
            entries.entries.last().and_then(|held| held.entry.changed.numbers().next())
        else {
            return false;
        };
        let event = EventId { recorder, life, place };
        let since = timeline.delta(after, ChangeId { event, input });
        let is_broken = entries.gaps.iter().any(|gap| gap.why == Why::LogBeganAnew);
        since.lo_us.is_some_and(|least| least > us) && !is_broken
    });
    // Or a reading after that.
    let until: Bound<Utc> = timeline.moved_utc(after.event, Some(after.input)).shifted(us, us);
    let on_scales = timeline.moved_on(after.event, Some(after.input));
    let was_read = history.watched.iter().any(|watched| {
        let reading = watched.to;
        let on_host = on_scales.get(&Home::Boot(reading.boot)).and_then(|&(_, hi)| hi);
        let is_later_here =
            on_host.is_some_and(|hi| reading.monotonic.us() > hi.saturating_add(us));
        let doubt = reading.utc_doubt_us.or(timeline.site().utc_doubt_us);
        let earliest = doubt
            .and_then(|doubt| i64::try_from(doubt).ok())
            .map(|doubt| Moment::<Utc>::from_us(reading.utc.us().saturating_sub(doubt)));
        let is_later_in_utc = earliest.zip(until.hi()).is_some_and(|(earliest, hi)| earliest > hi);
        is_later_here || is_later_in_utc
    });
    later || was_read
}
