//! Where everything goes in one list.
//!
//! What is proven about two entries may be proven on the clock of one host, in UTC, by a broadcast,
//! or by the sequence. A list that respects all of it needs one scale on which all of that holds at
//! once, even where nothing is known: there, clocks are taken to be right to a hundred years. On
//! this scale each clock gets the latest and the earliest it may be. Either respects everything
//! that is proven, and so does the middle.

use super::envelope::{Envelope, Known, NO_HI, NO_LO};
use super::hosts::Hosts;
use super::links::Link;
use super::offsets::{Home, Observed, RunClock, moved};
use crate::record::{Boot, Reference};

/// How wrong a clock may be of which nothing is known: a hundred years, in microseconds.
const ANYTHING_US: i64 = 100 * 366 * 86_400_000_000;

/// How often bounds are passed on at once. Each round passes them over one more link, so few are
/// enough unless ties contradict each other: then bounds go round in circles and grow for ever.
const MOST_ROUNDS: usize = 200;

/// The same for entries of doubtful runs, together with all that they set off.
const MOST_DOUBTFUL_ROUNDS: usize = 5 * MOST_ROUNDS;

/// All clocks on one scale: first those of the boots, then those of the runs.
#[derive(Debug, Default)]
pub(crate) struct Layout {
    boots: Vec<Boot>,
    clocks: Vec<Placed>,
}

/// A clock on the scale of the list.
#[derive(Clone, Debug)]
struct Placed {
    /// The instant on the scale, less what the clock showed.
    offset: Envelope,
    /// Whether nothing at all is known about it.
    is_timeless: bool,
    /// What was known before it got its place, if it got one because it had to have one.
    before: Option<Envelope>,
}

/// An instant on the scale of the list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Instant {
    /// Where it goes.
    pub(crate) at: i64,
    /// Between which instants it may go: there alone, unless its place is a guess.
    pub(crate) within: (i64, i64),
    /// Whether nothing is known about it but what the clock showed.
    pub(crate) is_timeless: bool,
}

/// The clock `one` showed `x` between `lo` and `hi` after the clock `other` showed `other_x`.
#[derive(Clone, Copy, Debug)]
struct Tie {
    one: usize,
    x: i64,
    other: usize,
    other_x: i64,
    lo: i64,
    hi: i64,
}

impl Tie {
    /// The same, seen from the other end.
    fn reversed(&self) -> Tie {
        Tie {
            one: self.other,
            x: self.other_x,
            other: self.one,
            other_x: self.x,
            lo: negated(self.hi),
            hi: negated(self.lo),
        }
    }
}

/// A run, and what its entries say about where it may be.
pub(crate) struct RunFacts<'m> {
    pub(crate) clock: &'m RunClock,
    pub(crate) observed: &'m [Observed],
    /// A stamp of it and what that is in UTC by what the site says about the clock.
    pub(crate) nominal: Option<(i64, i64)>,
    /// Any stamp of it.
    pub(crate) stamp: Option<i64>,
}

/// One entry comes before another one in a life. Each is given by the runs in which it may
/// be, and what the clock showed in each.
#[derive(Clone, Debug)]
pub(crate) struct Succession {
    pub(crate) earlier: Vec<(usize, i64)>,
    pub(crate) later: Vec<(usize, i64)>,
}

impl Layout {
    pub(crate) fn new(
        hosts: &Hosts,
        runs: &[RunFacts<'_>],
        links: &[Link],
        successions: &[Succession],
    ) -> Layout {
        let boots: Vec<Boot> = hosts.boots().collect();
        let of_boot = |boot: Boot| boots.binary_search(&boot).ok();
        let of_run = |run: usize| boots.len() + run;
        let mut clocks: Vec<Placed> =
            boots.iter().map(|&boot| placed(hosts.placed(boot, ANYTHING_US))).collect();
        let mut ties = Vec::new();
        for (run, facts) in runs.iter().enumerate() {
            clocks.push(placed(own_points(facts)));
            for home in facts.clock.homes() {
                let Home::Boot(name) = home else { continue };
                let Some(boot) = of_boot(name) else { continue };
                let points =
                    clocks.get(boot).into_iter().flat_map(|boot| boot.offset.telling_points());
                let then = points.filter_map(|monotonic| showed_at(facts.clock, home, monotonic));
                // What one host observed bounds what others did, so all have to do with all.
                let observed = facts.observed.iter().map(|observed| observed.shown);
                let mut moments: Vec<i64> = then.collect();
                moments.extend(observed.map(|shown| facts.clock.unwrapped(shown)));
                moments.sort_unstable();
                moments.dedup();
                for x in moments {
                    ties.extend(ties_at(facts.clock, home, x, (of_run(run), boot)));
                }
            }
        }
        ties.extend(links.iter().map(|link| Tie {
            one: of_run(link.one),
            x: link.x,
            other: of_run(link.other),
            other_x: link.other_x,
            lo: link.lo,
            hi: link.hi,
        }));
        for succession in successions {
            if let ([(run, x)], [(next, next_x)]) = (&succession.earlier[..], &succession.later[..])
            {
                let (one, other) = (of_run(*next), of_run(*run));
                ties.push(Tie { one, x: *next_x, other, other_x: *x, lo: 0, hi: NO_HI });
            }
        }
        let mut layout = Layout { boots, clocks };
        layout.settle(&mut ties);
        layout.heed_doubtful(successions, &mut ties);
        layout.place_the_rest(hosts, runs, &mut ties);
        layout
    }

    /// At which instant of the scale a run's clock showed `x`.
    pub(crate) fn instant(&self, run: usize, x: i64) -> Option<Instant> {
        let placed = self.clocks.get(self.boots.len() + run)?;
        let (lo, hi) = placed.offset.at(x);
        let is_placed = lo != NO_LO && hi != NO_HI;
        is_placed.then(|| Instant {
            at: lo.midpoint(hi).saturating_add(x),
            within: match &placed.before {
                Some(before) => moved(before.at(x), x),
                None => moved((lo.midpoint(hi), lo.midpoint(hi)), x),
            },
            is_timeless: placed.is_timeless,
        })
    }

    /// Passes bounds on over all ties until nothing changes. A tie that contradicts what is known is
    /// passed over; ties that still bring news after so many rounds go round in circles, and are
    /// dropped. That they contradict each other is told elsewhere. Returns the number of rounds.
    fn settle(&mut self, ties: &mut Vec<Tie>) -> usize {
        let mut rounds = 0;
        loop {
            rounds += 1;
            let is_last = rounds % MOST_ROUNDS == 0;
            let mut is_news = false;
            ties.retain(|tie| {
                let brings_news = self.pass_on(tie) | self.pass_on(&tie.reversed());
                is_news |= brings_news;
                !(brings_news && is_last)
            });
            if !is_news {
                return rounds;
            }
        }
    }

    fn pass_on(&mut self, tie: &Tie) -> bool {
        let Some(other) = self.clocks.get(tie.other) else { return false };
        let (lo, hi) = other.offset.at(tie.other_x);
        let add = |end: i64, by: i64, none: i64| match (end, by) {
            (NO_LO | NO_HI, _) | (_, NO_LO | NO_HI) => none,
            (end, by) => end.saturating_add(by).saturating_add(tie.other_x.saturating_sub(tie.x)),
        };
        let (lo, hi) = (add(lo, tie.lo, NO_LO), add(hi, tie.hi, NO_HI));
        if lo == NO_LO && hi == NO_HI {
            return false;
        }
        let one = self.clocks.get_mut(tie.one);
        one.and_then(|one| one.offset.learn(tie.x, lo, hi)).unwrap_or(false)
    }

    /// An entry that may be in any of several runs bounds its neighbours, too: by the earliest, or
    /// by the latest, that it may be. Returns the number of rounds.
    fn heed_doubtful(&mut self, successions: &[Succession], ties: &mut Vec<Tie>) -> usize {
        let mut rounds = 0;
        // Entries that contradict each other bring news for ever, so that has to have an end.
        while rounds < MOST_DOUBTFUL_ROUNDS {
            let mut is_news = false;
            for Succession { earlier, later } in successions {
                is_news |= match (&earlier[..], &later[..]) {
                    ([_], [_]) => false,
                    (several, [(run, x)]) => {
                        let (lo, _) = self.hull(several);
                        self.learn(*run, *x, (lo, NO_HI))
                    }
                    ([(run, x)], several) => {
                        let (_, hi) = self.hull(several);
                        self.learn(*run, *x, (NO_LO, hi))
                    }
                    _ => false,
                };
            }
            rounds += 1;
            if !is_news {
                break;
            }
            rounds += self.settle(ties);
        }
        rounds
    }

    /// The instants at which any of these runs showed what it did.
    fn hull(&self, several: &[(usize, i64)]) -> (i64, i64) {
        let each = several.iter().map(|&(run, x)| {
            let placed = self.clocks.get(self.boots.len() + run);
            placed.map_or((NO_LO, NO_HI), |placed| moved(placed.offset.at(x), x))
        });
        let hull = each.reduce(|one, other| (one.0.min(other.0), one.1.max(other.1)));
        hull.unwrap_or((NO_LO, NO_HI))
    }

    /// Adds that a run showed `x` between these instants. Returns whether that was news.
    fn learn(&mut self, run: usize, x: i64, bound: (i64, i64)) -> bool {
        let (lo, hi) = moved(bound, -x);
        let placed = self.clocks.get_mut(self.boots.len() + run);
        placed.and_then(|placed| placed.offset.learn(x, lo, hi)).unwrap_or(false)
    }

    /// Gives a place to clocks of which little is known. What a clock showed, or what the site says
    /// that it shows, is taken to be right as far as that can be; what is known on one side only is
    /// taken to be right there.
    fn place_the_rest(&mut self, hosts: &Hosts, runs: &[RunFacts<'_>], ties: &mut Vec<Tie>) {
        let boots = self.boots.clone();
        for (clock, boot) in boots.into_iter().enumerate() {
            if let Some((x, utc)) = hosts.nominal_only(boot) {
                self.place(clock, x, Some(utc), ties);
            }
        }
        // What a clock is said to show counts where it is not bounded on both sides, and comes
        // first.
        for (run, facts) in runs.iter().enumerate() {
            let clock = self.boots.len() + run;
            let Some((x, utc)) = facts.nominal else { continue };
            if facts.observed.is_empty() || !self.is_bounded(clock, x) {
                self.place(clock, x, Some(utc), ties);
            }
        }
        for (run, facts) in runs.iter().enumerate() {
            let Some(x) = facts.stamp else { continue };
            self.place(self.boots.len() + run, x, None, ties);
        }
    }

    fn is_bounded(&self, clock: usize, x: i64) -> bool {
        let at = self.clocks.get(clock).map_or((NO_LO, NO_HI), |placed| placed.offset.at(x));
        at.0 != NO_LO && at.1 != NO_HI
    }

    /// Gives a clock a place where it showed `x`, if it has none or is only said to have one.
    fn place(&mut self, clock: usize, x: i64, said: Option<i64>, ties: &mut Vec<Tie>) {
        let Some(placed) = self.clocks.get_mut(clock) else { return };
        let (lo, hi) = placed.offset.at(x);
        let at = match (said, lo, hi) {
            (Some(utc), lo, hi) if lo <= hi => utc.saturating_sub(x).clamp(lo, hi),
            (None, NO_LO, NO_HI) => {
                placed.is_timeless = true;
                0
            }
            (None, lo, NO_HI) => lo,
            (None, NO_LO, hi) => hi,
            _ => return,
        };
        placed.before = Some(placed.offset.clone());
        placed.offset.learn(x, at, at);
        self.settle(ties);
    }
}

fn placed(offset: Envelope) -> Placed {
    Placed { offset, is_timeless: false, before: None }
}

/// What a clock showed at a moment of a boot, as well as that is known.
fn showed_at(clock: &RunClock, home: Home, monotonic: i64) -> Option<i64> {
    let mut x = monotonic;
    for _ in 0..2 {
        let about = match clock.instant(home, x) {
            (NO_LO, NO_HI) => return None,
            (end, NO_HI) | (NO_LO, end) => end,
            (lo, hi) => lo.midpoint(hi),
        };
        x = x.saturating_add(monotonic.saturating_sub(about));
    }
    Some(x)
}

/// What is known of a run, by the clock of a boot, at the moment when it showed `x`.
fn ties_at(
    clock: &RunClock,
    home: Home,
    x: i64,
    (one, other): (usize, usize),
) -> impl Iterator<Item = Tie> {
    let (lo, hi) = clock.instant(home, x);
    let late = (lo != NO_LO).then_some(Tie { one, x, other, other_x: lo, lo: 0, hi: NO_HI });
    let early = (hi != NO_HI).then_some(Tie { one, x, other, other_x: hi, lo: NO_LO, hi: 0 });
    late.into_iter().chain(early)
}

fn negated(end: i64) -> i64 {
    match end {
        NO_LO => NO_HI,
        NO_HI => NO_LO,
        end => -end,
    }
}

/// What is known of a run without any other clock.
fn own_points(facts: &RunFacts<'_>) -> Envelope {
    let by_hand = facts.observed.iter().filter_map(|observed| {
        let Reference::Utc(bound) = observed.at else { return None };
        let x = facts.clock.unwrapped(observed.shown);
        let lo = bound.lo().map_or(NO_LO, |lo| lo.us() - x);
        let hi = bound.hi().map_or(NO_HI, |hi| hi.us() - x);
        Some(Known { x, lo, hi, id: observed.id })
    });
    let mut points: Vec<Known> = by_hand.collect();
    if facts.observed.is_empty() {
        points.extend(facts.nominal.map(|(x, utc)| {
            let offset = utc - x;
            Known { x, lo: offset - ANYTHING_US, hi: offset + ANYTHING_US, id: 0 }
        }));
    }
    Envelope::with_slope(points, facts.clock.slope())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock::envelope::Slope;

    /// Clocks that may be wrong by a hundred years.
    fn layout(clocks: usize) -> Layout {
        let known = Known { x: 0, lo: -ANYTHING_US, hi: ANYTHING_US, id: 0 };
        let clock = || placed(Envelope::with_slope(vec![known], Slope::within(0)));
        Layout { boots: Vec::new(), clocks: (0..clocks).map(|_| clock()).collect() }
    }

    /// The clock `one` showed 0 at least so long after the clock `other` did.
    fn later(one: usize, other: usize, us: i64) -> Tie {
        Tie { one, x: 0, other, other_x: 0, lo: us, hi: NO_HI }
    }

    fn earliest(layout: &Layout, clock: usize) -> i64 {
        layout.clocks[clock].offset.at(0).0
    }

    #[test]
    fn many_ties_that_contradict_each_other_come_to_an_end() {
        const PAIRS: usize = 300;
        let mut layout = layout(2 * PAIRS + 3);
        // Of each pair, either is later than the other one.
        let mut ties: Vec<Tie> = (0..PAIRS)
            .flat_map(|pair| {
                let (one, other) = (2 * pair, 2 * pair + 1);
                [later(one, other, 1000), later(other, one, 1000)]
            })
            .collect();
        // These three have nothing to do with them.
        let (first, second, third) = (2 * PAIRS, 2 * PAIRS + 1, 2 * PAIRS + 2);
        ties.extend([later(third, second, 70), later(second, first, 50)]);
        let rounds = layout.settle(&mut ties);
        assert!(rounds <= MOST_ROUNDS + 2, "{rounds}");
        assert_eq!(ties.len(), 2, "the others are dropped");
        assert_eq!(earliest(&layout, third), earliest(&layout, first) + 120);
        assert_eq!(layout.settle(&mut ties), 1, "nothing more is news");
    }

    #[test]
    fn doubtful_entries_that_contradict_ties_come_to_an_end() {
        let mut layout = layout(3);
        let mut ties = vec![later(0, 2, 1000), later(1, 2, 1000)];
        layout.settle(&mut ties);
        // An entry of clock 0 or 1 came before one of clock 2, which was earlier than both.
        let doubtful = Succession { earlier: vec![(0, 0), (1, 0)], later: vec![(2, 0)] };
        let rounds = layout.heed_doubtful(&[doubtful], &mut ties);
        assert!((MOST_DOUBTFUL_ROUNDS..MOST_DOUBTFUL_ROUNDS + 10).contains(&rounds), "{rounds}");
    }
}
