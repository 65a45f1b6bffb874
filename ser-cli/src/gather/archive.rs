//! Reads what is wanted of an archive: for an incident, the time around it.
//!
//! Which entries belong to a time is only known when all that is known of clocks is put together.
//! So a part is read by what clocks showed, the timeline is made, and where entries were left out
//! that may belong to the time, more is read, until none can.

use std::collections::{BTreeMap, BTreeSet};

use ser_archive::{Archive, Wanted, Window};
use ser_evidence::history::Collector;
use ser_evidence::incident::{Incident, Which};
use ser_evidence::record::{Life, Record};
use ser_evidence::site::{Role, Site};
use ser_evidence::time::{Moment, shown};
use ser_evidence::timeline::{EventId, Timeline};

use super::routine;
use crate::error::Result;

/// How far a clock may show another time than it is known to, in microseconds: a day and a half, so
/// that its zone need not be known.
const CLOCK_US: i64 = 36 * 3_600_000_000;

/// Clocks that are so near to each other are taken together.
const ALIKE_US: i64 = 12 * 3_600_000_000;

/// How much of the time before and after an incident is read as well, in microseconds: an hour.
const BESIDE_US: i64 = 3_600_000_000;

/// How often more is read before everything is.
const MOST_ROUNDS: usize = 12;

/// What is read of an archive.
pub(super) struct Excerpts {
    archive: Archive,
    recorders: Vec<Recorder>,
    /// From when to when everything is wanted, in microseconds of UTC.
    span: Option<(i64, i64)>,
    /// Whether everything is.
    is_whole: bool,
}

/// What is read of one recorder.
struct Recorder {
    name: String,
    /// Everything but entries.
    evidence: Vec<Record>,
    /// How far its clock may be ahead of UTC, in steps of [`ALIKE_US`].
    ahead: BTreeSet<i64>,
    wanted: Wanted,
}

impl Excerpts {
    /// Begins with the ends of each life.
    pub(super) fn begin(mut archive: Archive) -> Result<Excerpts> {
        let mut recorders = Vec::new();
        for name in archive.recorders()? {
            let mut evidence = Vec::new();
            archive.evidence(&name, &mut |record| {
                evidence.push(record.clone());
                Ok(())
            })?;
            // What is missing may be missing over the whole time.
            let told = evidence.iter().filter_map(|record| match record {
                Record::Gap(gap) => Some((gap.life, gap.after?)),
                _ => None,
            });
            let places = told.filter(|(life, _)| life.is_known()).collect();
            let wanted = Wanted { places, ..Wanted::default() };
            recorders.push(Recorder { name, evidence, ahead: BTreeSet::from([0]), wanted });
        }
        Ok(Excerpts { archive, recorders, span: None, is_whole: false })
    }

    /// Says what is wanted.
    pub(super) fn want(&mut self, site: &Site, which: Option<Which>) -> Result<()> {
        self.resolve_places()?;
        match which {
            None => self.is_whole = true,
            Some(Which::Last) => {}
            Some(Which::LastTrip) => self.want_last_trips(site)?,
            Some(Which::Around(from, until)) => {
                self.span = Some((from.after(-BESIDE_US).us(), until.after(BESIDE_US).us()));
            }
            Some(Which::Between(since, until)) => {
                let since = since.map_or(i64::MIN, |since| since.after(-BESIDE_US).us());
                let until = until.map_or(i64::MAX, |until| until.after(BESIDE_US).us());
                self.span = Some((since, until));
            }
        }
        Ok(())
    }

    /// Wants an entry, wherever it is.
    pub(super) fn want_entry(&mut self, recorder: &str, life: Life, sequence: u64) {
        let found = self.recorders.iter_mut().find(|found| found.name == recorder);
        if let Some(found) = found {
            found.wanted.places.push((life, sequence));
        }
    }

    /// Whoever set a clock may not have known in which life that was. The entry that was the newest
    /// tells it.
    fn resolve_places(&mut self) -> Result<()> {
        for recorder in &mut self.recorders {
            let places = recorder.evidence.iter().filter_map(|record| match record {
                Record::Clock(observation) => Some(&observation.place),
                Record::Step(step) => Some(&step.place),
                _ => None,
            });
            for place in places.filter(|place| !place.life.is_known()) {
                if let Some((after, newest)) = place.after.zip(place.newest.as_ref()) {
                    let found = self.archive.life_of(&recorder.name, after, newest)?;
                    recorder.wanted.places.extend(found);
                }
            }
        }
        Ok(())
    }

    fn want_last_trips(&mut self, site: &Site) -> Result<()> {
        for recorder in &mut self.recorders {
            let id = site.recorder(&recorder.name);
            let trips = site.points.iter().filter(|point| {
                Some(point.recorder) == id && matches!(point.role, Some(Role::Trip | Role::Lockout))
            });
            let inputs = trips.fold(0_u32, |inputs, point| {
                inputs | 1_u32.checked_shl(u32::from(point.input).wrapping_sub(1)).unwrap_or(0)
            });
            if inputs != 0 {
                recorder.wanted.places.extend(self.archive.last_on(&recorder.name, inputs)?);
            }
        }
        Ok(())
    }

    /// Adds what is wanted to a collector.
    pub(super) fn collect(&mut self, collector: &mut Collector) -> Result<()> {
        for recorder in &mut self.recorders {
            let name = &recorder.name;
            collector.begin_source();
            if self.is_whole {
                recorder.evidence.iter().for_each(|record| collector.add(name, record));
                self.archive.read(name, Window::default(), &mut |record| {
                    if matches!(record, Record::Entry(_)) {
                        collector.add(name, record);
                    }
                    Ok(())
                })?;
                continue;
            }
            let needed = routine::needed(&recorder.evidence, self.span);
            needed.into_iter().for_each(|record| collector.add(name, record));
            recorder.wanted.windows =
                self.span.map_or_else(Vec::new, |span| windows(&recorder.ahead, span));
            let left_out = self.archive.excerpt(name, &recorder.wanted, &mut |record| {
                collector.add(name, record);
                Ok(())
            })?;
            for left_out in left_out {
                collector.leave_out(name, left_out.life, left_out.after, left_out.before);
            }
        }
        Ok(())
    }

    /// Whether everything that is wanted was read, as this timeline shows it. If not, more of it is
    /// wanted now.
    pub(super) fn is_enough(
        &mut self,
        timeline: &Timeline<'_>,
        which: Which,
        round: usize,
    ) -> bool {
        if self.is_whole {
            return true;
        }
        if round >= MOST_ROUNDS {
            self.is_whole = true;
            return false;
        }
        let Some(incident) = Incident::pick(timeline, which) else {
            return self.is_closed(timeline);
        };
        // Where more time is wanted, nobody has looked there yet for what was left out.
        let is_within = matches!(which, Which::Between(..)) || self.holds(timeline, &incident);
        is_within && self.is_closed(timeline)
    }

    /// Whether an incident, and a quiet time around it, is in the time that was read; widens it
    /// otherwise.
    fn holds(&mut self, timeline: &Timeline<'_>, incident: &Incident) -> bool {
        let quiet = timeline.site().incident.quiet_us;
        let keys = || incident.events.iter().filter_map(|&event| timeline.sort_key(event));
        let Some((first, last)) = keys().min().zip(keys().max()) else { return true };
        let (first, last) = (first.saturating_sub(quiet), last.saturating_add(quiet));
        if self.span.is_some_and(|(from, until)| from <= first && last <= until) {
            return true;
        }
        let (from, until) = self.span.unwrap_or((first, last));
        let (first, last) = (first.saturating_sub(BESIDE_US), last.saturating_add(BESIDE_US));
        self.span = Some((from.min(first), until.max(last)));
        false
    }

    /// Whether no entry that was left out can be in the time that is wanted.
    fn is_closed(&mut self, timeline: &Timeline<'_>) -> bool {
        let Some((from, until)) = self.span else { return true };
        let mut is_closed = true;
        let by_name: BTreeMap<String, usize> =
            self.recorders.iter().map(|recorder| recorder.name.clone()).zip(0..).collect();
        for (index, history) in (0_u32..).zip(&timeline.history().recorders) {
            let recorder = by_name.get(&history.recorder.name);
            let Some(recorder) = recorder.and_then(|&at| self.recorders.get_mut(at)) else {
                continue;
            };
            for (life_index, life) in (0_u32..).zip(&history.lives) {
                for &place in &life.left_out {
                    let event = |place: usize| EventId {
                        recorder: index,
                        life: life_index,
                        place: u32::try_from(place).unwrap_or(u32::MAX),
                    };
                    let sides = [event(place.saturating_sub(1)), event(place)];
                    let [before, after] = sides.map(|event| timeline.sort_key(event));
                    // A life of which not even the day is known may have happened at any time.
                    let is_outside = before.is_some_and(|before| before > until)
                        || after.is_some_and(|after| after < from);
                    if is_outside {
                        continue;
                    }
                    let ahead = sides.map(|event| ahead_of_utc(timeline, event));
                    is_closed &= !recorder.want_more(ahead, life.name());
                }
            }
        }
        is_closed
    }
}

impl Recorder {
    /// Wants the entries of a life that its clock, so much ahead of UTC, may have shown in the
    /// time. Where that was read already, the whole life is wanted. Returns whether that is more.
    fn want_more(&mut self, ahead: [Option<i64>; 2], life: Life) -> bool {
        let mut is_more = false;
        for ahead in ahead.into_iter().flatten() {
            is_more |= self.ahead.insert(ahead.saturating_add(ALIKE_US / 2).div_euclid(ALIKE_US));
        }
        if !is_more && !self.wanted.lives.contains(&life) {
            self.wanted.lives.push(life);
            is_more = true;
        }
        is_more
    }
}

/// How far the clock was ahead of UTC at an entry, as well as that is known.
fn ahead_of_utc(timeline: &Timeline<'_>, event: EventId) -> Option<i64> {
    let shown = shown(&timeline.held(event)?.entry.time)?.us();
    Some(shown.saturating_sub(timeline.sort_key(event)?))
}

/// What clocks that are so much ahead of UTC may have shown in a time.
fn windows(ahead: &BTreeSet<i64>, (from, until): (i64, i64)) -> Vec<Window> {
    let mut windows: Vec<(i64, i64)> = Vec::new();
    for &steps in ahead {
        let ahead = steps.saturating_mul(ALIKE_US);
        let moved = |us: i64, by: i64| match us {
            i64::MIN | i64::MAX => us,
            us => us.saturating_add(ahead).saturating_add(by),
        };
        let around_us = CLOCK_US + ALIKE_US / 2;
        let (from, until) = (moved(from, -around_us), moved(until, around_us));
        match windows.last_mut() {
            Some(last) if from <= last.1 => last.1 = until.max(last.1),
            _ => windows.push((from, until)),
        }
    }
    let window = |(from, until): (i64, i64)| Window {
        from: (from != i64::MIN).then(|| Moment::from_us(from)),
        until: (until != i64::MAX).then(|| Moment::from_us(until)),
    };
    windows.into_iter().map(window).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_that_touch_are_one_and_open_ends_stay_open() {
        let hours = |window: &Window| {
            let hour = |moment: Option<Moment<_>>| moment.map(|at| at.us() / 3_600_000_000);
            (hour(window.from), hour(window.until))
        };
        let of = |ahead: &[i64], span| -> Vec<_> {
            windows(&ahead.iter().copied().collect(), span).iter().map(hours).collect()
        };
        assert_eq!(of(&[0], (0, 0)), [(Some(-42), Some(42))]);
        assert_eq!(of(&[0, 1], (0, 0)), [(Some(-42), Some(54))]);
        assert_eq!(of(&[0, 20], (0, 0)), [(Some(-42), Some(42)), (Some(198), Some(282))]);
        assert_eq!(of(&[0, 20], (0, i64::MAX)), [(Some(-42), None)]);
    }
}
