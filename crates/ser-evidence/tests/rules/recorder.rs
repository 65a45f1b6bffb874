//! A recorder in truth: what its inputs, its clock and its log did.

use ser_evidence::record::Life;
use ser_evidence::site;
use ser_proto::{Entry, Inputs, Model};

use crate::chance::Chance;
use crate::contact::Contact;
use crate::input::{Edge, Wire, edges};
use crate::schedule::{ClockAtStart, Power, Schedule};
use crate::true_clock::{Rates, Setting, Ticks, TrueClock, TrueShown, stamp};
use crate::true_time::{MS, Ps, US};

/// Where a recorder samples in the milliseconds of its clock.
#[derive(Clone, Copy, Debug)]
pub(crate) enum SamplePlace {
    /// When a millisecond begins.
    AtTheTick,
    /// Always this much later.
    Later(Ps),
    /// Anywhere; the number decides.
    Anywhere(u64),
}

/// From when on a clock that is set shows the new time. All of a world do the same, because what
/// recorders note of one broadcast is compared.
#[derive(Clone, Copy, Debug)]
pub(crate) enum SetTakesEffect {
    /// In the millisecond of the arrival.
    AtOnce,
    /// When the next one begins.
    AtNextTick,
}

/// What is fixed about a recorder.
pub(crate) struct Build {
    pub(crate) site: site::Recorder,
    pub(crate) model: Model,
    /// How many entries its log holds.
    pub(crate) size: u16,
    pub(crate) wires: Vec<Wire>,
    pub(crate) sample_place: SamplePlace,
    pub(crate) set_takes_effect: SetTakesEffect,
    pub(crate) rate_ppb: i64,
    /// How much it drifts in true time at most; its site has what hosts see of it.
    pub(crate) own_drift_ppb: u32,
    pub(crate) schedule: Schedule,
    /// The total of its log when the world begins.
    pub(crate) first_total: u64,
}

/// One life of its log.
#[derive(Debug)]
pub(crate) struct TrueLife {
    pub(crate) name: Life,
    pub(crate) began: Ps,
    pub(crate) ended: Ps,
    pub(crate) power: usize,
    /// The total when it began, for the world.
    pub(crate) first_total: u64,
    /// How much less its told sequences are than its totals: a multiple of 65536.
    pub(crate) told_less: u64,
    /// The life that was erased by a collector.
    pub(crate) erased: Option<usize>,
}

impl TrueLife {
    /// The sequence that readers with memory tell.
    pub(crate) fn sequence(&self, total: u64) -> u64 {
        total - self.told_less
    }

    /// Whether sequences count from the beginning of the log.
    pub(crate) fn is_exact(&self) -> bool {
        self.first_total == 0
    }
}

/// An entry, and what only the world knows of it.
#[derive(Debug)]
pub(crate) struct TrueEntry {
    pub(crate) life: usize,
    pub(crate) total: u64,
    pub(crate) entry: Entry,
    pub(crate) sampled: Ps,
    /// What the clock showed at the sample.
    pub(crate) shown: TrueShown,
    /// The moves of contacts that it tells of.
    pub(crate) moves: Vec<SeenMove>,
}

/// A move of a contact that a recorder saw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct SeenMove {
    pub(crate) input: u8,
    pub(crate) contact: usize,
    pub(crate) at: Ps,
}

impl TrueEntry {
    /// The first and the last of the true moments.
    pub(crate) fn moved(&self) -> (Ps, Ps) {
        let moments = self.moves.iter().map(|seen| seen.at);
        let first = moments.clone().min().expect("an entry tells of a move");
        (first, moments.max().expect("an entry tells of a move"))
    }
}

/// A recorder and all that happened to it.
pub(crate) struct TrueRecorder {
    pub(crate) build: Build,
    /// One for each power-up.
    pub(crate) clocks: Vec<TrueClock>,
    pub(crate) lives: Vec<TrueLife>,
    /// In the order in which they were recorded.
    pub(crate) entries: Vec<TrueEntry>,
}

impl TrueRecorder {
    /// Lives through the world. `sets` are the arrivals of commands that set the clock, and what
    /// they set it to.
    pub(crate) fn live(
        build: Build,
        contacts: &[Contact],
        sets: &[(Ps, i64)],
        until: Ps,
        chance: &mut Chance,
    ) -> TrueRecorder {
        let clocks = clocks(&build, sets, until, chance);
        let lives = lives(&build, until, chance);
        let mut recorder = TrueRecorder { build, clocks, lives, entries: Vec::new() };
        let edges = edges(&recorder.build.wires, contacts, recorder.build.site.delays, chance);
        for power in 0..recorder.clocks.len() {
            recorder.record(power, &edges, until);
        }
        recorder
    }

    /// When the sample of a tick is.
    fn sample(&self, power: usize, tick: i64) -> Ps {
        let later = match self.build.sample_place {
            SamplePlace::AtTheTick => 0,
            SamplePlace::Later(later) => later,
            SamplePlace::Anywhere(number) => {
                let mixed = number ^ u64::try_from(tick).unwrap_or_default();
                i64::try_from(Chance::new(mixed).bits() >> 2).expect("62 bits") % (MS - US)
            }
        };
        self.clocks[power].ticks.instant(tick) + later
    }

    /// The tick of the first sample at or after an instant.
    fn tick_of_sample(&self, power: usize, at: Ps) -> i64 {
        let tick = self.clocks[power].ticks.at(at);
        if self.sample(power, tick) >= at { tick } else { tick + 1 }
    }

    /// Records what is sampled during one power-up.
    fn record(&mut self, power: usize, edges: &[Edge], until: Ps) {
        let Power { on, off, .. } = self.build.schedule.powers[power];
        let mut levels = 0;
        for wire in &self.build.wires {
            levels |= u32::from(wire.is_on_at_first) << (wire.input - 1);
        }
        let (before, after): (Vec<Edge>, Vec<Edge>) = edges.iter().partition(|e| e.arrives <= on);
        before.iter().for_each(|edge| edge.apply(&mut levels));
        let ticks = after.iter().map(|edge| self.tick_of_sample(power, edge.arrives));
        let sampled: Vec<(i64, Edge)> = ticks.zip(after.iter().copied()).collect();
        for group in sampled.chunk_by(|(one, _), (other, _)| one == other) {
            let at = self.sample(power, group[0].0);
            if at >= off.min(until) {
                return;
            }
            let levels_before = levels;
            group.iter().for_each(|(_, edge)| edge.apply(&mut levels));
            if levels != levels_before && self.build.schedule.is_recording(at) {
                let group: Vec<Edge> = group.iter().map(|&(_, edge)| edge).collect();
                self.add(power, at, levels_before ^ levels, levels, &group);
            }
        }
    }

    fn add(&mut self, power: usize, sampled: Ps, changed: u32, state: u32, edges: &[Edge]) {
        let life = self.life_at(sampled).expect("it is on");
        let shown = self.clocks[power].at(sampled);
        let total = self.total_at(life, sampled) + 1;
        let told = |edge: &&Edge| {
            let bit = 1 << (edge.input - 1);
            changed & bit != 0 && edge.is_on == (state & bit != 0)
        };
        let moves = edges.iter().filter(told);
        let moves =
            moves.map(|&Edge { input, contact, moved, .. }| SeenMove { input, contact, at: moved });
        let entry =
            Entry { changed: Inputs(changed), state: Inputs(state), time: stamp(shown.shown_ms) };
        self.entries.push(TrueEntry { life, total, entry, sampled, shown, moves: moves.collect() });
    }

    /// The life at an instant, if the recorder is on.
    pub(crate) fn life_at(&self, at: Ps) -> Option<usize> {
        self.lives.iter().position(|life| life.began <= at && at < life.ended)
    }

    /// The total of a life at an instant.
    pub(crate) fn total_at(&self, life: usize, at: Ps) -> u64 {
        let until = self.entries.partition_point(|entry| entry.sampled <= at);
        let newest = self.entries[..until].iter().rfind(|entry| entry.life == life);
        newest.map_or(self.lives[life].first_total, |entry| entry.total)
    }

    /// The entry with this total.
    pub(crate) fn entry(&self, life: usize, total: u64) -> Option<&TrueEntry> {
        self.entries.iter().find(|entry| entry.life == life && entry.total == total)
    }

    /// What the clock shows at an instant, if the recorder is on.
    pub(crate) fn shown_at(&self, at: Ps) -> Option<TrueShown> {
        let power = self.build.schedule.power_at(at)?;
        Some(self.clocks[power].at(at))
    }
}

/// The clocks of all power-ups.
fn clocks(build: &Build, sets: &[(Ps, i64)], until: Ps, chance: &mut Chance) -> Vec<TrueClock> {
    let rates = Rates { drift_ppb: build.own_drift_ppb, wander_ppb: build.site.wander_ppb };
    let mut clocks: Vec<TrueClock> = Vec::new();
    for power in &build.schedule.powers {
        let ticks = Ticks::draw(power.on, until.max(power.on + MS), build.rate_ppb, rates, chance);
        let shown_ms = match (power.clock, clocks.last()) {
            (ClockAtStart::Shows(shown_ms), _) => shown_ms,
            (ClockAtStart::KeptPlus(more), None) => more,
            (ClockAtStart::KeptPlus(more), Some(last)) => last.at(power.on).shown_ms + more,
        };
        let mut clock =
            TrueClock { ticks, settings: vec![Setting { from: power.on, tick: 0, shown_ms }] };
        for &(arrives, shown_ms) in sets {
            if power.on <= arrives && arrives < power.off {
                let now = clock.ticks.at(arrives);
                let (from, tick) = match build.set_takes_effect {
                    SetTakesEffect::AtOnce => (arrives, now),
                    SetTakesEffect::AtNextTick => (clock.ticks.instant(now + 1), now + 1),
                };
                clock.settings.push(Setting { from, tick, shown_ms });
            }
        }
        clock.settings.sort_by_key(|setting| setting.from);
        clocks.push(clock);
    }
    clocks
}

/// The lives of its log.
fn lives(build: &Build, until: Ps, chance: &mut Chance) -> Vec<TrueLife> {
    let mut lives: Vec<TrueLife> = Vec::new();
    for (power, &Power { on, off, .. }) in build.schedule.powers.iter().enumerate() {
        let erases = build.schedule.erases.iter().filter(|e| on < e.at && e.at < off.min(until));
        let begins = erases.map(|erase| (erase.at, erase.is_told));
        for (began, is_told_erase) in std::iter::once((on, false)).chain(begins) {
            let first_total = if lives.is_empty() { build.first_total } else { 0 };
            let told_first = first_total % 65_536;
            let erased = is_told_erase.then(|| lives.len() - 1);
            if let Some(last) = lives.last_mut() {
                last.ended = last.ended.min(began);
            }
            lives.push(TrueLife {
                name: Life::from_bits(chance.bits()),
                began,
                ended: off,
                power,
                first_total,
                told_less: first_total - told_first,
                erased,
            });
        }
    }
    lives
}
