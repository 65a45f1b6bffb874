//! Hosts: a monotonic clock from a boot on, and a clock that shows UTC, more or less.

use ser_evidence::record::{Boot, HostReading};
use ser_evidence::time::{Bound, Host, Moment};

use crate::chance::Chance;
use crate::true_time::{Ps, US, ceil_us, floor_us};

/// One boot of a host.
pub(crate) struct TrueHost {
    pub(crate) boot: Boot,
    /// What its monotonic clock shows when the world begins; may be negative.
    zero_us: i64,
    /// UTC when the world begins.
    start_utc_us: i64,
    /// How far its UTC clock is ahead of UTC.
    error_us: i64,
    /// How much further it may be at each reading, either way.
    unrest_us: i64,
    /// What the operating system says of that.
    told_doubt_us: Option<u64>,
    /// How fast its monotonic clock gains, in parts per billion.
    gains_ppb: i64,
}

impl TrueHost {
    /// A host whose clock is honest: off by no more than it says, or than the site says if it does
    /// not know. Its monotonic clock gains or loses no more than `most_ppb`.
    pub(crate) fn draw(
        start_utc_us: i64,
        site_doubt_us: Option<u64>,
        most_ppb: i64,
        chance: &mut Chance,
    ) -> TrueHost {
        let told_doubt_us = match chance.below(4) {
            0 => None,
            1 => Some(u64::try_from(chance.between(1, 2000)).expect("positive")),
            _ => Some(u64::try_from(chance.between(2000, 100_000)).expect("positive")),
        };
        // One microsecond is for the rounding of a reading.
        let most = match (told_doubt_us, site_doubt_us) {
            (Some(doubt), _) | (None, Some(doubt)) => i64::try_from(doubt).expect("small") - 1,
            (None, None) => 7_200_000_000,
        };
        let unrest_us = if chance.one_in(2) { chance.between(0, most / 2) } else { 0 };
        let room = most - unrest_us;
        let error_us =
            if chance.one_in(3) { chance.of(&[-room, room]) } else { chance.between(-room, room) };
        let zero_us = chance.between(0, 100_000_000_000);
        let boot = Boot(u128::from(chance.bits()));
        let gains_ppb = chance.of(&[-most_ppb, 0, most_ppb]);
        TrueHost { boot, zero_us, start_utc_us, error_us, unrest_us, told_doubt_us, gains_ppb }
    }

    /// Both clocks, read at this instant.
    pub(crate) fn reading(&self, at: Ps, chance: &mut Chance) -> HostReading {
        let unrest = chance.between(-self.unrest_us, self.unrest_us);
        HostReading {
            boot: self.boot,
            monotonic: Moment::from_us(self.monotonic_us(at)),
            utc: Moment::from_us(self.start_utc_us + floor_us(at) + self.error_us + unrest),
            utc_doubt_us: self.told_doubt_us,
        }
    }

    /// What its monotonic clock shows.
    pub(crate) fn monotonic_us(&self, at: Ps) -> i64 {
        self.zero_us + floor_us(self.counted(at))
    }

    /// What its monotonic clock has counted since the world began.
    fn counted(&self, at: Ps) -> Ps {
        let gained = (i128::from(at) * i128::from(self.gains_ppb)).div_euclid(1_000_000_000);
        at + Ps::try_from(gained).expect("little")
    }

    /// From one instant to another by its monotonic clock, rounded outwards.
    pub(crate) fn bound(&self, from: Ps, to: Ps) -> Bound<Host> {
        let (from, to) = (self.counted(from), self.counted(to));
        Bound::from_us(self.zero_us + floor_us(from), self.zero_us + ceil_us(to))
    }

    /// When its monotonic clock shows this.
    pub(crate) fn instant(&self, moment: Moment<Host>) -> Ps {
        let counted = i128::from(moment.us() - self.zero_us) * i128::from(US);
        let at = (counted * 1_000_000_000).div_euclid(1_000_000_000 + i128::from(self.gains_ppb));
        Ps::try_from(at).expect("a time of the world")
    }

    /// How far the clock may be from UTC as it says itself or the site says for it.
    pub(crate) fn doubt_us(&self, site_doubt_us: Option<u64>) -> Option<u64> {
        self.told_doubt_us.or(site_doubt_us)
    }
}
