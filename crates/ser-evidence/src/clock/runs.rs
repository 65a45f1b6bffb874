//! Where a recorder's clock was set, and the runs between.
//!
//! A run is what the clock shows from one step on. Where exactly a step was among the entries, and
//! in which order two steps were, is not always known. So an entry has a set of runs in which it
//! may be, usually of one.

use super::local::is_unset;
use super::when::{When, is_earlier};
use crate::history::{Held, LifeHistory};
use crate::record::Boot;
use crate::time::{AROUND_2069_US, Bound, CENTURY_US, Host, Moment, Shown, Utc, shown};

/// A place in a life where its clock was set, or may have been.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Step {
    /// Entries up to this sequence came before it.
    pub(crate) after: u64,
    /// Entries above this sequence came after it.
    pub(crate) before: u64,
    /// Whether it was in this life at all.
    pub(crate) is_sure: bool,
    /// When, on the clock of the host that knows.
    pub(crate) at: Option<(Boot, Bound<Host>)>,
    /// When, in UTC.
    pub(crate) utc: Bound<Utc>,
    /// What it was set to, and the index of the observation that says so.
    pub(crate) set: Option<(usize, Moment<Shown>)>,
    /// The index of an observation that is known to have been before it.
    pub(crate) follows: Option<usize>,
    /// Whether somebody told of it. Otherwise only stamps around it do.
    pub(crate) is_told: bool,
}

/// The runs of one life: run 0 is from its beginning to the first step, run *n* + 1 from step *n*
/// to the next. A command that sets the clock may arrive twice, so each step has one more run,
/// between its arrivals.
#[derive(Clone, Debug, Default)]
pub(crate) struct LifeRuns {
    /// In an order that depends on nothing but their content.
    pub(crate) steps: Vec<Step>,
    /// By place: from this sequence on, these runs are possible.
    spans: Vec<(u64, Vec<usize>)>,
}

/// Whether a clock was set back between two stamps.
pub(crate) fn went_back(earlier: Moment<Shown>, later: Moment<Shown>) -> bool {
    let straight = later.since(earlier);
    let around = straight - straight.signum() * CENTURY_US;
    let forward = if around.abs() <= AROUND_2069_US { around } else { straight };
    forward < 0
}

impl Step {
    /// Somebody told of it; nobody knows where it was, or whether it was in this life.
    pub(crate) const ANYWHERE: Step = Step {
        after: 0,
        before: u64::MAX,
        is_sure: false,
        at: None,
        utc: Bound::UNKNOWN,
        set: None,
        follows: None,
        is_told: true,
    };

    /// Nobody told of it, but stamps show that it was in this life.
    pub(crate) const SILENT: Step = Step { is_sure: true, is_told: false, ..Step::ANYWHERE };

    /// Whether this step is known to have been before another one.
    pub(crate) fn precedes(&self, other: &Step) -> bool {
        let is_what_it_follows = self.set.is_some_and(|(index, _)| other.follows == Some(index));
        is_what_it_follows || self.before < other.after || is_earlier(self.when(), other.when())
    }

    /// Whether this may be another step, after which the clock showed `shows`: it never shows less
    /// than what it was set to.
    pub(crate) fn explains(&self, other: &Step, shows: Moment<Shown>) -> bool {
        let meets = self.after <= other.before && self.before >= other.after;
        self.is_sure && meets && may_show(Some(self), shows)
    }

    /// Whether nobody told of it, and only the stamps around it do.
    pub(crate) fn is_silent(&self) -> bool {
        self.is_sure && !self.is_told
    }

    /// When it was, on all scales.
    pub(crate) fn when(&self) -> When {
        (self.at, self.utc)
    }
}

impl LifeRuns {
    /// From the steps that were told, and those that show in the stamps.
    pub(crate) fn new(life: &LifeHistory, mut steps: Vec<Step>) -> LifeRuns {
        for (back, shows) in backward_steps(&life.entries) {
            // It is one of those that were told, or one of the arrivals of one.
            if !steps.iter().any(|step| step.explains(&back, shows)) {
                steps.push(back);
            }
        }
        let key = |step: &Step| {
            let ends = |bound: Bound<Utc>| (bound.lo().map(Moment::us), bound.hi().map(Moment::us));
            (step.after, step.before, ends(step.utc), step.set.map(|(index, _)| index))
        };
        steps.sort_by_key(key);
        let mut cuts: Vec<u64> = vec![0];
        cuts.extend(
            steps
                .iter()
                .flat_map(|step| [step.after.saturating_add(1), step.before.saturating_add(1)]),
        );
        cuts.sort_unstable();
        cuts.dedup();
        let mut runs = LifeRuns { steps, spans: Vec::new() };
        runs.spans = cuts.into_iter().map(|first| (first, runs.possible_at(first))).collect();
        runs
    }

    /// How many runs there are, those between two arrivals included.
    pub(crate) fn count(&self) -> usize {
        2 * self.steps.len() + 1
    }

    /// The run between two arrivals of the command of this step.
    pub(crate) fn between_arrivals(&self, step: usize) -> usize {
        self.steps.len() + 1 + step
    }

    /// In which runs the entry with this sequence and stamp may be.
    pub(crate) fn of(&self, sequence: u64, stamp: Option<Moment<Shown>>) -> Possible<'_> {
        let next = self.spans.partition_point(|(first, _)| *first <= sequence);
        let span = next.checked_sub(1).and_then(|place| self.spans.get(place));
        let runs = span.map_or(&[][..], |(_, runs)| runs.as_slice());
        Possible { runs, stamp, steps: &self.steps }
    }

    /// In which runs something may be that came after some steps and before others: each step is on
    /// one side of it for sure, or on neither.
    pub(crate) fn possible(&self, side: &dyn Fn(usize, &Step) -> Option<Side>) -> Vec<usize> {
        let sides: Vec<Option<Side>> =
            self.steps.iter().enumerate().map(|(index, step)| side(index, step)).collect();
        let passed = |place: usize| sides.get(place) == Some(&Some(Side::Before));
        let sure_and_passed: Vec<&Step> = self
            .steps
            .iter()
            .enumerate()
            .filter(|(place, step)| step.is_sure && passed(*place))
            .map(|(_, step)| step)
            .collect();
        // Most steps are long before this one, so it is asked first.
        let latest = sure_and_passed.iter().max_by_key(|step| step.after).copied();
        let is_over = |step: &Step| {
            latest.is_some_and(|latest| step.precedes(latest))
                || sure_and_passed.iter().any(|later| step.precedes(later))
        };
        let mut runs = Vec::new();
        if sure_and_passed.is_empty() {
            runs.push(0);
        }
        for (place, step) in self.steps.iter().enumerate() {
            let side = sides.get(place).copied().flatten();
            if side == Some(Side::After) || is_over(step) {
                continue;
            }
            runs.push(place + 1);
            if side.is_none() {
                runs.push(self.between_arrivals(place));
            }
        }
        runs
    }

    fn possible_at(&self, sequence: u64) -> Vec<usize> {
        self.possible(&|_, step| match () {
            () if step.after >= sequence => Some(Side::After),
            () if step.before < sequence => Some(Side::Before),
            () => None,
        })
    }

    /// The runs in which the clock may be at the end of the life.
    pub(crate) fn at_end(&self) -> &[usize] {
        self.spans.last().map_or(&[], |(_, runs)| runs.as_slice())
    }

    /// The step that begins a run.
    fn step_of(&self, run: usize) -> Option<&Step> {
        step_of(&self.steps, run)
    }

    /// Whether a clock in this run may show this.
    pub(crate) fn may_show(&self, run: usize, stamp: Moment<Shown>) -> bool {
        may_show(self.step_of(run), stamp)
    }
}

/// On which side of something a step was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    /// The step came first.
    Before,
    /// The step came later.
    After,
}

/// The runs in which an entry may be.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Possible<'r> {
    runs: &'r [usize],
    stamp: Option<Moment<Shown>>,
    steps: &'r [Step],
}

impl<'r> Possible<'r> {
    /// Whether it depends on the place alone which runs these are.
    pub(crate) fn is_one_by_place(&self) -> bool {
        self.runs.len() <= 1
    }

    /// The runs by place alone.
    pub(crate) fn by_place(&self) -> &'r [usize] {
        self.runs
    }

    /// All of them. A clock never shows less than what it was set to, so the stamp excludes some.
    pub(crate) fn runs(self) -> impl Iterator<Item = usize> {
        let fits = move |run: &usize| {
            let step = step_of(self.steps, *run);
            self.stamp.is_none_or(|stamp| may_show(step, stamp))
        };
        let any = self.runs.iter().any(fits);
        // If none fits, something is wrong, and nothing is excluded.
        self.runs.iter().copied().filter(move |run| !any || fits(run))
    }

    /// The only one, if it is only one.
    pub(crate) fn only(self) -> Option<usize> {
        let mut runs = self.runs();
        let first = runs.next()?;
        runs.next().is_none().then_some(first)
    }
}

/// The step that begins a run, or between whose arrivals it is.
fn step_of(steps: &[Step], run: usize) -> Option<&Step> {
    let place = run.checked_sub(1)?;
    steps.get(if place < steps.len() { place } else { place - steps.len() })
}

fn may_show(step: Option<&Step>, stamp: Moment<Shown>) -> bool {
    let set_to = step.and_then(|step| step.set).map(|(_, set_to)| set_to);
    set_to.is_none_or(|set_to| !went_back(set_to, stamp))
}

/// Whether a clock was set between two stamps: it went back, or it had never been set before.
pub(crate) fn was_set(earlier: Moment<Shown>, later: Moment<Shown>) -> bool {
    went_back(earlier, later) || (is_unset(earlier) && !is_unset(later))
}

/// Where the stamps tell it, the clock was set, and what it showed then.
pub(crate) fn backward_steps(entries: &[Held]) -> Vec<(Step, Moment<Shown>)> {
    let mut steps = Vec::new();
    let mut previous: Option<(u64, Moment<Shown>)> = None;
    for held in entries {
        let Some(now) = shown(&held.entry.time) else { continue };
        if let Some((after, _)) = previous.filter(|&(_, earlier)| was_set(earlier, now)) {
            let step = Step { after, before: held.sequence - 1, ..Step::SILENT };
            steps.push((step, now));
        }
        previous = Some((held.sequence, now));
    }
    steps
}
