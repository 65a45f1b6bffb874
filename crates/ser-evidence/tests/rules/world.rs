//! A whole world in truth: hosts, contacts, recorders, and what was done with their clocks.
//!
//! Nothing here knows how the crate reckons. The judge compares what the crate says of the records
//! with what is drawn here.

use ser_evidence::site::{ClockRule, Site};

use crate::chance::Chance;
use crate::contact;
use crate::host::TrueHost;
use crate::operation::{Operation, What};
use crate::plant;
use crate::recorder::{Build, SetTakesEffect, TrueRecorder};
use crate::true_time::{MS, Ps, S};

/// What is amiss in a world besides what happens in every plant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Trouble {
    /// Nothing.
    None,
    /// One observation of a clock is wrong: the truth is not in its bound.
    WrongObservation,
    /// One entry was read twice, with other content each time.
    Conflict,
    /// Somebody set a clock, and no record tells.
    SecretSet,
    /// Somebody set a clock back to before everything that it had shown, and no record tells.
    SecretSetBack,
}

/// The most that the monotonic clock of a host gains or loses, in parts per billion.
const MOST_HOST_PPB: u32 = 50_000;

/// Everything that is true.
pub(crate) struct World {
    pub(crate) seed: u64,
    pub(crate) trouble: Trouble,
    pub(crate) start_utc_us: i64,
    pub(crate) until: Ps,
    pub(crate) site: Site,
    pub(crate) hosts: Vec<TrueHost>,
    /// Whether the monotonic clocks of hosts keep true time. The list is laid out as if they did.
    pub(crate) are_hosts_true: bool,
    pub(crate) recorders: Vec<TrueRecorder>,
    pub(crate) operations: Vec<Operation>,
    pub(crate) set_takes_effect: SetTakesEffect,
}

impl World {
    /// The world of a seed.
    pub(crate) fn draw(seed: u64, chance: &mut Chance) -> World {
        let trouble = match chance.below(20) {
            0 => Trouble::WrongObservation,
            1 => Trouble::Conflict,
            2 => Trouble::SecretSet,
            3 => Trouble::SecretSetBack,
            _ => Trouble::None,
        };
        let start_utc_us = chance.between(1_600_000_000, 1_900_000_000) * 1_000_000;
        let length = chance.of(&[60 * S, 600 * S, 3600 * S, 86_400 * S, 30 * 86_400 * S]);
        let until = chance.between(length / 2, length);
        let mut moments: Vec<Ps> =
            (0..chance.between(2, 8)).map(|_| chance.between(S, until)).collect();
        moments.sort_unstable();
        // What the clocks of hosts gain or lose counts as drift of the recorders that they observe.
        let hosts_ppb: u32 = chance.of(&[0, 300, 10_000, MOST_HOST_PPB]);
        let (mut site, builds) =
            plant::draw(start_utc_us / 1000, &moments, until, hosts_ppb, chance);
        if chance.one_in(2) {
            site.utc_doubt_us =
                Some(u64::try_from(chance.between(1000, 50_000)).expect("positive"));
        }
        let hosts: Vec<TrueHost> = (0..chance.between(1, 4))
            .map(|_| TrueHost::draw(start_utc_us, site.utc_doubt_us, hosts_ppb.into(), chance))
            .collect();
        let count = 1 + builds.iter().flat_map(|b| &b.wires).map(|w| w.contact).max().unwrap_or(0);
        let contacts = contact::draw(count, &moments, until, chance);
        let builds = plant::with_first_states(builds, &contacts);
        let set_takes_effect = builds[0].set_takes_effect;
        let operations = operations(&builds, &hosts, &moments, until, chance);
        let secret = matches!(trouble, Trouble::SecretSet | Trouble::SecretSetBack)
            .then(|| secret(trouble, &builds, &operations, until, chance));
        let live = |(recorder, build): (usize, Build)| {
            let mut sets = sets_of(recorder, &operations);
            if let Some((_, at)) = secret.filter(|&(whose, _)| whose == recorder) {
                let about_ms = match trouble {
                    // 1991: no clock of a world that was ever set shows as little.
                    Trouble::SecretSetBack => 662_688_000_000,
                    _ => start_utc_us / 1000,
                };
                sets.push((at, about_ms + chance.between(-5000, 5000)));
            }
            sets.sort_unstable();
            TrueRecorder::live(build, &contacts, &sets, until, chance)
        };
        let recorders = builds.into_iter().enumerate().map(live).collect();
        World {
            seed,
            trouble,
            start_utc_us,
            until,
            site,
            are_hosts_true: hosts_ppb == 0,
            hosts,
            recorders,
            operations,
            set_takes_effect,
        }
    }
}

/// Whose clock is set in secret, and when. One that is set back is, where that can be, one that was
/// set or asked shortly before, so that there is something to be forgotten.
fn secret(
    trouble: Trouble,
    builds: &[Build],
    operations: &[Operation],
    until: Ps,
    chance: &mut Chance,
) -> (usize, Ps) {
    let mut heard = operations.iter().rev().filter(|operation| !operation.recorders.is_empty());
    let last = heard.next().filter(|_| trouble == Trouble::SecretSetBack);
    match last {
        Some(Operation { recorders, after, .. }) => {
            let after = *after;
            (chance.of(recorders), after + chance.between(0, (until - after).clamp(1, 10 * S)))
        }
        None => (chance.below(builds.len()), chance.between(0, until)),
    }
}

/// What is done with clocks, in order.
fn operations(
    builds: &[Build],
    hosts: &[TrueHost],
    moments: &[Ps],
    until: Ps,
    chance: &mut Chance,
) -> Vec<Operation> {
    let mut operations = Vec::new();
    let mut add = |mut operation: Operation, whose: Vec<usize>, sets: bool, chance: &mut Chance| {
        operation.host = chance.below(hosts.len());
        let is_steady = |&recorder: &usize| {
            let schedule = &builds[recorder].schedule;
            schedule.is_one_life(operation.before - 10 * MS, operation.after + 10 * MS)
        };
        operation.recorders = whose.into_iter().filter(is_steady).collect();
        if sets && let Some(&recorder) = operation.recorders.first() {
            let reading = hosts[operation.host].reading(operation.sent, chance);
            let east_us = match builds[recorder].site.clock {
                ClockRule::Offset(seconds) => i64::from(seconds) * 1_000_000,
                ClockRule::Utc | ClockRule::Local => 0,
            };
            operation.what = What::Set((reading.utc.us() + east_us) / 1000);
        }
        operations.push(operation);
    };
    let draw = |is_broadcast: bool, chance: &mut Chance| {
        let sent = if chance.one_in(2) {
            chance.of(moments) + chance.between(-30 * S, 5 * S)
        } else {
            chance.between(0, until)
        };
        Operation::draw(sent.max(0), is_broadcast, chance)
    };
    for recorder in 0..builds.len() {
        for _ in 0..chance.between(0, 6) {
            let sets = chance.one_in(3);
            add(draw(false, chance), vec![recorder], sets, chance);
        }
        let moment = chance.of(moments);
        if chance.one_in(6) && moment > 30 * S {
            let [set, look] = Operation::twice_before(moment, chance);
            add(set, vec![recorder], true, chance);
            add(look, vec![recorder], false, chance);
        }
    }
    let bus: Vec<usize> = (0..builds.len()).filter(|_| !chance.one_in(4)).collect();
    for _ in 0..chance.between(0, 3) {
        let sets = chance.one_in(2);
        add(draw(true, chance), bus.clone(), sets, chance);
    }
    operations.sort_by_key(|operation| operation.sent);
    operations
}

/// The arrivals that set the clock of a recorder, with what they set it to.
fn sets_of(recorder: usize, operations: &[Operation]) -> Vec<(Ps, i64)> {
    let mut sets = Vec::new();
    for operation in operations.iter().filter(|o| o.recorders.contains(&recorder)) {
        if let What::Set(shown_ms) = operation.what {
            sets.extend(operation.arrivals.iter().map(|&arrival| (arrival, shown_ms)));
        }
    }
    sets
}
