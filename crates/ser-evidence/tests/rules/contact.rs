//! Contacts: when each moved in truth.

use crate::chance::Chance;
use crate::true_time::{MS, Ps, S, US};

/// One change of a contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Move {
    pub(crate) at: Ps,
    /// Whether it closes.
    pub(crate) closes: bool,
}

/// A contact and all its moves, in order.
pub(crate) struct Contact {
    pub(crate) is_closed_at_first: bool,
    pub(crate) moves: Vec<Move>,
}

/// What the contacts of the world do around some moments of interest.
pub(crate) fn draw(count: usize, moments: &[Ps], until: Ps, chance: &mut Chance) -> Vec<Contact> {
    let mut times = vec![Vec::new(); count];
    for &moment in moments {
        match chance.below(8) {
            0..=4 => burst(moment, &mut times, chance),
            5 => chatter(moment, chance.below(count), &mut times, chance),
            6 => {
                burst(moment, &mut times, chance);
                chatter(moment, chance.below(count), &mut times, chance);
            }
            _ => times[chance.below(count)].push(moment),
        }
    }
    times.into_iter().map(|times| from_times(times, until, chance)).collect()
}

/// Several contacts move within a few milliseconds, some of them back soon after.
fn burst(moment: Ps, times: &mut [Vec<Ps>], chance: &mut Chance) {
    let length = chance.of(&[2 * MS, 8 * MS, 40 * MS, 200 * MS]);
    for times in times {
        if chance.one_in(4) {
            continue;
        }
        let at = moment + chance.between(0, length);
        times.push(at);
        if chance.one_in(3) {
            times.push(at + chance.between(2 * MS, 5 * S));
        }
    }
}

/// One contact bounces.
fn chatter(moment: Ps, contact: usize, times: &mut [Vec<Ps>], chance: &mut Chance) {
    let mut at = moment + chance.between(0, 20 * MS);
    let pause = chance.of(&[4 * MS, 60 * MS]);
    for _ in 0..chance.between(3, 30) {
        times[contact].push(at);
        at += chance.between(300 * US, pause);
    }
}

/// Moves alternate, whatever brought them about.
fn from_times(mut times: Vec<Ps>, until: Ps, chance: &mut Chance) -> Contact {
    times.retain(|&at| at < until);
    times.sort_unstable();
    times.dedup();
    let is_closed_at_first = chance.one_in(3);
    let mut is_closed = is_closed_at_first;
    let moves = times.into_iter().map(|at| {
        is_closed = !is_closed;
        Move { at, closes: is_closed }
    });
    Contact { is_closed_at_first, moves: moves.collect() }
}
