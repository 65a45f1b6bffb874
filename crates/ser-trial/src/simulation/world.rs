//! Recorders, hosts, lines and bus in one virtual time, life after life. A life lasts from power-up
//! to power cut.

use std::time::Instant;

use ser_node::Debounce;
use ser_proto::{AutoReport, Baud, Command, Configure, Model};
use ser_sim::genius::Noise;
use ser_sim::{PoweredOff, Ram, SimNode};

use super::activity::Tempo;
use super::bus::{BusHost, BusLife, HOST, any_noise};
use super::chance::Chance;
use super::conversation::{Conversation, Order};
use super::line_host::{Errand, LineHost};
use super::pace::{Pace, Paces};
use super::report::{Hours, Report};
use super::trail::Trail;
use super::unit::{SETTLING_MS, Unit};
use super::wrong::Wrong;

/// The time by which readers are at the end of the log, even at the lowest rate.
const CATCH_UP_MS: u64 = 8 * 3_600_000;

/// Settings with which a recorder does everything it can do unasked, at the highest rate.
const PRINT_AND_REPORT: Configure = Configure {
    size: None,
    baud: Some(Baud::B19200),
    auto_report: AutoReport::Genius,
    report_address: HOST,
    auto_print: true,
};

/// The time in which a capture queue does not fill, whatever the inputs do.
const MAX_DEBOUNCED_HOLD_UP_MS: u64 = 200;

/// The number of ticks after which the tick wraps.
const TICKS: u64 = 1 << 32;

/// How often events that all readers have passed are forgotten.
const FORGET_EVERY: u64 = 1 << 14;

/// The options of a run.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// The number from which everything follows.
    pub seed: u64,
    /// How long it lasts, in virtual time. The last life is completed.
    pub duration_ms: u64,
    /// How often a life is on a bus: the first life, and one in this many of the others. With 0
    /// there is no bus at all.
    pub bus_one_in: u64,
}

/// Everything that outlives a power cut.
pub struct World {
    options: Options,
    chance: Chance,
    trail: Trail,
    units: Vec<Unit>,
    line: LineHost,
    bus_host: BusHost,
    now_ms: u64,
    hours: Hours,
    paces: Paces,
    /// Events of all earlier lives, per unit.
    recorded: Vec<u64>,
}

/// Everything that is under power.
struct Life<'r> {
    nodes: Vec<SimNode<'r>>,
    bus: Option<BusLife>,
    tempo: Tempo,
    next_fault_ms: u64,
    end_ms: u64,
}

impl World {
    /// A cabinet that has never been switched on.
    #[must_use]
    pub fn new(options: Options, trail: Trail) -> World {
        let mut chance = Chance::new(options.seed);
        let models = [
            chance.pick(&[Model::Ser160, Model::Ser320]),
            chance.pick(&[Model::Ser160, Model::Ser320]),
        ];
        let units: Vec<Unit> =
            models.into_iter().map(|model| Unit::new(chance.branch(), model)).collect();
        let line = LineHost::new(chance.branch());
        let bus_host = BusHost::new(chance.branch(), units.len());
        let recorded = vec![0; units.len()];
        let (hours, paces) = (Hours::default(), Paces::default());
        World { options, chance, trail, units, line, bus_host, now_ms: 0, hours, paces, recorded }
    }

    /// Runs as long as the options say.
    ///
    /// # Errors
    /// The first thing that is not as it must be.
    pub fn run(mut self) -> Result<(Report, Paces), String> {
        let mut off: Vec<PoweredOff> =
            self.units.iter().map(|unit| PoweredOff::new(unit.options())).collect();
        self.line.talk.keep_up();
        while self.now_ms < self.options.duration_ms {
            let mut rams: Vec<Ram> = self.units.iter().map(|_| Ram::new()).collect();
            let (began, before) = (Instant::now(), self.hours);
            off = self.live(off, &mut rams)?;
            self.clock_life(began, before);
        }
        self.report()
    }

    /// Runs one life on a bus in which all inputs toggle in every millisecond, and all hosts read
    /// as fast as they can while the first recorder prints and reports everything.
    ///
    /// # Errors
    /// The first thing that is not as it must be.
    pub fn run_flat_out(mut self) -> Result<(Report, Paces), String> {
        self.units.iter_mut().for_each(|unit| unit.debounce = Debounce::OFF);
        let off: Vec<PoweredOff> =
            self.units.iter().map(|unit| PoweredOff::new(unit.options())).collect();
        let mut rams: Vec<Ram> = self.units.iter().map(|_| Ram::new()).collect();
        let (began, before) = (Instant::now(), self.hours);
        let mut life = self.power_up(off, &mut rams);
        let models: Vec<Model> = self.units.iter().map(|unit| unit.model).collect();
        life.bus = Some(BusLife::new(self.chance.branch(), &models, self.now_ms, Noise::default()));
        self.line.talk.begin(Order::Ask(Command::Configure(PRINT_AND_REPORT)), self.now_ms);
        while self.now_ms < self.options.duration_ms {
            for (unit, node) in self.units.iter_mut().zip(&mut life.nodes) {
                unit.play(node, self.now_ms, Tempo::Flat);
            }
            self.step(&mut life, Errand::CatchUp { since_ms: u64::MAX })?;
        }
        self.settle(&mut life)?;
        self.power_cut(life)?;
        self.clock_life(began, before);
        self.report()
    }

    /// Counts the time of a life that has ended. It was on a bus all the time or never.
    fn clock_life(&mut self, began: Instant, before: Hours) {
        let pace =
            Pace { virtual_ms: self.hours.total_ms - before.total_ms, real: began.elapsed() };
        let on_bus = self.hours.bus_ms > before.bus_ms;
        let of = if on_bus { &mut self.paces.on_bus } else { &mut self.paces.without_bus };
        *of = *of + pace;
    }

    fn report(self) -> Result<(Report, Paces), String> {
        let World { trail, units, line, bus_host, hours, paces, recorded, .. } = self;
        let accounts = [line.talk.account()]
            .into_iter()
            .chain(bus_host.talks.iter().map(Conversation::account));
        // The accounts are the line's, which belongs to the first recorder, and then one per
        // recorder on the bus.
        for (account, unit) in accounts.clone().zip([0, 0, 1]) {
            let tally = account.tally();
            let accounted = tally.accounted();
            if accounted != recorded[unit] {
                let what = format!("{}: not every event is in one of the columns", account.name());
                return Wrong::new(what)
                    .fact("recorded", format_args!("{} events", recorded[unit]))
                    .fact("accounted", format_args!("{accounted} events"))
                    .fact("columns", format_args!("{tally:?}"))
                    .err();
            }
        }
        for (unit, recorded) in units.iter().zip(&recorded) {
            trail.mark(format!("{:?} {recorded}", unit.ledger.edges()).as_bytes());
        }
        let report = Report {
            seed: self.options.seed,
            digest: trail.digest(),
            operations: trail.operations(),
            hours,
            edges: units.iter().map(|unit| unit.ledger.edges()).collect(),
            recorded,
            answers: units.iter().map(|unit| unit.ledger.answers()).collect(),
            filters_set: units.iter().map(|unit| unit.ledger.filters_set()).collect(),
            tallies: accounts.map(|account| (account.name(), account.tally())).collect(),
            line: line.talk.talk(),
            bus: bus_host.talks.iter().map(Conversation::talk).collect(),
            printed: line.printed(),
            forged: line.forged(),
        };
        Ok((report, paces))
    }

    fn live(&mut self, off: Vec<PoweredOff>, rams: &mut [Ram]) -> Result<Vec<PoweredOff>, String> {
        let mut life = self.power_up(off, rams);
        while self.now_ms < life.end_ms {
            self.step(&mut life, Errand::Any)?;
            self.suffer(&mut life)?;
        }
        let is_last = self.now_ms >= self.options.duration_ms;
        if is_last || self.chance.one_in(2) {
            self.settle(&mut life)?;
        }
        self.power_cut(life)
    }

    fn power_up<'r>(&mut self, off: Vec<PoweredOff>, rams: &'r mut [Ram]) -> Life<'r> {
        let drawn = self.chance.one_in(self.options.bus_one_in.max(1));
        let first = self.now_ms == 0;
        let on_bus = self.options.bus_one_in > 0 && (first || drawn);
        let busy = on_bus || self.chance.one_in(8);
        let duration_ms = match (on_bus, busy) {
            (true, _) => self.chance.spread(20_000..=400_000),
            (false, true) => self.chance.spread(60_000..=2 * 3_600_000),
            (false, false) => self.chance.spread(60_000..=3 * 86_400_000),
        };
        self.trail
            .note(format_args!("power up, {}", if on_bus { "on a bus" } else { "without a bus" }));
        let off_ms = self.chance.spread(1..=3_600_000);
        let mut nodes = Vec::new();
        for ((unit, off), ram) in self.units.iter_mut().zip(off).zip(rams) {
            unit.power_comes_on(self.now_ms, off_ms);
            nodes.push(off.power_up(ram));
        }
        if self.chance.one_in(3) {
            self.grow_older(&mut nodes);
        }
        let models: Vec<Model> = self.units.iter().map(|unit| unit.model).collect();
        let noise = any_noise(&mut self.chance);
        let bus = on_bus.then(|| BusLife::new(self.chance.branch(), &models, self.now_ms, noise));
        let tempo = if busy { Tempo::Busy } else { Tempo::Plant };
        self.line.power_comes_on(self.now_ms, tempo);
        Life {
            nodes,
            bus,
            tempo,
            next_fault_ms: self.now_ms + self.chance.spread(1_000..=3_600_000),
            end_ms: (self.now_ms + duration_ms).min(self.now_ms.max(self.options.duration_ms)),
        }
    }

    /// The recorders have been on for 49 days already: their ticks are about to wrap.
    fn grow_older(&mut self, nodes: &mut [SimNode<'_>]) {
        let by_ms = TICKS - self.chance.spread(1_000..=1_000_000);
        self.trail.note(format_args!("{by_ms} ms older"));
        for (unit, node) in self.units.iter_mut().zip(nodes) {
            node.grow_older(by_ms);
            unit.ledger.grow_older(by_ms);
        }
    }

    /// When something happens next.
    fn next_ms(&self, life: &Life<'_>, errand: Errand) -> u64 {
        let soon_ms = self.now_ms + 1;
        if life.bus.is_some() || life.nodes.iter().any(|node| !node.is_at_rest()) {
            return soon_ms;
        }
        let moves = life.nodes.iter().filter_map(SimNode::next_move_ms);
        let scenes = self.units.iter().map(|unit| unit.activity.next_ms());
        let scenes = scenes.filter(|_| errand == Errand::Any);
        let next_ms = moves.chain(scenes).fold(self.line.next_ms(self.now_ms, errand), u64::min);
        let end_ms = match errand {
            Errand::Any => life.end_ms.min(life.next_fault_ms),
            Errand::CatchUp { .. } => u64::MAX,
        };
        // Nobody waits longer than that in vain.
        next_ms.min(end_ms).clamp(soon_ms, self.now_ms + CATCH_UP_MS)
    }

    /// Lets time pass up to the next thing that happens, and lets it happen.
    fn step(&mut self, life: &mut Life<'_>, errand: Errand) -> Result<(), String> {
        let to_ms = self.next_ms(life, errand);
        self.hours.count(to_ms - self.now_ms, life.bus.is_some());
        self.now_ms = to_ms;
        self.trail.set_now(to_ms);
        if let Some(bus) = &mut life.bus {
            bus.advance(to_ms);
            for (index, (unit, node)) in self.units.iter_mut().zip(&mut life.nodes).enumerate() {
                bus.hand_in_pulses(index, node, &mut unit.ledger);
            }
        }
        for (unit, node) in self.units.iter_mut().zip(&mut life.nodes) {
            node.leap_to(to_ms);
            unit.follow(node, to_ms, false);
        }
        self.pass_on(life, errand)?;
        for unit in &mut self.units {
            unit.look_at_filters(&self.trail)?;
        }
        if errand == Errand::Any {
            for (unit, node) in self.units.iter_mut().zip(&mut life.nodes) {
                unit.play(node, to_ms, life.tempo);
            }
        }
        if self.hours.steps.is_multiple_of(FORGET_EVERY) {
            self.forget(life.bus.is_some());
        }
        Ok(())
    }

    /// Lets bytes and datagrams arrive whose time has come.
    fn pass_on(&mut self, life: &mut Life<'_>, errand: Errand) -> Result<(), String> {
        let World { units, line, bus_host, now_ms, trail, .. } = self;
        let [first, second] = &mut units[..] else { return Err("two recorders".to_owned()) };
        let [node, other] = &mut life.nodes[..] else { return Err("two nodes".to_owned()) };
        line.deliver(*now_ms, node, &mut first.ledger);
        if let Some(bus) = &mut life.bus {
            bus.serve(0, *now_ms, node, &mut first.ledger)?;
            bus.serve(1, *now_ms, other, &mut second.ledger)?;
        }
        line.listen(*now_ms, node, &mut first.ledger, trail)?;
        line.act(*now_ms, errand, &first.ledger, trail)?;
        if let Some(bus) = &mut life.bus {
            let mut ledgers = [&mut first.ledger, &mut second.ledger];
            bus.act(*now_ms, errand, bus_host, &mut ledgers, trail)?;
        }
        // Nobody listens to the second recorder's line.
        let said = other.output().len();
        other.taken(said);
        Ok(())
    }

    /// Lets something go wrong, if it is time.
    fn suffer(&mut self, life: &mut Life<'_>) -> Result<(), String> {
        if let Some(bus) = &mut life.bus {
            bus.suffer(self.now_ms, &self.trail);
        }
        if self.now_ms < life.next_fault_ms {
            return Ok(());
        }
        let pause_ms = match life.tempo {
            Tempo::Busy | Tempo::Flat => self.chance.spread(500..=60_000),
            Tempo::Plant => self.chance.spread(1_000..=2 * 3_600_000),
        };
        let until_ms = self.now_ms + self.chance.spread(500..=60_000);
        match self.chance.below(5) {
            0 => {
                let one_in = self.chance.spread(3..=1_000);
                self.trail.note(format_args!("line: one byte in {one_in} is disturbed"));
                self.line.disturb(until_ms, one_in);
            }
            1 => {
                self.trail.note(format_args!(
                    "line: the host is stuck for {} ms",
                    until_ms - self.now_ms
                ));
                self.line.get_stuck(until_ms);
            }
            2 => {
                self.trail.note("line: stray bytes");
                self.line.stray_bytes(self.now_ms);
            }
            3 => {
                self.trail.note("line: many commands at once");
                self.line.flood(self.now_ms);
            }
            _ => self.hold_up(life)?,
        }
        life.next_fault_ms = self.now_ms + pause_ms;
        Ok(())
    }

    /// Something keeps the main loops of the recorders busy.
    fn hold_up(&mut self, life: &mut Life<'_>) -> Result<(), String> {
        let for_ms = self.chance.spread(1..=2_000);
        self.trail.note(format_args!("main loops held up for {for_ms} ms"));
        self.hours.count(for_ms, life.bus.is_some());
        if let Some(bus) = &mut life.bus {
            // Boards and their interrupts go on.
            bus.advance(self.now_ms + for_ms);
            for (index, (unit, node)) in self.units.iter_mut().zip(&mut life.nodes).enumerate() {
                bus.hand_in_pulses(index, node, &mut unit.ledger);
            }
        }
        let all_toggle = self.chance.one_in(2);
        for (unit, node) in self.units.iter_mut().zip(&mut life.nodes) {
            if all_toggle {
                unit.play(node, self.now_ms, Tempo::Flat);
            }
            // With debounce, the ledger cannot tell what a full queue drops.
            let until_ms = self.now_ms + for_ms;
            if unit.ledger.is_undebounced() || for_ms <= MAX_DEBOUNCED_HOLD_UP_MS {
                node.hold_up_to(until_ms);
                unit.follow(node, until_ms, true);
                unit.look_at_filters(&self.trail)?;
                continue;
            }
            for ms in self.now_ms + 1..=until_ms {
                node.leap_to(ms);
                unit.follow(node, ms, false);
                unit.look_at_filters(&self.trail)?;
            }
        }
        self.now_ms += for_ms;
        self.trail.set_now(self.now_ms);
        Ok(())
    }

    /// Lets everything come to rest and all hosts read everything, and checks that nothing is
    /// missing.
    fn settle(&mut self, life: &mut Life<'_>) -> Result<(), String> {
        self.trail.note("everything calms down");
        self.line.mend();
        if let Some(bus) = &mut life.bus {
            bus.mend(&self.trail);
        }
        let deadline_ms = self.now_ms + CATCH_UP_MS;
        let mut quiet_ms = self.now_ms + SETTLING_MS;
        while !self.has_settled(life, quiet_ms) {
            if self.now_ms > deadline_ms {
                let talks = [&self.line.talk].into_iter().chain(&self.bus_host.talks);
                let behind =
                    talks.filter(|talk| !talk.has_read_since(quiet_ms)).map(Conversation::describe);
                let behind: Vec<String> = behind.collect();
                return Err(format!(
                    "hosts have not read the log to its end: {}",
                    behind.join(", ")
                ));
            }
            let moves = self.is_moving(life);
            self.step(life, Errand::CatchUp { since_ms: quiet_ms })?;
            if moves {
                quiet_ms = self.now_ms + SETTLING_MS;
            }
        }
        let ledger = &self.units[0].ledger;
        self.line.talk.account_mut().finish_reading(ledger)?;
        if let Some(bus) = &life.bus {
            for (talk, unit) in self.bus_host.talks.iter_mut().zip(&self.units) {
                talk.account_mut().finish_reading(&unit.ledger)?;
            }
            bus.check()?;
        }
        for (index, (unit, node)) in self.units.iter_mut().zip(&life.nodes).enumerate() {
            unit.check(node, life.bus.as_ref().map(|bus| bus.counted(index)))?;
        }
        Ok(())
    }

    /// Whether contacts move, or still count as if they did.
    fn is_moving(&self, life: &Life<'_>) -> bool {
        let moves = life.nodes.iter().any(|node| node.next_move_ms().is_some());
        moves || self.units.iter().any(|unit| unit.ledger.chattering() != 0)
    }

    fn has_settled(&self, life: &Life<'_>, quiet_ms: u64) -> bool {
        let on_bus = life.bus.is_some();
        let bus =
            self.bus_host.talks.iter().filter(|_| on_bus).all(|talk| talk.has_read_since(quiet_ms));
        bus && self.line.talk.has_read_since(quiet_ms)
    }

    fn power_cut(&mut self, life: Life<'_>) -> Result<Vec<PoweredOff>, String> {
        self.trail.note("power cut");
        let on_bus = life.bus.is_some();
        if let Some(bus) = &life.bus {
            bus.check()?;
        }
        let units = self.units.iter_mut().zip(&life.nodes).zip(&mut self.recorded);
        for (index, ((unit, node), recorded)) in units.enumerate() {
            unit.check(node, life.bus.as_ref().map(|bus| bus.counted(index)))?;
            *recorded += unit.ledger.len() as u64;
        }
        self.line.talk.account_mut().power_goes(&self.units[0].ledger, true);
        for (talk, unit) in self.bus_host.talks.iter_mut().zip(&self.units) {
            talk.account_mut().power_goes(&unit.ledger, on_bus);
        }
        self.line.power_cycled();
        self.bus_host.power_cycled(self.now_ms);
        Ok(life.nodes.into_iter().map(SimNode::power_off).collect())
    }

    /// Forgets events that all readers have passed.
    fn forget(&mut self, on_bus: bool) {
        let line = self.line.talk.account();
        for (index, unit) in self.units.iter_mut().enumerate() {
            let ledger = &unit.ledger;
            let line = (index == 0).then(|| line.place(ledger).unwrap_or(0));
            let bus =
                on_bus.then(|| self.bus_host.talks[index].account().place(ledger).unwrap_or(0));
            let all_past = line.into_iter().chain(bus).min().unwrap_or(ledger.len());
            unit.ledger.forget_before(all_past);
        }
    }
}
