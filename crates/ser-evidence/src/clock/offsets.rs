//! The offset of a recorder's clock in one run.

use super::envelope::{Envelope, Known, NO_HI, NO_LO, Slope, added};
use super::hosts::{HOST_RATE_PPB, Hosts};
use crate::record::{Boot, Reference};
use crate::time::{AROUND_2069_US, Bound, CENTURY_US, Moment, Scale, Shown};

/// A scale on which a recorder's clock is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Home {
    /// The monotonic clock of a boot of a host. Recorders that the same boot has observed can be
    /// compared without any doubt about UTC.
    Boot(Boot),
    /// UTC.
    Utc,
}

/// An observation, made ready to be reckoned with.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Observed {
    /// By which it is told when it contradicts another one.
    pub(crate) id: usize,
    pub(crate) shown: Moment<Shown>,
    pub(crate) at: Reference,
}

/// The clock of one run: the instant at which it began to show a millisecond, less that
/// millisecond, on each scale on which it was observed.
#[derive(Clone, Debug)]
pub(crate) struct RunClock {
    offsets: Vec<(Home, Envelope)>,
    /// A stamp of the run. Others may be a century away by their digits only.
    reference: i64,
    /// How its rate changes its offset in true time.
    drift: Slope,
}

/// How many boots have observed how many runs: what most have in common comes first.
pub(crate) type Preference<'a> = &'a dyn Fn(Boot) -> usize;

impl RunClock {
    /// From the observations of a run. Returns also the pairs that contradict each other.
    pub(crate) fn new(
        observed: &[Observed],
        first_stamp: Option<Moment<Shown>>,
        hosts: &Hosts,
        (drift_ppb, wander_ppb): (u32, u32),
        preference: Preference<'_>,
    ) -> (RunClock, Vec<(usize, usize)>) {
        let first = observed.iter().map(|observed| observed.shown).min().or(first_stamp);
        let mut clock = RunClock {
            offsets: Vec::new(),
            reference: first.map_or(0, Moment::us),
            drift: Slope::within(drift_ppb),
        };
        let mut contradictions = Vec::new();
        for home in homes(observed, preference) {
            let points = observed.iter().filter_map(|observed| clock.known(observed, home, hosts));
            let (envelope, pairs) = Envelope::new(points.collect(), drift_ppb, wander_ppb);
            contradictions.extend(pairs);
            if !envelope.is_empty() {
                clock.offsets.push((home, envelope));
            }
        }
        contradictions.sort_unstable();
        contradictions.dedup();
        clock.share_slope();
        (clock, contradictions)
    }

    /// Whatever one scale has taught about the rate holds on all, as far as hosts keep true time.
    fn share_slope(&mut self) {
        let by_another = |slope: Slope, home: Home| match home {
            Home::Boot(_) => slope.widened(HOST_RATE_PPB),
            Home::Utc => slope,
        };
        let mut slopes =
            self.offsets.iter().map(|(home, envelope)| by_another(envelope.slope(), *home));
        let common = slopes.try_fold(self.drift, Slope::intersection);
        let Some(in_true_time) = common else { return };
        self.drift = in_true_time;
        for (home, envelope) in &mut self.offsets {
            let told = envelope.slope().intersection(by_another(in_true_time, *home));
            if let Some(slope) = told.filter(|slope| *slope != envelope.slope()) {
                *envelope = envelope.narrowed(slope);
            }
        }
    }

    /// How the clock's rate may change its offset if all hosts keep true time.
    pub(crate) fn slope(&self) -> Slope {
        let mut slopes = self.offsets.iter().map(|(_, envelope)| envelope.slope());
        slopes.try_fold(self.drift, Slope::intersection).unwrap_or(self.drift)
    }

    /// What an observation says about the offset on this scale.
    fn known(&self, observed: &Observed, home: Home, hosts: &Hosts) -> Option<Known> {
        let x = self.unwrapped(observed.shown);
        let (lo, hi) = match (home, observed.at) {
            (Home::Boot(boot), Reference::Host { bound, reading }) if reading.boot == boot => {
                ends(bound)
            }
            (Home::Boot(boot), other) => ends(hosts.monotonic(boot, in_utc(other, hosts))),
            (Home::Utc, other) => ends(in_utc(other, hosts)),
        };
        let known = Known {
            x,
            lo: if lo == NO_LO { NO_LO } else { lo.saturating_sub(x) },
            hi: if hi == NO_HI { NO_HI } else { hi.saturating_sub(x) },
            id: observed.id,
        };
        (lo != NO_LO || hi != NO_HI).then_some(known)
    }

    /// A stamp of this run in microseconds. If it is on the other side of the end of 2069 than the
    /// others, where the two digits of the year begin again, it is moved by a century.
    pub(crate) fn unwrapped(&self, shown: Moment<Shown>) -> i64 {
        let ahead = shown.us().saturating_sub(self.reference);
        let around = ahead - ahead.signum() * CENTURY_US;
        let moved = if around.abs() <= AROUND_2069_US { around } else { ahead };
        self.reference + moved
    }

    /// The scales on which something is known; the first is the one for comparisons.
    pub(crate) fn homes(&self) -> impl Iterator<Item = Home> {
        self.offsets.iter().map(|&(home, _)| home)
    }

    /// The scale for comparisons.
    pub(crate) fn home(&self) -> Option<Home> {
        self.homes().next()
    }

    /// When the clock began to show `x`, an [`unwrapped`](Self::unwrapped) stamp, on a scale.
    pub(crate) fn instant(&self, home: Home, x: i64) -> (i64, i64) {
        let Some((_, envelope)) = self.offsets.iter().find(|(known, _)| *known == home) else {
            return (NO_LO, NO_HI);
        };
        moved(envelope.at(x), x)
    }

    /// Adds that the clock began to show `x` in `[lo, hi]`. Returns whether that was news; `None`
    /// if it cannot be.
    pub(crate) fn learn(&mut self, home: Home, x: i64, (lo, hi): (i64, i64)) -> Option<bool> {
        let known = self.offsets.iter_mut().find(|(known, _)| *known == home);
        let Some((_, envelope)) = known else { return Some(false) };
        let (lo, hi) = moved((lo, hi), -x);
        envelope.learn(x, lo, hi)
    }

    /// The least and the most time that passes while the clock goes on by `dx`.
    pub(crate) fn elapsed(&self, dx: i64) -> (i64, i64) {
        let (least, most) = self.drift.change(dx);
        (dx.saturating_add(least), dx.saturating_add(most))
    }
}

/// Both ends moved by `us`; unknown ends stay.
pub(crate) fn moved(ends: (i64, i64), us: i64) -> (i64, i64) {
    added(ends, (us, us))
}

/// Both ends of a bound, in microseconds.
pub(crate) fn ends<S: Scale>(bound: Bound<S>) -> (i64, i64) {
    (bound.lo().map_or(NO_LO, Moment::us), bound.hi().map_or(NO_HI, Moment::us))
}

fn in_utc(at: Reference, hosts: &Hosts) -> Bound<crate::time::Utc> {
    match at {
        Reference::Host { bound, reading } => hosts.utc(reading.boot, bound),
        Reference::Utc(bound) => bound,
    }
}

/// The boots that made these observations, each once.
pub(super) fn boots_of(observed: &[Observed]) -> Vec<Boot> {
    let mut boots: Vec<Boot> = observed
        .iter()
        .filter_map(|observed| match observed.at {
            Reference::Host { reading, .. } => Some(reading.boot),
            Reference::Utc(_) => None,
        })
        .collect();
    boots.sort_unstable();
    boots.dedup();
    boots
}

/// The scales of these observations, the most common first.
fn homes(observed: &[Observed], preference: Preference<'_>) -> Vec<Home> {
    let mut boots = boots_of(observed);
    boots.sort_by_key(|&boot| (usize::MAX - preference(boot), boot));
    let by_hand = observed.iter().any(|observed| matches!(observed.at, Reference::Utc(_)));
    boots.into_iter().map(Home::Boot).chain(by_hand.then_some(Home::Utc)).collect()
}
