//! The entries of all recorders in one list, with what is proven of their order.
//!
//! Each entry gets bounds for the instant of its sample: on the monotonic clock of the host that
//! observed the recorder, on which recorders are compared, and in UTC. The list is sorted by the
//! middle of the bounds. It respects everything that is proven, and does not depend on the order of
//! the sources. What stands side by side in it may be of unknown order nevertheless: ask
//! [`Timeline::order`].

mod bounds;
mod contacts;
mod delta;
mod list;
mod watching;

pub use contacts::{ContactFinding, ContactTrouble};
pub use delta::{Delta, Order};
pub use list::{Item, Items};

use std::collections::BTreeMap;

use crate::clock::lives::LifeClock;
use crate::clock::model::ClockModel;
use crate::clock::placing::{self, Whereabouts};
use crate::clock::runs::Step;
use crate::clock::sorting;
use crate::clock::{Finding, Nominal};
use crate::history::{Held, History, LifeHistory, RecorderHistory};
use crate::record::Place;
use crate::site::{Recorder, Site};
use crate::time::{Bound, Moment, Utc, shown};
use bounds::{Key, LifeBounds};

/// One entry of one life of one recorder.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct EventId {
    /// Index of the recorder in the history.
    pub recorder: u32,
    /// Index of the life among those of the recorder.
    pub life: u32,
    /// Index of the entry among those of the life.
    pub place: u32,
}

/// One input that changed in one entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ChangeId {
    /// The entry.
    pub event: EventId,
    /// The input, from 1.
    pub input: u8,
}

/// All entries with their bounds, in order.
#[derive(Debug)]
pub struct Timeline<'a> {
    site: &'a Site,
    history: &'a History,
    model: ClockModel,
    /// By recorder and life.
    lives: Vec<Vec<LifeBounds>>,
    findings: Vec<Finding>,
    contact_findings: Vec<ContactFinding>,
    /// Changes of two recorders that are one movement.
    pairs: BTreeMap<ChangeId, ChangeId>,
    out_of_order: Vec<(EventId, EventId)>,
}

impl<'a> Timeline<'a> {
    /// From all that is known.
    #[must_use]
    pub fn new(site: &'a Site, history: &'a History) -> Timeline<'a> {
        let model = ClockModel::new(site, history);
        let mut timeline = Timeline {
            site,
            history,
            model,
            lives: Vec::new(),
            findings: Vec::new(),
            contact_findings: Vec::new(),
            pairs: BTreeMap::new(),
            out_of_order: Vec::new(),
        };
        timeline.reckon();
        let contacts::Shared { links, pairs, findings } = contacts::shared(&timeline);
        timeline.contact_findings = findings;
        timeline.pairs = pairs;
        if !links.is_empty() {
            timeline.model.add_links(links);
            timeline.reckon();
        }
        timeline.findings.clone_from(&timeline.model.findings);
        timeline.findings.sort_unstable();
        timeline
    }

    /// Bounds of all entries by what the clocks say now.
    fn reckon(&mut self) {
        let mut out_of_order = Vec::new();
        let mut lives = Vec::new();
        let recorders = self.history.recorders.iter().zip(&self.model.lives).enumerate();
        for (recorder, (history, clocks)) in recorders {
            let mut of_recorder = Vec::new();
            for (life, (entries, clock)) in history.lives.iter().zip(clocks).enumerate() {
                let mut bounds = LifeBounds::new(entries, clock, &self.model);
                let id = |place: usize| event_id(recorder, life, place);
                let pairs = bounds.tighten();
                out_of_order.extend(pairs.into_iter().map(|(one, other)| (id(one), id(other))));
                bounds.sort_keys(entries, clock, &self.model, middle_delay_us(&history.recorder));
                let shifts = self.site.shifts.iter();
                let shifts = shifts.filter(|shift| Some(shift.recorder) == history.site);
                bounds.shift_by_hand(&shifts.collect::<Vec<_>>());
                of_recorder.push(bounds);
            }
            lives.push(of_recorder);
        }
        self.lives = lives;
        self.out_of_order = out_of_order;
    }

    /// The site by which it was made.
    #[must_use]
    pub fn site(&self) -> &'a Site {
        self.site
    }

    /// What it was made from.
    #[must_use]
    pub fn history(&self) -> &'a History {
        self.history
    }

    /// What people should know about the clocks.
    #[must_use]
    pub fn findings(&self) -> &[Finding] {
        &self.findings
    }

    /// Contacts that two recorders should have seen alike, and have not.
    #[must_use]
    pub fn contact_findings(&self) -> &[ContactFinding] {
        &self.contact_findings
    }

    /// The change of another recorder that is the same movement of the same contact, if it is
    /// beyond doubt which one that is.
    #[must_use]
    pub fn same_movement(&self, change: ChangeId) -> Option<ChangeId> {
        self.pairs.get(&change).copied()
    }

    /// Pairs of entries of one life whose bounds cannot both be true: the first came first, and
    /// what is known says that it was later. An observation is wrong there.
    #[must_use]
    pub fn out_of_order(&self) -> &[(EventId, EventId)] {
        &self.out_of_order
    }

    /// The recorder of an entry.
    #[must_use]
    pub fn recorder(&self, event: EventId) -> Option<&'a RecorderHistory> {
        self.history.recorders.get(event.recorder as usize)
    }

    /// The life of an entry.
    #[must_use]
    pub fn life(&self, event: EventId) -> Option<&'a LifeHistory> {
        self.recorder(event)?.lives.get(event.life as usize)
    }

    /// The entry itself.
    #[must_use]
    pub fn held(&self, event: EventId) -> Option<&'a Held> {
        self.life(event)?.entries.get(event.place as usize)
    }

    /// When the contact moved, in UTC: of this input, or of the first and the last that changed.
    #[must_use]
    pub fn moved_utc(&self, event: EventId, input: Option<u8>) -> Bound<Utc> {
        let (lo, hi) = self.delay_ends(event, input);
        self.sample_utc(event).shifted(lo, hi)
    }

    /// When the contact moved, on each scale on which the recorder was observed.
    #[must_use]
    pub fn moved_on(
        &self,
        event: EventId,
        input: Option<u8>,
    ) -> BTreeMap<crate::clock::Home, (Option<i64>, Option<i64>)> {
        let (lo, hi) = self.delay_ends(event, input);
        let ends = |bound: (i64, i64)| {
            let bound = Bound::<Utc>::from_us(bound.0, bound.1).shifted(lo, hi);
            (bound.lo().map(Moment::us), bound.hi().map(Moment::us))
        };
        self.samples(event).map(|(home, bound)| (home, ends(bound))).collect()
    }

    /// What the site file adds to the time of an entry by hand, in microseconds.
    #[must_use]
    pub fn shift_us(&self, event: EventId) -> i64 {
        self.bounds(event).map_or(0, |bounds| bounds.shift_us(event.place as usize))
    }

    /// What the stamp is in UTC by what the site says about the clock, for a clock that nobody
    /// observed.
    #[must_use]
    pub fn nominal(&self, event: EventId) -> Nominal {
        let (Some(life), Some(clock)) = (self.life(event), self.clock(event)) else {
            return Nominal::NotKnown;
        };
        let stamp = |held: &Held| {
            let stamp = shown(&held.entry.time)?;
            let run = clock.sure_run(held).and_then(|run| self.model.runs.get(run));
            // Where the clock began a century anew, it goes on.
            Some(run.map_or(stamp, |run| stamp.max(Moment::from_us(run.unwrapped(stamp)))))
        };
        LifeBounds::nominal(event.place as usize, life, stamp, self.recorder(event), self.site)
    }

    /// When the sample was taken, in UTC as well as that is known: for people, and without doubt.
    /// `None` if nothing is known about its time.
    #[must_use]
    pub fn time(&self, event: EventId) -> Option<Moment<Utc>> {
        let delay_us = middle_delay_us(&self.recorder(event)?.recorder);
        Some(Moment::from_us(self.sort_key(event)?.saturating_add(delay_us)))
    }

    /// Where the entry is in the list; `None` if nothing is known about its time.
    #[must_use]
    pub fn sort_key(&self, event: EventId) -> Option<i64> {
        let key = self.key(event)?;
        (!key.is_timeless).then_some(key.at)
    }

    fn key(&self, event: EventId) -> Option<Key> {
        self.bounds(event)?.key(event.place as usize)
    }

    /// The last entry of a recorder whose place in the list is before this key.
    #[must_use]
    pub fn last_before(&self, recorder: u32, key: i64) -> Option<EventId> {
        let lives = self.lives.get(recorder as usize)?.iter().enumerate();
        let last = lives.filter_map(|(life, bounds)| {
            let event = event_id(recorder as usize, life, bounds.place_before(key)?);
            Some((self.sort_key(event)?, event))
        });
        last.max().map(|(_, event)| event)
    }

    /// After which sequence of which life a place in the log of a recorder is; `None` if no entry
    /// of the life is known, or if nobody can say.
    #[must_use]
    pub fn located(&self, recorder: usize, place: &Place) -> Option<(usize, u64)> {
        match placing::locate(self.history.recorders.get(recorder)?, place) {
            Whereabouts::Here(at) => Some((at.life, at.after)),
            Whereabouts::Elsewhere | Whereabouts::Anywhere => None,
        }
    }

    /// Whether an observation, by its index, tells nothing of the entries from one to another of the
    /// same life, and would seem to if they were all that is held of it: only the stamps of others
    /// say that its clock was set in between.
    #[must_use]
    pub fn is_of_others(&self, observation: usize, first: EventId, last: EventId) -> bool {
        let told = || {
            let history = self.recorder(first)?;
            let lives = self.model.lives.get(first.recorder as usize)?;
            let observed = (observation, history.observations.get(observation)?);
            let clock = self.clock(first)?;
            let held = self.life(first)?.entries.get(first.place as usize..=last.place as usize)?;
            let (begin, end) = (held.first()?.sequence, held.last()?.sequence);
            let is_outside = |step: &Step| step.before < begin || step.after >= end;
            if !clock.runs.steps.iter().any(|step| step.is_silent() && is_outside(step)) {
                return Some(false);
            }
            let of = sorting::runs_of(history, lives, &self.model.hosts, observed);
            let may_be = |held: &Held| {
                let mut runs = clock.runs.of(held.sequence, shown(&held.entry.time)).runs();
                runs.any(|run| clock.ids.get(run).is_some_and(|id| of.contains(id)))
            };
            Some(!held.iter().any(may_be))
        };
        told().unwrap_or(false)
    }

    /// The last place of the life of this entry whose time is known to be below this key.
    fn place_before(&self, event: EventId, key: i64) -> Option<usize> {
        self.bounds(event)?.place_before(key)
    }

    fn bounds(&self, event: EventId) -> Option<&LifeBounds> {
        self.lives.get(event.recorder as usize)?.get(event.life as usize)
    }

    fn clock(&self, event: EventId) -> Option<&LifeClock> {
        self.model.lives.get(event.recorder as usize)?.get(event.life as usize)
    }
}

/// How long before its sample a contact of this recorder moved, in the middle.
fn middle_delay_us(recorder: &Recorder) -> i64 {
    let (earliest, latest) = delta::delay_ends_of(recorder, None);
    -earliest.midpoint(latest)
}

/// An entry by its indices. Nobody has four billion of anything here.
pub(crate) fn event_id(recorder: usize, life: usize, place: usize) -> EventId {
    let narrow = |index: usize| u32::try_from(index).unwrap_or(u32::MAX);
    EventId { recorder: narrow(recorder), life: narrow(life), place: narrow(place) }
}
