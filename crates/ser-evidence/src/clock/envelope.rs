//! What is known of a slowly changing value at any point, from what is known at some points.
//!
//! Two values of this kind matter here: the offset of a recorder's clock, which changes with the
//! drift, and the offset of a host's UTC clock from its monotonic one. Each piece of knowledge
//! becomes less certain with the distance from its point. All together, the truth lies in the
//! intersection.

/// Billion, for parts per billion.
const BILLION: i64 = 1_000_000_000;

/// Of how many of the narrowest points every pair is tried as the base of a learnt rate.
const BASE_POINTS: usize = 64;

/// No lower end.
pub(crate) const NO_LO: i64 = i64::MIN;

/// No upper end.
pub(crate) const NO_HI: i64 = i64::MAX;

/// The value at `x` lies in `[lo, hi]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Known {
    pub(crate) x: i64,
    pub(crate) lo: i64,
    pub(crate) hi: i64,
    /// Who says so.
    pub(crate) id: usize,
}

/// How much the value may change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Slope {
    /// Its change per unit of `x`, in parts per billion.
    rate_ppb: i64,
    /// How far its change may be from that, either way, in parts per billion.
    doubt_ppb: i64,
}

impl Slope {
    /// Between minus and plus this.
    pub(crate) const fn within(ppb: u32) -> Slope {
        Slope { rate_ppb: 0, doubt_ppb: ppb as i64 }
    }

    /// What two slopes have in common; `None` if that is nothing.
    pub(crate) fn intersection(self, other: Slope) -> Option<Slope> {
        let ends =
            |slope: Slope| (slope.rate_ppb - slope.doubt_ppb, slope.rate_ppb + slope.doubt_ppb);
        let ((lo, hi), (other_lo, other_hi)) = (ends(self), ends(other));
        let (lo, hi) = (lo.max(other_lo), hi.min(other_hi));
        let rate_ppb = lo.midpoint(hi);
        (lo <= hi).then(|| Slope { rate_ppb, doubt_ppb: (hi - rate_ppb).max(rate_ppb - lo) })
    }

    /// The same against a clock that itself gains or loses at most `ppb`.
    pub(crate) fn widened(self, ppb: u32) -> Slope {
        let ppb = i64::from(ppb);
        let of_each_other = parts(self.rate_ppb.saturating_abs() + self.doubt_ppb, ppb) + 1;
        Slope { doubt_ppb: self.doubt_ppb + ppb + of_each_other, ..self }
    }

    /// The least and the most that the value changes over `dx`, which may be negative.
    pub(crate) fn change(self, dx: i64) -> (i64, i64) {
        if dx == 0 {
            return (0, 0);
        }
        if self == (Slope { rate_ppb: 0, doubt_ppb: 0 }) {
            return (0, 0);
        }
        let growth = parts(dx.saturating_abs(), self.doubt_ppb).saturating_add(1);
        match self.rate_ppb {
            0 => (-growth, growth),
            rate => {
                let middle = parts(dx, rate);
                // Rounding the middle costs another microsecond.
                (middle - growth - 1, middle + growth + 1)
            }
        }
    }
}

/// `ppb` parts per billion of `dx`, rounded towards zero.
fn parts(dx: i64, ppb: i64) -> i64 {
    match dx.checked_mul(ppb) {
        Some(product) => product / BILLION,
        None => {
            let parts = i128::from(dx) * i128::from(ppb) / i128::from(BILLION);
            i64::try_from(parts).unwrap_or(i64::MAX)
        }
    }
}

/// What is known of the value everywhere.
#[derive(Clone, Debug)]
pub(crate) struct Envelope {
    /// By `x`; each as narrow as all others make it.
    points: Vec<Known>,
    slope: Slope,
}

impl Envelope {
    /// From what is known at some points. Returns also the pairs that contradict each other, by
    /// their ids: they were widened to what either of them allows.
    ///
    /// If the points are far apart, the rate between them is learnt. It stays as doubtful as the
    /// points make it, plus `wander_ppb`, by which the rate itself may change.
    pub(crate) fn new(
        mut points: Vec<Known>,
        drift_ppb: u32,
        wander_ppb: u32,
    ) -> (Envelope, Vec<(usize, usize)>) {
        points.sort_unstable();
        let wide = Slope::within(drift_ppb);
        let contradictions = widen_contradicting(&mut points, wide);
        let slope = learnt_slope(&points, drift_ppb, wander_ppb).unwrap_or(wide);
        let mut envelope = Envelope { points, slope };
        if !envelope.close() {
            // The rate is not as constant as its wander says.
            envelope.slope = wide;
            envelope.close();
        }
        (envelope, contradictions)
    }

    /// From what is known at some points, by a slope that is known already. Points that contradict
    /// each other are widened.
    pub(crate) fn with_slope(mut points: Vec<Known>, slope: Slope) -> Envelope {
        points.sort_unstable();
        widen_contradicting(&mut points, slope);
        let mut envelope = Envelope { points, slope };
        envelope.close();
        envelope
    }

    /// Whether the slope leaves something between any two points, without any widening.
    pub(crate) fn allows(&self, slope: Slope) -> bool {
        let mut points = self.points.clone();
        narrow(&mut points, slope);
        points.iter().all(|point| point.lo <= point.hi)
    }

    /// The same with a slope that leaves less room.
    pub(crate) fn narrowed(&self, slope: Slope) -> Envelope {
        Envelope::with_slope(self.points.clone(), slope)
    }

    /// Whether nothing is known anywhere.
    pub(crate) fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// How much the value may change.
    pub(crate) fn slope(&self) -> Slope {
        self.slope
    }

    /// Takes each end from its neighbours where that makes it narrower. False if a point was left
    /// without any value; then the points are unchanged.
    fn close(&mut self) -> bool {
        let mut points = self.points.clone();
        narrow(&mut points, self.slope);
        let is_consistent = points.iter().all(|point| point.lo <= point.hi);
        if is_consistent {
            self.points = points;
        }
        is_consistent
    }

    /// The points that say more than their neighbours do.
    pub(crate) fn telling_points(&self) -> impl Iterator<Item = i64> {
        let says_more = |(place, point): &(usize, &Known)| {
            let neighbours = [place.checked_sub(1), place.checked_add(1)].into_iter().flatten();
            let mut told = (NO_LO, NO_HI);
            for neighbour in neighbours.filter_map(|place| self.points.get(place)) {
                let (lo, hi) = grown(neighbour, self.slope.change(point.x - neighbour.x));
                told = (told.0.max(lo), told.1.min(hi));
            }
            told.0 < point.lo || told.1 > point.hi
        };
        self.points.iter().enumerate().filter(says_more).map(|(_, point)| point.x)
    }

    /// What is known at `x`: nothing is `(NO_LO, NO_HI)`.
    pub(crate) fn at(&self, x: i64) -> (i64, i64) {
        let next = self.points.partition_point(|point| point.x < x);
        let before = next.checked_sub(1).and_then(|previous| self.points.get(previous));
        let mut known = (NO_LO, NO_HI);
        for point in [before, self.points.get(next)].into_iter().flatten() {
            let (lo, hi) = grown(point, self.slope.change(x.saturating_sub(point.x)));
            known = (known.0.max(lo), known.1.min(hi));
        }
        known
    }

    /// Adds that the value at `x` lies in `[lo, hi]`. Returns whether that was news; `None` if it
    /// contradicts what is known, and then nothing changes.
    pub(crate) fn learn(&mut self, x: i64, lo: i64, hi: i64) -> Option<bool> {
        let (known_lo, known_hi) = self.at(x);
        if lo > known_hi || hi < known_lo {
            return None;
        }
        if lo <= known_lo && hi >= known_hi {
            return Some(false);
        }
        let before = self.points.clone();
        let place = self.points.partition_point(|point| point.x < x);
        match self.points.get_mut(place).filter(|point| point.x == x) {
            // Many pieces of news about one point are one piece of knowledge.
            Some(point) => (point.lo, point.hi) = (point.lo.max(lo), point.hi.min(hi)),
            None => self.points.insert(place, Known { x, lo, hi, id: usize::MAX }),
        }
        if self.close() {
            return Some(true);
        }
        self.points = before;
        None
    }
}

/// Everything between `least` and `most` after what is between `lo` and `hi`. An end that is not
/// known stays so.
pub(crate) fn added((lo, hi): (i64, i64), (least, most): (i64, i64)) -> (i64, i64) {
    let lo = if lo == NO_LO { NO_LO } else { lo.saturating_add(least) };
    let hi = if hi == NO_HI { NO_HI } else { hi.saturating_add(most) };
    (lo, hi)
}

/// A point's ends somewhere else, after a change between these two.
fn grown(point: &Known, change: (i64, i64)) -> (i64, i64) {
    added((point.lo, point.hi), change)
}

/// Afterwards each point knows all that the others know.
fn narrow(points: &mut [Known], slope: Slope) {
    both_ways(points, |told, point| {
        let (lo, hi) = grown(told, slope.change(point.x.saturating_sub(told.x)));
        (point.lo, point.hi) = (point.lo.max(lo), point.hi.min(hi));
    });
}

/// Tells each item what the one before it knows, and then, from the end, what the one after it
/// does: so each hears of all others.
pub(crate) fn both_ways<T: Copy>(items: &mut [T], mut tell: impl FnMut(&T, &mut T)) {
    let mut told: Option<T> = None;
    let mut take = |item: &mut T| {
        if let Some(told) = &told {
            tell(told, item);
        }
        told = Some(*item);
    };
    items.iter_mut().for_each(&mut take);
    items.iter_mut().rev().for_each(&mut take);
}

/// Whether two points cannot both be true.
fn contradict(one: &Known, other: &Known, slope: Slope) -> bool {
    let (lo, hi) = grown(one, slope.change(other.x.saturating_sub(one.x)));
    lo > other.hi || hi < other.lo
}

/// So many contradictions are told, of one clock; all of them count.
const TOLD: usize = 1000;

/// Widens every point that contradicts another one to the hull of all these, and returns the pairs.
/// If one of them is right, the truth is in each. Without a contradiction nothing changes.
fn widen_contradicting(points: &mut [Known], slope: Slope) -> Vec<(usize, usize)> {
    let mut narrowed = points.to_vec();
    narrow(&mut narrowed, slope);
    if narrowed.iter().all(|point| point.lo <= point.hi) {
        return Vec::new();
    }
    let mut pairs = Vec::new();
    let mut wrong = vec![false; points.len()];
    for (place, one) in points.iter().enumerate() {
        for (further, other) in points.iter().enumerate().skip(place + 1) {
            if contradict(one, other, slope) {
                pairs.push((one.id, other.id));
                for mark in [place, further] {
                    if let Some(wrong) = wrong.get_mut(mark) {
                        *wrong = true;
                    }
                }
            }
        }
        // A clock that was asked for months and set in secret contradicts itself a million times.
        pairs.truncate(TOLD);
    }
    let contradicting: Vec<Known> =
        points.iter().zip(&wrong).filter(|(_, wrong)| **wrong).map(|(point, _)| *point).collect();
    for point in points.iter_mut().zip(&wrong).filter(|(_, wrong)| **wrong).map(|(point, _)| point)
    {
        for other in &contradicting {
            let (lo, hi) = grown(other, slope.change(point.x.saturating_sub(other.x)));
            (point.lo, point.hi) = (point.lo.min(lo), point.hi.max(hi));
        }
    }
    pairs
}

/// The rate that two points far apart prove, if that is narrower than the drift allows.
fn learnt_slope(points: &[Known], drift_ppb: u32, wander_ppb: u32) -> Option<Slope> {
    let two_sided = |point: &&Known| point.lo != NO_LO && point.hi != NO_HI;
    let mut base: Vec<&Known> = points.iter().filter(two_sided).collect();
    base.sort_by_key(|point| (point.hi.saturating_sub(point.lo), point.x));
    base.truncate(BASE_POINTS);
    let drift = i64::from(drift_ppb);
    let mut best = Slope::within(drift_ppb);
    for (place, one) in base.iter().enumerate() {
        for other in base.iter().skip(place + 1) {
            let (early, late) = if one.x <= other.x { (one, other) } else { (other, one) };
            let dx = late.x.saturating_sub(early.x);
            if dx == 0 {
                continue;
            }
            let least = rate_ppb(late.lo.saturating_sub(early.hi), dx).max(-drift) - 1;
            let most = rate_ppb(late.hi.saturating_sub(early.lo), dx).min(drift) + 1;
            let doubt_ppb = (most - least + 1) / 2 + i64::from(wander_ppb);
            if least <= most && doubt_ppb < best.doubt_ppb {
                best = Slope { rate_ppb: least.midpoint(most), doubt_ppb };
            }
        }
    }
    (best != Slope::within(drift_ppb)).then_some(best)
}

/// `change` over `dx` in parts per billion, rounded towards zero.
fn rate_ppb(change: i64, dx: i64) -> i64 {
    let rate = i128::from(change) * i128::from(BILLION) / i128::from(dx);
    i64::try_from(rate).unwrap_or(if rate < 0 { i64::MIN / 2 } else { i64::MAX / 2 })
}

#[cfg(test)]
mod tests {
    use super::*;

    const PPM: u32 = 1000;

    fn known(x: i64, lo: i64, hi: i64, id: usize) -> Known {
        Known { x, lo, hi, id }
    }

    fn envelope(points: &[Known]) -> Envelope {
        let (envelope, contradictions) = Envelope::new(points.to_vec(), 50 * PPM, 50 * PPM);
        assert_eq!(contradictions, []);
        envelope
    }

    #[test]
    fn knowledge_ages_with_the_drift() {
        let envelope = envelope(&[known(0, -1000, 1000, 0)]);
        assert_eq!(envelope.at(0), (-1000, 1000));
        // 50 ppm of 20 s are 1 ms; rounding adds a microsecond.
        assert_eq!(envelope.at(20_000_000), (-2001, 2001));
        assert_eq!(envelope.at(-20_000_000), (-2001, 2001));
    }

    #[test]
    fn between_two_points_both_count() {
        let envelope = envelope(&[known(0, 0, 1000, 0), known(20_000_000, 500, 9000, 1)]);
        assert_eq!(envelope.at(20_000_000), (500, 2001));
        assert_eq!(envelope.at(0), (0, 1000));
    }

    #[test]
    fn a_missing_end_stays_missing_until_somebody_knows_it() {
        let late = envelope(&[known(0, NO_LO, 1000, 0)]);
        assert_eq!(late.at(0), (NO_LO, 1000));
        let both = envelope(&[known(0, NO_LO, 1000, 0), known(0, 200, NO_HI, 1)]);
        assert_eq!(both.at(0), (200, 1000));
        assert_eq!(envelope(&[]).at(5), (NO_LO, NO_HI));
    }

    #[test]
    fn points_that_contradict_each_other_are_told_and_their_hull_is_used() {
        let points = [known(0, 0, 10, 0), known(0, 500, 510, 1), known(0, -9, 600, 2)];
        let (envelope, contradictions) = Envelope::new(points.to_vec(), 50 * PPM, 5 * PPM);
        assert_eq!(contradictions, [(0, 1)]);
        assert_eq!(envelope.at(0), (0, 510));
    }

    #[test]
    fn of_a_million_contradictions_some_are_told_and_all_count() {
        let of = |at: i64, lo: i64| known(at, lo, lo + 10, usize::try_from(at).unwrap());
        let before = (0..1200).map(|at| of(at, 0));
        let after = (1200..2400).map(|at| of(at, 500));
        let points: Vec<Known> = before.chain(after).collect();
        let (envelope, contradictions) = Envelope::new(points, 50 * PPM, 5 * PPM);
        assert_eq!(contradictions.len(), TOLD);
        // Rounding costs a microsecond.
        assert_eq!((envelope.at(0), envelope.at(2399)), ((-1, 511), (-1, 511)));
    }

    #[test]
    fn a_rate_is_learnt_from_points_far_apart() {
        let hour = 3_600_000_000;
        // 20 ppm fast: 72 ms an hour, each known to 1 ms.
        let points = [known(0, 0, 1000, 0), known(hour, 72_000, 73_000, 1)];
        let (envelope, _) = Envelope::new(points.to_vec(), 50 * PPM, 5 * PPM);
        let (lo, hi) = envelope.at(2 * hour);
        assert!(lo < 144_000 && 145_000 < hi, "{lo} {hi}");
        // Without the rate, 50 ppm of an hour would be 180 ms on either side.
        assert!(hi - lo < 2 * 20_000, "{lo} {hi}");
    }

    #[test]
    fn what_contradicts_is_not_learnt() {
        let mut envelope = envelope(&[known(0, 0, 1000, 0)]);
        assert_eq!(envelope.learn(0, 5000, 6000), None);
        assert_eq!(envelope.learn(0, -5, 1005), Some(false));
        assert_eq!(envelope.learn(0, 300, 1005), Some(true));
        assert_eq!(envelope.at(0), (300, 1000));
    }

    #[test]
    fn much_news_about_one_point_stays_one_point() {
        let mut envelope = envelope(&[known(0, 0, 1000, 0)]);
        for lo in 1..1000 {
            assert_eq!(envelope.learn(5_000_000, lo, NO_HI), Some(true), "{lo}");
        }
        assert_eq!(envelope.points.len(), 2);
        assert_eq!(envelope.at(5_000_000), (999, 1251));
    }
}
