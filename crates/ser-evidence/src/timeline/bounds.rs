//! Bounds of the samples of one life.

use super::{EventId, Timeline};
use crate::clock::envelope::{NO_HI, NO_LO};
use crate::clock::layout::Instant;
use crate::clock::lives::LifeClock;
use crate::clock::model::ClockModel;
use crate::clock::offsets::{RunClock, ends, moved};
use crate::clock::{Home, Nominal};
use crate::history::{Held, LifeHistory, RecorderHistory};
use crate::site::{Shift, Site};
use crate::time::{Bound, Moment, Shown, Utc, shown};

/// What is known of the instants of all samples of a life.
#[derive(Debug, Default)]
pub(super) struct LifeBounds {
    /// By place, each on the scale of its stretch.
    samples: Vec<(i64, i64)>,
    /// By place: from here on, the samples are on this scale.
    stretches: Vec<Stretch>,
    /// By place: where the entry is in the list.
    keys: Vec<Key>,
    /// By place: from here on, so many microseconds were moved by hand.
    shifts: Vec<(usize, i64)>,
}

/// Entries that follow each other and are known on the same scale.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    first: usize,
    home: Option<Home>,
    /// Whether their run is sure.
    is_sure: bool,
}

/// A place in the list.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Key {
    /// Whether nothing is known of the time.
    pub(super) is_timeless: bool,
    /// In UTC as well as that is known; else what the clock showed.
    pub(super) at: i64,
}

impl LifeBounds {
    /// By what the clocks of the possible runs say, each entry for itself.
    pub(super) fn new(life: &LifeHistory, clock: &LifeClock, model: &ClockModel) -> LifeBounds {
        let mut bounds = LifeBounds::default();
        bounds.samples.reserve_exact(life.entries.len());
        let mut possible = PossibleRuns::new(clock, model);
        for (place, held) in life.entries.iter().enumerate() {
            possible.turn_to(held);
            let runs = &possible.clocks;
            let home = common_home(runs);
            let is_sure = runs.len() == 1;
            let is_same = |last: &&Stretch| last.home == home && last.is_sure == is_sure;
            if bounds.stretches.last().filter(is_same).is_none() {
                bounds.stretches.push(Stretch { first: place, home, is_sure });
            }
            let sample = shown(&held.entry.time)
                .zip(home)
                .map_or((NO_LO, NO_HI), |(shown, home)| hull(runs, home, shown, model));
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
        homes.into_iter().filter_map(|home| self.tighten_on(home)).collect()
    }

    fn tighten_on(&mut self, home: Home) -> Option<(usize, usize)> {
        let places = self.places_on(home);
        let mut after = Vec::with_capacity(places.len());
        let mut to_come = (NO_HI, 0);
        for &(place, is_sure) in places.iter().rev() {
            let hi = self.samples.get(place).map_or(NO_HI, |sample| sample.1);
            // An entry of doubtful run is bounded by others, and bounds none.
            let own = (hi, place).min(to_come);
            after.push(own);
            to_come = if is_sure { own } else { to_come };
        }
        let mut so_far = (NO_LO, 0);
        let mut wrong = None;
        for (&(place, is_sure), &(hi, limits)) in places.iter().zip(after.iter().rev()) {
            let Some(sample) = self.samples.get_mut(place) else { continue };
            let own = if sample.0 > so_far.0 { (sample.0, place) } else { so_far };
            so_far = if is_sure { own } else { so_far };
            if own.0 <= hi {
                *sample = (own.0, hi);
            } else {
                // One of the two is wrong. Either may be right.
                wrong = wrong.or(Some((own.1, limits)));
                *sample = (sample.0.min(hi), sample.1.max(own.0));
            }
        }
        wrong
    }

    /// All places on this scale, and whether the run of each is sure.
    fn places_on(&self, home: Home) -> Vec<(usize, bool)> {
        let mut places = Vec::new();
        for (index, stretch) in self.stretches.iter().enumerate() {
            let end = self.stretches.get(index + 1).map_or(self.samples.len(), |next| next.first);
            if stretch.home == Some(home) {
                places.extend((stretch.first..end).map(|place| (place, stretch.is_sure)));
            }
        }
        places
    }

    /// Finds where each entry goes in the list.
    ///
    /// Each entry goes where its clock says, as far as those before and after it allow that.
    /// `delay_us` is how long before its sample a contact of this recorder moves, in the middle.
    pub(super) fn sort_keys(
        &mut self,
        life: &LifeHistory,
        clock: &LifeClock,
        model: &ClockModel,
        delay_us: i64,
    ) {
        let mut possible = PossibleRuns::new(clock, model);
        let wanted = life.entries.iter().map(|held| {
            possible.turn_to(held);
            shown(&held.entry.time).map_or(Wanted::NOWHERE, |shown| possible.on_list(shown))
        });
        self.keys = keys(wanted.collect());
        for key in self.keys.iter_mut().filter(|key| key.at != NO_LO) {
            key.at = key.at.saturating_sub(delay_us);
        }
    }

    /// Adds what people say has to be moved.
    pub(super) fn shift_by_hand(&mut self, shifts: &[&Shift]) {
        if shifts.is_empty() {
            return;
        }
        let of = |key: &Key| -> i64 {
            let applies = |shift: &&&Shift| {
                !key.is_timeless && (shift.from.us()..=shift.to.us()).contains(&key.at)
            };
            shifts.iter().filter(applies).map(|shift| shift.us).sum()
        };
        let mut latest: Option<Key> = None;
        for (place, (key, sample)) in self.keys.iter_mut().zip(&mut self.samples).enumerate() {
            let us = of(key);
            if self.shifts.last().map_or(0, |&(_, last)| last) != us {
                self.shifts.push((place, us));
            }
            *sample = moved(*sample, us);
            // The sequence decides nevertheless.
            key.at = key.at.saturating_add(us);
            *key = latest.map_or(*key, |latest| latest.max(*key));
            latest = Some(*key);
        }
    }

    /// What was moved by hand, in microseconds.
    pub(super) fn shift_us(&self, place: usize) -> i64 {
        let next = self.shifts.partition_point(|&(first, _)| first <= place);
        next.checked_sub(1).and_then(|last| self.shifts.get(last)).map_or(0, |&(_, us)| us)
    }

    /// What a stamp is in UTC by what the site says about the clock. `stamp` is what the clock showed
    /// at an entry, the first millisecond of 1970 being 2070 where that follows on 2069.
    pub(super) fn nominal(
        place: usize,
        life: &LifeHistory,
        stamp: impl Fn(&Held) -> Option<Moment<Shown>>,
        recorder: Option<&RecorderHistory>,
        site: &Site,
    ) -> Nominal {
        let rule = recorder.map(|recorder| recorder.recorder.clock).unwrap_or_default();
        let of = |place: usize| {
            let stamp = life.entries.get(place).and_then(&stamp);
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

    pub(super) fn key(&self, place: usize) -> Option<Key> {
        self.keys.get(place).copied()
    }

    /// The last place whose time is known to be below this key.
    pub(super) fn place_before(&self, at: i64) -> Option<usize> {
        let key = Key { is_timeless: false, at };
        self.keys.partition_point(|&known| known < key).checked_sub(1)
    }

    pub(super) fn sample(&self, place: usize) -> Option<(Home, (i64, i64))> {
        Some((self.home(place)?, self.samples.get(place).copied()?))
    }

    fn home(&self, place: usize) -> Option<Home> {
        self.stretch(place)?.home
    }

    fn is_run_sure(&self, place: usize) -> bool {
        self.stretch(place).is_none_or(|stretch| stretch.is_sure)
    }

    fn stretch(&self, place: usize) -> Option<&Stretch> {
        let next = self.stretches.partition_point(|stretch| stretch.first <= place);
        self.stretches.get(next.checked_sub(1)?)
    }
}

/// Where an entry goes by its own clock; if that may be any of several, between these.
#[derive(Clone, Copy, Debug)]
struct Wanted {
    at: Option<i64>,
    lo: i64,
    hi: i64,
    is_timeless: bool,
}

impl Wanted {
    const NOWHERE: Wanted = Wanted { at: None, lo: NO_LO, hi: NO_HI, is_timeless: true };

    fn of(Instant { at, within: (lo, hi), is_timeless }: Instant) -> Wanted {
        Wanted { at: Some(at), lo, hi, is_timeless }
    }

    /// Whether it can be in one place only.
    fn is_sure(&self) -> bool {
        self.lo == self.hi && !self.is_timeless
    }

    /// Where an entry goes that is either of these.
    fn or(self, other: Wanted) -> Wanted {
        let middle = |(one, other): (i64, i64)| one.midpoint(other);
        Wanted {
            at: self.at.zip(other.at).map(middle).or(self.at).or(other.at),
            lo: self.lo.min(other.lo),
            hi: self.hi.max(other.hi),
            is_timeless: self.is_timeless && other.is_timeless,
        }
    }
}

/// A key for each entry of a life, never falling.
fn keys(mut wanted: Vec<Wanted>) -> Vec<Key> {
    let has_time = wanted.iter().any(|wanted| !wanted.is_timeless);
    stay_between_sure_ones(&mut wanted);
    let mut earliest = NO_HI;
    for wanted in wanted.iter_mut().rev() {
        earliest = earliest.min(wanted.hi);
        wanted.hi = earliest;
    }
    let mut last = NO_LO;
    let mut keys = Vec::with_capacity(wanted.len());
    for wanted in &wanted {
        // The time of a clock that was never set says nothing among others that were.
        let at = wanted.at.filter(|_| wanted.is_timeless != has_time);
        let lo = last.max(wanted.lo.min(wanted.hi));
        last = match at {
            Some(at) => at.clamp(lo, wanted.hi.max(lo)),
            None => lo,
        };
        keys.push(Key { is_timeless: !has_time, at: last });
    }
    // What comes first and has no time joins what comes next.
    let first = keys.iter().find(|key| key.at != NO_LO).copied();
    for key in keys.iter_mut().take_while(|key| key.at == NO_LO) {
        *key = first.unwrap_or(*key);
    }
    keys
}

/// Sure entries are where they are, and others between them.
fn stay_between_sure_ones(wanted: &mut [Wanted]) {
    let mut last = NO_LO;
    for wanted in wanted.iter_mut() {
        (wanted.lo, wanted.hi) = (wanted.lo.max(last), wanted.hi.max(last));
        last = if wanted.is_sure() { wanted.hi } else { last };
    }
    let mut next = NO_HI;
    for wanted in wanted.iter_mut().rev() {
        (wanted.lo, wanted.hi) = (wanted.lo.min(next), wanted.hi.min(next));
        next = if wanted.is_sure() { wanted.lo } else { next };
    }
}

/// The clocks of the runs in which an entry may be, one entry after the other.
struct PossibleRuns<'m> {
    clock: &'m LifeClock,
    model: &'m ClockModel,
    by_place: &'m [usize],
    ids: Vec<usize>,
    clocks: Vec<&'m RunClock>,
}

impl<'m> PossibleRuns<'m> {
    fn new(clock: &'m LifeClock, model: &'m ClockModel) -> PossibleRuns<'m> {
        PossibleRuns { clock, model, by_place: &[], ids: Vec::new(), clocks: Vec::new() }
    }

    /// Finds those of an entry. Most entries have the same as the one before.
    fn turn_to(&mut self, held: &Held) {
        let possible = self.clock.runs.of(held.sequence, shown(&held.entry.time));
        if std::ptr::eq(possible.by_place(), self.by_place) && possible.is_one_by_place() {
            return;
        }
        self.by_place = possible.by_place();
        self.ids.clear();
        let ids = possible.runs().filter_map(|run| self.clock.ids.get(run).copied());
        self.ids.extend(ids);
        self.clocks.clear();
        self.clocks.extend(self.ids.iter().filter_map(|&id| self.model.runs.get(id)));
    }

    /// Where an entry with this stamp goes in the list.
    fn on_list(&self, shown: Moment<Shown>) -> Wanted {
        let each = self.ids.iter().zip(&self.clocks);
        let wanted = each.map(|(&id, run)| {
            let instant = self.model.layout.instant(id, run.unwrapped(shown));
            instant.map_or(Wanted::NOWHERE, Wanted::of)
        });
        wanted.reduce(Wanted::or).unwrap_or(Wanted::NOWHERE)
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
    pub(super) fn samples(&self, event: EventId) -> impl Iterator<Item = (Home, (i64, i64))> {
        let place = event.place as usize;
        let sample = self.bounds(event).and_then(|bounds| bounds.sample(place));
        let others = move || {
            let held = self.held(event)?;
            let run = self.model.runs.get(self.clock(event)?.sure_run(held)?)?;
            let x = run.unwrapped(shown(&held.entry.time)?);
            let shift_us = self.shift_us(event);
            let on = move |home| (home, moved(run.instant(home, x), shift_us));
            Some(run.homes().skip(1).map(on))
        };
        sample.into_iter().chain(others().into_iter().flatten())
    }

    /// The first entry of the stretch that an entry is in.
    pub(super) fn first_of_stretch(&self, event: EventId) -> EventId {
        let stretch = self.bounds(event).and_then(|bounds| bounds.stretch(event.place as usize));
        let first = stretch.and_then(|stretch| u32::try_from(stretch.first).ok());
        EventId { place: first.unwrap_or(event.place), ..event }
    }

    /// Whether it is known in which run of its clock an entry is.
    pub(super) fn is_run_sure(&self, event: EventId) -> bool {
        self.bounds(event).is_none_or(|bounds| bounds.is_run_sure(event.place as usize))
    }

    /// The instant of the sample in UTC.
    pub(super) fn sample_utc(&self, event: EventId) -> Bound<Utc> {
        let in_utc = |(home, (lo, hi)): (Home, (i64, i64))| match home {
            Home::Utc => Bound::from_us(lo, hi),
            Home::Boot(boot) => self.model.hosts.utc(boot, Bound::from_us(lo, hi)),
        };
        self.samples(event).map(in_utc).fold(Bound::UNKNOWN, Bound::intersection)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where an entry would go, and whether that is proven.
    fn wanted(at: Option<i64>, is_proven: bool) -> Wanted {
        match at {
            Some(at) if is_proven => Wanted { at: Some(at), lo: at, hi: at, is_timeless: false },
            _ => Wanted { at, is_timeless: at.is_none(), ..Wanted::NOWHERE },
        }
    }

    fn keys_of(entries: &[(Option<i64>, bool)]) -> Vec<i64> {
        let entries = entries.iter().map(|&(at, is_proven)| wanted(at, is_proven));
        keys(entries.collect()).into_iter().map(|key| key.at).collect()
    }

    #[test]
    fn proven_times_are_kept_and_others_fit_in_between() {
        let entries = [(Some(10), true), (Some(5), false), (Some(99), false), (Some(20), true)];
        assert_eq!(keys_of(&entries), [10, 10, 20, 20]);
        assert_eq!(keys_of(&[(Some(10), true), (Some(15), false), (Some(20), true)]), [10, 15, 20]);
    }

    #[test]
    fn what_has_no_time_joins_its_neighbours() {
        assert_eq!(keys_of(&[(None, false), (Some(10), true), (None, false)]), [10, 10, 10]);
        assert_eq!(keys_of(&[(None, false), (Some(7), false), (Some(3), false)]), [7, 7, 7]);
    }

    #[test]
    fn wide_bounds_are_narrowed_by_those_before_and_after() {
        let wide =
            |lo: i64, hi: i64| Wanted { at: Some(lo.midpoint(hi)), lo, hi, is_timeless: false };
        let of = keys(vec![wide(0, 100), wide(2, 8)]);
        assert_eq!(of.iter().map(|key| key.at).collect::<Vec<_>>(), [8, 8]);
        let of = keys(vec![wide(40, 48), wide(0, 60)]);
        assert_eq!(of.iter().map(|key| key.at).collect::<Vec<_>>(), [44, 44]);
    }

    #[test]
    fn clocks_that_were_never_set_are_among_themselves() {
        let never = |at| Wanted { at: Some(at), ..Wanted::NOWHERE };
        let of = |wanted: Vec<Wanted>| -> Vec<(bool, i64)> {
            keys(wanted).into_iter().map(|key| (key.is_timeless, key.at)).collect()
        };
        assert_eq!(of(vec![never(1), never(2)]), [(true, 1), (true, 2)]);
        assert_eq!(of(vec![never(1), wanted(Some(500), true)]), [(false, 500), (false, 500)]);
    }
}
