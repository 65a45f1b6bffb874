//! Changes that a recorder left out of its log, because an input chattered.

use std::collections::BTreeMap;

use super::HostReading;
use crate::time::Moment;

/// How wrong a recorder may be about how long it has been on: one part in so many.
const TICK_TOLERANCE: u64 = 1000;

/// How much the clocks of two boots of a host may disagree. A recorder that was switched on so much
/// earlier or later than another one is not taken for it.
const BOOTS_APART_US: u64 = 60_000_000;

/// What a recorder had counted when it was looked at.
///
/// It counts from its power-up on, whatever becomes of its log meanwhile, and nobody can reset that.
/// So two looks tell by their difference how many changes were left out between them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Suppressed {
    /// When the look began.
    pub from: HostReading,
    /// When it had ended: the counts are those of a moment in between.
    pub to: HostReading,
    /// How long the recorder had been on when the look began, by its own clock, in microseconds.
    pub on_for_us: u64,
    /// How many changes had been left out of each input, 1 to 32. Inputs without one need not be
    /// there.
    pub left_out: BTreeMap<u8, u32>,
}

impl Suppressed {
    /// The last input that there can be.
    pub const LAST_INPUT: u8 = 32;

    /// Whether the recorder was on from an earlier look to this one for sure, and is the same one.
    /// Otherwise it may have begun to count anew in between. One that was put in its place has been
    /// on for another time.
    #[must_use]
    pub fn continues(&self, earlier: &Suppressed) -> bool {
        let is_less =
            |(input, count): (&u8, &u32)| self.left_out.get(input).is_none_or(|now| now < count);
        let is_one_boot = earlier.to.boot == self.to.boot;
        let between = |one: &HostReading, other: &HostReading| match is_one_boot {
            true => other.monotonic.since(one.monotonic),
            false => other.utc.since(one.utc),
        };
        // The counts and the time are of some moment of each look.
        let least = u64::try_from(between(&earlier.to, &self.from));
        let (Ok(least), Ok(most)) = (least, u64::try_from(between(&earlier.from, &self.to))) else {
            return false;
        };
        let tolerance = most / TICK_TOLERANCE + if is_one_boot { 0 } else { BOOTS_APART_US };
        let more_us = self.on_for_us.checked_sub(earlier.on_for_us);
        let is_on_since = more_us.is_some_and(|more| {
            (least.saturating_sub(tolerance)..=most.saturating_add(tolerance)).contains(&more)
        });
        is_on_since && !earlier.left_out.iter().filter(|(_, count)| **count > 0).any(is_less)
    }

    /// How many changes were left out since an earlier look, of inputs with any; since the power-up
    /// if that may have been in between, or there is no earlier look.
    #[must_use]
    pub fn since(&self, earlier: Option<&Suppressed>) -> BTreeMap<u8, u32> {
        let earlier = earlier.filter(|earlier| self.continues(earlier));
        let before = |input| earlier.and_then(|earlier| earlier.left_out.get(input)).copied();
        let more = self
            .left_out
            .iter()
            .map(|(input, count)| (*input, count.saturating_sub(before(input).unwrap_or(0))));
        more.filter(|(_, more)| *more > 0).collect()
    }

    /// When the recorder was switched on, by this look; rather too early than too late.
    #[must_use]
    pub fn switched_on(&self) -> HostReading {
        let on_for_us = self.on_for_us.saturating_add(self.on_for_us / TICK_TOLERANCE);
        let on_for_us = i64::try_from(on_for_us).unwrap_or(i64::MAX);
        let HostReading { monotonic, utc, .. } = self.from;
        let before = |us: i64| us.saturating_sub(on_for_us);
        HostReading {
            monotonic: Moment::from_us(before(monotonic.us())),
            utc: Moment::from_us(before(utc.us())),
            ..self.from
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Boot;

    fn look(at_s: i64, on_for_s: u64, counts: &[(u8, u32)]) -> Suppressed {
        let at = HostReading {
            boot: Boot(1),
            monotonic: Moment::from_us(at_s * 1_000_000),
            utc: Moment::from_us(at_s * 1_000_000),
            utc_doubt_us: None,
        };
        let left_out = counts.iter().copied().collect();
        Suppressed { from: at, to: at, on_for_us: on_for_s * 1_000_000, left_out }
    }

    fn since(earlier: &Suppressed, now: &Suppressed) -> Vec<(u8, u32)> {
        now.since(Some(earlier)).into_iter().collect()
    }

    #[test]
    fn two_looks_are_subtracted_if_the_recorder_was_on_in_between() {
        let earlier = look(1000, 500, &[(3, 7), (4, 1)]);
        assert_eq!(since(&earlier, &look(1100, 600, &[(3, 9), (4, 1), (5, 2)])), [(3, 2), (5, 2)]);
        assert_eq!(since(&earlier, &look(1100, 600, &[(3, 7), (4, 1)])), []);
        assert_eq!(look(1000, 500, &[(3, 7), (4, 0)]).since(None).len(), 1);
    }

    #[test]
    fn after_a_power_up_everything_is_new() {
        let earlier = look(1000, 500, &[(3, 7)]);
        assert_eq!(since(&earlier, &look(1100, 99, &[(3, 9)])), [(3, 9)], "on for too short");
        assert_eq!(since(&earlier, &look(1100, 600, &[(3, 6)])), [(3, 6)], "a counter went back");
        assert_eq!(since(&earlier, &look(1100, 600, &[(4, 1)])), [(4, 1)]);
        assert_eq!(since(&earlier, &look(1100, 900, &[(3, 9)])), [(3, 9)], "another recorder");
        // An earlier look that was later is none.
        assert_eq!(since(&earlier, &look(900, 600, &[(3, 9)])), [(3, 9)]);
    }

    #[test]
    fn the_power_up_is_rather_too_early_than_too_late() {
        assert_eq!(look(5000, 1000, &[]).switched_on().monotonic.us(), 3_999_000_000);
        let longest = Suppressed { on_for_us: u64::MAX, ..look(0, 0, &[]) };
        assert!(longest.switched_on().utc.us() < 0);
    }
}
