//! Bounds of the samples of one life.

use super::sort_key;
use super::{EventId, Timeline};
use crate::clock::envelope::{NO_HI, NO_LO};
use crate::clock::model::{ClockModel, LifeClock};
use crate::clock::offsets::{RunClock, ends};
use crate::clock::{Home, Nominal};
use crate::history::{LifeHistory, RecorderHistory};
use crate::site::Site;
use crate::time::{Bound, Moment, Shown, Utc, shown};

/// What is known of the instants of all samples of a life.
#[derive(Debug, Default)]
pub(super) struct LifeBounds {
    /// By place, each on the scale of its stretch.
    samples: Vec<(i64, i64)>,
    /// By place: from here on, the samples are on this scale, and a clock shows UTC by rule.
    stretches: Vec<Stretch>,
    /// By place: where the entry is in the list. `NO_LO`: nowhere.
    keys: Vec<i64>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Stretch {
    pub(super) first: usize,
    pub(super) home: Option<Home>,
}

impl LifeBounds {
    /// By what the clocks of the possible runs say, each entry for itself.
    pub(super) fn new(life: &LifeHistory, clock: &LifeClock, model: &ClockModel) -> LifeBounds {
        let mut bounds = LifeBounds::default();
        bounds.samples.reserve_exact(life.entries.len());
        let mut possible: Vec<&RunClock> = Vec::new();
        let mut of = None;
        for (place, held) in life.entries.iter().enumerate() {
            let range = clock.runs.of(held.sequence);
            if of.as_ref() != Some(&range) {
                let ids = clock.ids.get(range.clone()).unwrap_or_default();
                possible = ids.iter().filter_map(|&id| model.runs.get(id)).collect();
                bounds.stretches.push(Stretch { first: place, home: common_home(&possible) });
                of = Some(range);
            }
            let home = bounds.stretches.last().and_then(|stretch| stretch.home);
            let sample = shown(&held.entry.time)
                .zip(home)
                .map_or((NO_LO, NO_HI), |(shown, home)| hull(&possible, home, shown, model));
            bounds.samples.push(sample);
        }
        bounds
    }

    /// Lets the order of the entries bound them: none is earlier than one before it, none is later
    /// than one after it. Returns pairs that cannot be, by their places.
    pub(super) fn tighten(&mut self) -> Vec<(usize, usize)> {
        let mut homes: Vec<Home> =
            self.stretches.iter().filter_map(|stretch| stretch.home).collect();
        homes.sort_unstable();
        homes.dedup();
        let mut wrong = Vec::new();
        for home in homes {
            wrong.extend(self.tighten_on(home));
        }
        wrong
    }

    fn tighten_on(&mut self, home: Home) -> Option<(usize, usize)> {
        let places = self.places_on(home);
        let mut after = vec![(NO_HI, 0); self.samples.len()];
        let mut to_come = (NO_HI, 0);
        for &place in places.iter().rev() {
            let (_, hi) = self.samples.get(place).copied().unwrap_or((NO_LO, NO_HI));
            to_come = to_come.min((hi, place));
            if let Some(after) = after.get_mut(place) {
                *after = to_come;
            }
        }
        let mut so_far = (NO_LO, 0);
        let mut wrong = None;
        for &place in &places {
            let (Some(sample), Some(&(hi, limits))) =
                (self.samples.get_mut(place), after.get(place))
            else {
                continue;
            };
            if sample.0 > so_far.0 {
                so_far = (sample.0, place);
            }
            if so_far.0 <= hi {
                *sample = (so_far.0, hi);
            } else {
                // One of the two is wrong. Either may be right.
                wrong = wrong.or(Some((so_far.1, limits)));
                *sample = (sample.0.min(hi), sample.1.max(so_far.0));
            }
        }
        wrong
    }

    fn places_on(&self, home: Home) -> Vec<usize> {
        let mut places = Vec::new();
        for (index, stretch) in self.stretches.iter().enumerate() {
            let end = self.stretches.get(index + 1).map_or(self.samples.len(), |next| next.first);
            if stretch.home == Some(home) {
                places.extend(stretch.first..end);
            }
        }
        places
    }

    /// Finds where each entry goes in the list.
    pub(super) fn sort_keys(
        &mut self,
        life: &LifeHistory,
        recorder: &RecorderHistory,
        clock: &LifeClock,
        model: &ClockModel,
        site: &Site,
    ) {
        let _ = clock;
        let known = |place: usize| {
            let (lo, hi) = self.samples.get(place).copied()?;
            let home = self.home(place)?;
            let middle = (lo != NO_LO && hi != NO_HI).then(|| lo.midpoint(hi))?;
            Some(match home {
                Home::Utc => middle,
                Home::Boot(boot) => model.hosts.nominal_utc(boot, Moment::from_us(middle)).us(),
            })
        };
        let nominal = |place: usize| {
            let nominal = self.nominal(place, life, Some(recorder), site);
            nominal.earliest().map(Moment::us)
        };
        self.keys = sort_key::keys(life.entries.len(), &known, &nominal);
    }

    /// What a stamp is in UTC by what the site says about the clock.
    pub(super) fn nominal(
        &self,
        place: usize,
        life: &LifeHistory,
        recorder: Option<&RecorderHistory>,
        site: &Site,
    ) -> Nominal {
        let rule = recorder.map(|recorder| recorder.recorder.clock).unwrap_or_default();
        let of = |place: usize| {
            let stamp = life.entries.get(place).and_then(|held| shown(&held.entry.time));
            stamp.map_or(Nominal::NotKnown, |stamp| Nominal::of(stamp, rule, &site.time_zone))
        };
        let this = of(place);
        if !matches!(this, Nominal::Ambiguous(..)) {
            return this;
        }
        let certain = |place: usize| match of(place) {
            Nominal::Time(time) => Some(time),
            _ => None,
        };
        let previous = (0..place).rev().find_map(certain);
        let next = (place + 1..life.entries.len()).find_map(certain);
        this.between(previous, next)
    }

    pub(super) fn key(&self, place: usize) -> Option<i64> {
        self.keys.get(place).copied().filter(|&key| key != NO_LO)
    }

    /// The last place with a key below this one.
    pub(super) fn place_before(&self, key: i64) -> Option<usize> {
        self.keys.partition_point(|&known| known < key).checked_sub(1)
    }

    pub(super) fn sample(&self, place: usize) -> Option<(Home, (i64, i64))> {
        Some((self.home(place)?, self.samples.get(place).copied()?))
    }

    fn home(&self, place: usize) -> Option<Home> {
        let next = self.stretches.partition_point(|stretch| stretch.first <= place);
        self.stretches.get(next.checked_sub(1)?)?.home
    }
}

/// The scale on which all of these clocks are known: that of the first for comparisons, or UTC.
fn common_home(possible: &[&RunClock]) -> Option<Home> {
    let home = possible.first()?.home()?;
    let all = |home: Home| possible.iter().all(|run| run.homes().any(|known| known == home));
    if all(home) {
        return Some(home);
    }
    possible.iter().all(|run| run.home().is_some()).then_some(Home::Utc)
}

/// When any of these clocks began to show this.
fn hull(
    possible: &[&RunClock],
    home: Home,
    shown: Moment<Shown>,
    model: &ClockModel,
) -> (i64, i64) {
    let instants = possible.iter().map(|run| instant(run, home, shown, model));
    let hull = instants.reduce(|one, other| (one.0.min(other.0), one.1.max(other.1)));
    hull.unwrap_or((NO_LO, NO_HI))
}

/// When a clock began to show this, also in UTC if it is not known there by itself.
fn instant(run: &RunClock, home: Home, shown: Moment<Shown>, model: &ClockModel) -> (i64, i64) {
    let x = run.unwrapped(shown);
    match run.home() {
        Some(Home::Boot(boot)) if home == Home::Utc && run.homes().all(|known| known != home) => {
            let (lo, hi) = run.instant(Home::Boot(boot), x);
            ends(model.hosts.utc(boot, Bound::from_us(lo, hi)))
        }
        _ => run.instant(home, x),
    }
}

impl Timeline<'_> {
    /// The instant of the sample on every scale on which it is known.
    pub(super) fn samples(&self, event: EventId) -> Vec<(Home, (i64, i64))> {
        let mut samples: Vec<(Home, (i64, i64))> = Vec::new();
        let place = event.place as usize;
        samples.extend(self.bounds(event).and_then(|bounds| bounds.sample(place)));
        let others = || {
            let held = self.held(event)?;
            let run = self.model.runs.get(self.clock(event)?.sure_run(held.sequence)?)?;
            let x = run.unwrapped(shown(&held.entry.time)?);
            Some(run.homes().skip(1).map(move |home| (home, run.instant(home, x))))
        };
        samples.extend(others().into_iter().flatten());
        samples
    }

    /// The instant of the sample in UTC.
    pub(super) fn sample_utc(&self, event: EventId) -> Bound<Utc> {
        let in_utc = |(home, (lo, hi)): (Home, (i64, i64))| match home {
            Home::Utc => Bound::from_us(lo, hi),
            Home::Boot(boot) => self.model.hosts.utc(boot, Bound::from_us(lo, hi)),
        };
        let samples = self.samples(event);
        samples.into_iter().map(in_utc).fold(Bound::UNKNOWN, Bound::intersection)
    }
}
