//! What befalls a recorder, before anybody talks to it: power failures, erases, and spans in which
//! it does not record.

use crate::chance::Chance;
use crate::true_time::{MS, Ps, S};

/// What the clock shows after power-up.
#[derive(Clone, Copy, Debug)]
pub(crate) enum ClockAtStart {
    /// This, in milliseconds since 1970.
    Shows(i64),
    /// What it would have shown without the failure, and this many milliseconds more.
    KeptPlus(i64),
}

/// From power-up to power failure.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Power {
    pub(crate) on: Ps,
    pub(crate) off: Ps,
    pub(crate) clock: ClockAtStart,
}

/// The log is emptied.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Erase {
    pub(crate) at: Ps,
    /// Whether a collector did it, so that records tell.
    pub(crate) is_told: bool,
}

/// What befalls a recorder.
#[derive(Debug)]
pub(crate) struct Schedule {
    pub(crate) powers: Vec<Power>,
    pub(crate) erases: Vec<Erase>,
    /// Not recording.
    pub(crate) stops: Vec<(Ps, Ps)>,
}

impl Schedule {
    /// `now_ms` is what a right clock shows when the world begins.
    pub(crate) fn draw(moments: &[Ps], until: Ps, now_ms: i64, chance: &mut Chance) -> Schedule {
        let first = match chance.below(4) {
            0 => 0,
            1 => 946_684_800_000,
            2 => now_ms + chance.between(-3_700_000, 3_700_000),
            _ => now_ms + chance.between(-500, 500),
        };
        let mut powers = vec![Power { on: 0, off: Ps::MAX, clock: ClockAtStart::Shows(first) }];
        if chance.one_in(3) {
            for _ in 0..chance.between(1, 2) {
                fail(&mut powers, time(moments, until, chance), chance);
            }
        }
        let mut erases = Vec::new();
        if chance.one_in(3) {
            for _ in 0..chance.between(1, 2) {
                erases.push(Erase { at: time(moments, until, chance), is_told: !chance.one_in(3) });
            }
        }
        erases.sort_by_key(|erase| erase.at);
        let mut stops = Vec::new();
        if chance.one_in(5) {
            let from = time(moments, until, chance);
            stops.push((from, from + chance.between(10 * MS, 60 * S)));
        }
        Schedule { powers, erases, stops }
    }

    /// The power-up during which this is, if the recorder is on.
    pub(crate) fn power_at(&self, at: Ps) -> Option<usize> {
        self.powers.iter().position(|power| power.on <= at && at < power.off)
    }

    /// Whether all of this is in one life of the log.
    pub(crate) fn is_one_life(&self, from: Ps, to: Ps) -> bool {
        let is_on = self.powers.iter().any(|power| power.on < from && to < power.off);
        is_on && !self.erases.iter().any(|erase| from <= erase.at && erase.at <= to)
    }

    pub(crate) fn is_recording(&self, at: Ps) -> bool {
        !self.stops.iter().any(|&(from, to)| from <= at && at < to)
    }
}

/// Any time, or one at which something else happens.
fn time(moments: &[Ps], until: Ps, chance: &mut Chance) -> Ps {
    match chance.below(3) {
        0 => chance.between(0, until),
        1 => chance.of(moments) + chance.between(0, 200 * MS),
        _ => (chance.of(moments) + chance.between(-60 * S, 60 * S)).clamp(0, until),
    }
}

/// The power fails once more.
fn fail(powers: &mut Vec<Power>, off: Ps, chance: &mut Chance) {
    let Some(last) = powers.last_mut().filter(|last| last.on + S < off) else { return };
    last.off = off;
    let clock = match chance.below(3) {
        0 => ClockAtStart::Shows(0),
        1 => ClockAtStart::KeptPlus(0),
        _ => ClockAtStart::KeptPlus(chance.between(-2000, 2000)),
    };
    powers.push(Power { on: off + chance.between(10 * MS, 100 * S), off: Ps::MAX, clock });
}
