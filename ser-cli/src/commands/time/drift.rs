//! How fast a clock runs and how far it is ahead, from what was seen of it at several times.
//!
//! Each sight bounds how far the clock was ahead then. Between any two of them it gained no more than
//! the later one allows over the earlier one, and no less. The true rate is in what all pairs have in
//! common, and the true offset in what all sights allow by that rate.

/// How far a clock was ahead of this computer's monotonic one, some time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Sight {
    /// When, by that clock, in microseconds.
    pub(super) at_us: i64,
    /// At least so far, in microseconds.
    pub(super) least_us: i64,
    /// At most so far.
    pub(super) most_us: i64,
}

/// How much faster than this computer's a clock runs, in parts per billion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Rate {
    pub(super) least_ppb: i64,
    pub(super) most_ppb: i64,
    /// Between the first and the last sight.
    pub(super) over_us: i64,
}

/// Crystals do not differ by more.
const CRYSTAL: Rate = Rate { least_ppb: -200_000, most_ppb: 200_000, over_us: 0 };

const BILLION: i128 = 1_000_000_000;

/// Of more sights than this only so many are compared with each other.
const COMPARED: usize = 1000;

/// What the sights say of the rate; `None` from sights of one moment, or if no rate fits them all.
pub(super) fn rate(sights: &[Sight]) -> Option<Rate> {
    let step = sights.len().div_ceil(COMPARED).max(1);
    let compared: Vec<&Sight> = sights.iter().step_by(step).chain(sights.last()).collect();
    let first_us = sights.iter().map(|sight| sight.at_us).min()?;
    let over_us = sights.iter().map(|sight| sight.at_us).max()?.saturating_sub(first_us);
    let mut rate: Option<Rate> = None;
    for (place, one) in compared.iter().enumerate() {
        for other in compared.iter().skip(place + 1) {
            let (early, late) = if one.at_us <= other.at_us { (one, other) } else { (other, one) };
            let dx = late.at_us.saturating_sub(early.at_us);
            if dx == 0 {
                continue;
            }
            let least_ppb = per_billion(late.least_us.saturating_sub(early.most_us), dx) - 1;
            let most_ppb = per_billion(late.most_us.saturating_sub(early.least_us), dx) + 1;
            let pair = Rate { least_ppb, most_ppb, over_us };
            rate = Some(rate.map_or(pair, |rate| rate.and(pair)));
        }
    }
    rate.filter(|rate| rate.least_ppb <= rate.most_ppb)
}

/// How far the clock is ahead at a time, at least and at most. If the sights contradict each other,
/// what the last one says.
pub(super) fn ahead(sights: &[Sight], at_us: i64) -> Option<(i64, i64)> {
    let last = sights.last()?;
    let told = rate(sights).map_or(CRYSTAL, |rate| rate.and(CRYSTAL));
    let rate = if told.least_ppb <= told.most_ppb { told } else { rate(sights)? };
    let moved = |sight: &Sight| {
        let dx = at_us.saturating_sub(sight.at_us);
        let (one, other) = (parts(dx, rate.least_ppb), parts(dx, rate.most_ppb));
        let rounding = i64::from(dx != 0);
        (
            sight.least_us.saturating_add(one.min(other) - rounding),
            sight.most_us.saturating_add(one.max(other) + rounding),
        )
    };
    let mut common = moved(last);
    for (least, most) in sights.iter().map(moved) {
        common = (common.0.max(least), common.1.min(most));
    }
    Some(if common.0 <= common.1 { common } else { moved(last) })
}

impl Rate {
    /// What both allow.
    fn and(self, other: Rate) -> Rate {
        Rate {
            least_ppb: self.least_ppb.max(other.least_ppb),
            most_ppb: self.most_ppb.min(other.most_ppb),
            over_us: self.over_us.max(other.over_us),
        }
    }
}

/// Rounded towards zero.
fn per_billion(change_us: i64, over_us: i64) -> i64 {
    limited(i128::from(change_us) * BILLION / i128::from(over_us))
}

/// So many parts per billion, rounded towards zero.
fn parts(us: i64, ppb: i64) -> i64 {
    limited(i128::from(us) * i128::from(ppb) / BILLION)
}

/// Far from where sums of a few would overflow.
fn limited(value: i128) -> i64 {
    const LIMIT: i64 = i64::MAX / 8;
    i64::try_from(value).unwrap_or(if value < 0 { -LIMIT } else { LIMIT }).clamp(-LIMIT, LIMIT)
}

#[cfg(test)]
mod tests {
    use oorandom::Rand64;

    use super::*;

    #[test]
    fn the_true_rate_and_offset_are_in_what_the_sights_have_in_common() {
        let mut chance = Rand64::new(11);
        for _ in 0..1000 {
            let mut below = |limit: i64| chance.rand_range(0..limit.cast_unsigned()).cast_signed();
            let (offset, ppb) = (below(2_000_000) - 1_000_000, below(400_000) - 200_000);
            let ahead_at = |at_us: i64| offset + parts(at_us, ppb);
            let mut at_us = 0;
            let sights: Vec<Sight> = (0..2 + below(20))
                .map(|_| {
                    at_us += 1 + below(60_000_000);
                    let truth = ahead_at(at_us);
                    // Rounding of the truth itself.
                    let (least_us, most_us) = (truth - below(5000) - 1, truth + below(5000) + 1);
                    Sight { at_us, least_us, most_us }
                })
                .collect();
            let told = rate(&sights).expect("one that fits");
            assert!((told.least_ppb..=told.most_ppb).contains(&ppb), "{ppb} {told:?} {sights:?}");
            let now = at_us + below(10_000_000);
            let (least, most) = ahead(&sights, now).expect("known");
            assert!((least - 1..=most + 1).contains(&ahead_at(now)), "{least} {most}");
            let last = sights.last().expect("the last");
            assert!(now != at_us || most - least <= last.most_us - last.least_us);
        }
    }

    #[test]
    fn an_hour_tells_the_rate_that_a_second_does_not() {
        let sight = |at_us, least_us, most_us| Sight { at_us, least_us, most_us };
        let second = rate(&[sight(0, 0, 2000), sight(1_000_000, 0, 2000)]).expect("a rate");
        assert_eq!((second.least_ppb, second.most_ppb), (-2_000_001, 2_000_001));
        let hour = 3_600_000_000;
        let told = rate(&[sight(0, 0, 2000), sight(hour, 72_000, 74_000)]).expect("a rate");
        assert_eq!((told.least_ppb, told.most_ppb, told.over_us), (19_443, 20_556, hour));
        assert_eq!(rate(&[sight(5, 0, 2000)]), None);
    }

    #[test]
    fn sights_that_no_rate_fits_say_what_the_last_one_says() {
        let sight = |at_us, ahead_us| Sight { at_us, least_us: ahead_us, most_us: ahead_us + 10 };
        let sights = [sight(0, 0), sight(1_000_000, 900_000), sight(2_000_000, 0)];
        assert_eq!(rate(&sights), None);
        assert_eq!(ahead(&sights, 2_000_000), Some((0, 10)));
    }

    #[test]
    fn nothing_overflows() {
        let sight = |at_us, ahead_us| Sight { at_us, least_us: ahead_us, most_us: ahead_us };
        for sights in [
            [sight(i64::MIN, i64::MIN), sight(i64::MAX, i64::MAX)],
            [sight(0, i64::MAX), sight(1, i64::MIN)],
        ] {
            let _ = (rate(&sights), ahead(&sights, i64::MAX));
        }
    }
}
