//! What recorders know about each other's clocks.
//!
//! All recorders that hear a broadcast hear it at one instant, however long it was under way. Two
//! recorders that watch one contact see it move once. Either bounds the difference of two clocks,
//! whatever is unknown about both.

use std::collections::BTreeMap;

use super::envelope::{added, both_ways};
use super::offsets::{Home, RunClock};

/// How often bounds are passed on over all links. Each round passes them one link further.
const MOST_ROUNDS: usize = 1000;

/// The clock of run `one` began to show `x` between `lo` and `hi` microseconds after that of run
/// `other` began to show `other_x`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Link {
    pub(crate) one: usize,
    pub(crate) other: usize,
    pub(crate) x: i64,
    pub(crate) other_x: i64,
    pub(crate) lo: i64,
    pub(crate) hi: i64,
    /// Who says so.
    pub(crate) why: LinkReason,
}

/// Why two clocks are linked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum LinkReason {
    /// Both recorders received this broadcast.
    Broadcast(u64),
    /// Both saw the contact of these points move, by their indices in the site.
    Contact(usize, usize),
}

/// All links, from either end.
#[derive(Debug, Default)]
pub(crate) struct Links {
    by_pair: BTreeMap<(usize, usize), Vec<Link>>,
}

impl Link {
    /// The same, seen from the other end.
    fn reversed(self) -> Link {
        Link {
            one: self.other,
            other: self.one,
            x: self.other_x,
            other_x: self.x,
            lo: -self.hi,
            hi: -self.lo,
            why: self.why,
        }
    }
}

impl Links {
    pub(crate) fn new(links: &[Link], runs: &[RunClock]) -> Links {
        let mut by_pair: BTreeMap<(usize, usize), Vec<Link>> = BTreeMap::new();
        for &link in links {
            for link in [link, link.reversed()] {
                by_pair.entry((link.one, link.other)).or_default().push(link);
            }
        }
        for (&(one, other), links) in &mut by_pair {
            links.sort_by_key(|link| (link.x, *link));
            if let (Some(one), Some(other)) = (runs.get(one), runs.get(other)) {
                narrow(links, one, other);
            }
        }
        Links { by_pair }
    }

    /// Whether there is none.
    pub(crate) fn is_empty(&self) -> bool {
        self.by_pair.is_empty()
    }

    /// How long after run `other` began to show `other_x` run `one` began to show `x`, by the links
    /// that are nearest to either. It is the same both ways.
    pub(crate) fn difference(
        &self,
        runs: &[RunClock],
        one: (usize, i64),
        other: (usize, i64),
    ) -> Option<(i64, i64)> {
        let (lo, hi) = self.by_nearest_to_first(runs, one, other)?;
        // Which links are nearest to one is not always which are nearest to the other.
        let (back_lo, back_hi) = self.by_nearest_to_first(runs, other, one)?;
        Some((lo.max(back_hi.saturating_neg()), hi.min(back_lo.saturating_neg())))
    }

    fn by_nearest_to_first(
        &self,
        runs: &[RunClock],
        (one, x): (usize, i64),
        (other, other_x): (usize, i64),
    ) -> Option<(i64, i64)> {
        let links = self.by_pair.get(&(one, other))?;
        let (clock, other_clock) = (runs.get(one)?, runs.get(other)?);
        let next = links.partition_point(|link| link.x < x);
        let previous = next.checked_sub(1).and_then(|previous| links.get(previous));
        let mut known: Option<(i64, i64)> = None;
        for link in [previous, links.get(next)].into_iter().flatten() {
            let (least, most) = clock.elapsed(x.saturating_sub(link.x));
            let (other_least, other_most) =
                other_clock.elapsed(link.other_x.saturating_sub(other_x));
            let lo = least.saturating_add(link.lo).saturating_add(other_least);
            let hi = most.saturating_add(link.hi).saturating_add(other_most);
            known = Some(known.map_or((lo, hi), |known| (known.0.max(lo), known.1.min(hi))));
        }
        known
    }
}

/// Afterwards each link of a pair knows what the others know.
fn narrow(links: &mut [Link], one: &RunClock, other: &RunClock) {
    both_ways(links, |told, link| {
        let (least, most) = one.elapsed(link.x - told.x);
        let (other_least, other_most) = other.elapsed(link.other_x - told.other_x);
        let lo = told.lo.saturating_add(least).saturating_sub(other_most);
        let hi = told.hi.saturating_add(most).saturating_sub(other_least);
        // What contradicts is told elsewhere, and says nothing here.
        if lo <= link.hi && link.lo <= hi {
            (link.lo, link.hi) = (link.lo.max(lo), link.hi.min(hi));
        }
    });
}

/// Lets the clocks bound each other until nothing changes any more. Links that contradict what is
/// known otherwise are left out and returned. Each new start has fewer links than the one before,
/// so there is an end, whatever they say.
pub(crate) fn tighten(runs: &mut Vec<RunClock>, links: &mut Vec<Link>) -> Vec<Link> {
    links.sort_unstable();
    links.dedup();
    let untouched = runs.clone();
    let mut wrong = Vec::new();
    loop {
        let (contradicting, possible) = pass_on(runs, links);
        *links = possible;
        if contradicting.is_empty() {
            return wrong;
        }
        wrong.extend(contradicting);
        runs.clone_from(&untouched);
    }
}

/// Passes bounds on over all links, up to the first round in which some cannot be. Those come
/// first, the others second.
fn pass_on(runs: &mut [RunClock], links: &[Link]) -> (Vec<Link>, Vec<Link>) {
    for _ in 0..MOST_ROUNDS {
        let mut is_news = false;
        let mut is_possible = |link: &Link| {
            let news = pass_on_over(runs, *link);
            is_news |= news == Some(true);
            news.is_some()
        };
        let (possible, contradicting): (Vec<Link>, Vec<Link>) =
            links.iter().partition(|link| is_possible(link));
        if !contradicting.is_empty() || !is_news {
            return (contradicting, possible);
        }
    }
    (Vec::new(), links.to_vec())
}

/// Passes bounds on over one link, both ways. Returns whether that was news; `None` if what one
/// clock knows cannot be by what the other one does.
fn pass_on_over(runs: &mut [RunClock], link: Link) -> Option<bool> {
    let mut is_news = false;
    for home in common_homes(runs, &link) {
        for link in [link, link.reversed()] {
            let Some(other) = runs.get(link.other) else { continue };
            let known = added(other.instant(home, link.other_x), (link.lo, link.hi));
            let Some(one) = runs.get_mut(link.one) else { continue };
            is_news |= one.learn(home, link.x, known)?;
        }
    }
    Some(is_news)
}

fn common_homes(runs: &[RunClock], link: &Link) -> Vec<Home> {
    let (Some(one), Some(other)) = (runs.get(link.one), runs.get(link.other)) else {
        return Vec::new();
    };
    one.homes().filter(|home| other.homes().any(|other| other == *home)).collect()
}
