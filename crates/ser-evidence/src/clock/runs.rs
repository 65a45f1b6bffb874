//! Where a recorder's clock was set, and the runs between.

use std::ops::RangeInclusive;

use super::placing::Located;
use crate::history::{Held, LifeHistory};
use crate::record::{Boot, ClockObservation, ClockStep, Reference};
use crate::time::{Bound, CENTURY_US, Host, Moment, Shown, shown};

/// The most that two stamps differ on either side of the end of 2069, where the two digits of the
/// year begin again: ten years. With a larger difference, a clock was set.
const AROUND_2069_US: i64 = 10 * 366 * 86_400_000_000;

/// A place in a life where its clock was set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Step {
    /// Entries up to this sequence came before it.
    pub(crate) after: u64,
    /// Entries above this sequence came after it.
    pub(crate) before: u64,
    /// When, if a host knows.
    pub(crate) at: Option<(Boot, Bound<Host>)>,
    /// In UTC by the host's own clock, for the order of steps in one place.
    nominal_utc: i64,
    /// The observation that tells what it was set to.
    pub(crate) set: Option<usize>,
}

/// The runs of one life.
#[derive(Clone, Debug, Default)]
pub(crate) struct LifeRuns {
    /// By place.
    pub(crate) steps: Vec<Step>,
    /// By place: from here on, these runs are possible.
    spans: Vec<Span>,
}

#[derive(Clone, Copy, Debug)]
struct Span {
    /// The first sequence.
    first: u64,
    /// Index of the first possible run in this life, and of the last.
    runs: (usize, usize),
}

/// How a clock went from one stamp to the next.
pub(crate) fn went_back(earlier: Moment<Shown>, later: Moment<Shown>) -> bool {
    let straight = later.since(earlier);
    let around = straight - straight.signum() * CENTURY_US;
    let forward = if around.abs() <= AROUND_2069_US { around } else { straight };
    forward < 0
}

impl Step {
    pub(crate) fn of_set(observation: &ClockObservation, index: usize, at: Located) -> Step {
        let (host, nominal_utc) = match observation.at {
            Reference::Host { bound, reading } => (Some((reading.boot, bound)), reading.utc.us()),
            Reference::Utc(bound) => (None, bound.middle().map_or(0, Moment::us)),
        };
        let Located { after, before, .. } = at;
        Step { after, before, at: host, nominal_utc, set: Some(index) }
    }

    pub(crate) fn unconfirmed(step: &ClockStep, at: Located) -> Step {
        let Located { after, before, .. } = at;
        let moment = step.reading.monotonic;
        let host = Some((step.reading.boot, Bound::new(None, Some(moment))));
        Step { after, before, at: host, nominal_utc: step.reading.utc.us(), set: None }
    }
}

impl LifeRuns {
    /// From the steps that were told, and those that show in the stamps.
    pub(crate) fn new(life: &LifeHistory, mut steps: Vec<Step>) -> LifeRuns {
        for back in backward_steps(&life.entries) {
            let meets = |step: &Step| step.after <= back.before && step.before >= back.after;
            let told = steps.iter().filter(|step| meets(step)).count();
            match told {
                0 => steps.push(back),
                // It is this one, so its place is known better now.
                1 => {
                    for step in steps.iter_mut().filter(|step| meets(step)) {
                        step.after = step.after.max(back.after);
                        step.before = step.before.min(back.before);
                    }
                }
                // It is one of these. They are possible everywhere there anyway.
                _ => {}
            }
        }
        steps.sort_by_key(|step| (step.after, step.before, step.nominal_utc, step.set));
        let mut cuts: Vec<u64> = vec![0];
        cuts.extend(
            steps
                .iter()
                .flat_map(|step| [step.after.saturating_add(1), step.before.saturating_add(1)]),
        );
        cuts.sort_unstable();
        cuts.dedup();
        let span = |first: u64| Span { first, runs: possible_runs(&steps, first) };
        LifeRuns { spans: cuts.into_iter().map(span).collect(), steps }
    }

    /// How many runs there are.
    pub(crate) fn count(&self) -> usize {
        self.steps.len() + 1
    }

    /// In which runs the entry of this sequence may be: usually one.
    pub(crate) fn of(&self, sequence: u64) -> RangeInclusive<usize> {
        let next = self.spans.partition_point(|span| span.first <= sequence);
        let span = next.checked_sub(1).and_then(|place| self.spans.get(place));
        span.map_or(0..=0, |span| span.runs.0..=span.runs.1)
    }
}

/// Of a life with these steps, the runs in which an entry of this sequence may be.
fn possible_runs(steps: &[Step], sequence: u64) -> (usize, usize) {
    let first = steps.iter().rposition(|step| step.before < sequence).map_or(0, |step| step + 1);
    let last = steps.iter().position(|step| step.after >= sequence).unwrap_or(steps.len());
    (first.min(last), last.max(first))
}

/// Where the stamps go back, the clock was set.
fn backward_steps(entries: &[Held]) -> Vec<Step> {
    let mut steps = Vec::new();
    let mut previous: Option<(u64, Moment<Shown>)> = None;
    for held in entries {
        let Some(now) = shown(&held.entry.time) else { continue };
        if let Some((after, _)) = previous.filter(|&(_, earlier)| went_back(earlier, now)) {
            let before = held.sequence - 1;
            steps.push(Step { after, before, at: None, nominal_utc: i64::MIN, set: None });
        }
        previous = Some((held.sequence, now));
    }
    steps
}
