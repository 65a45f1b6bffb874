//! The Genius bus of one life: recorders and the host with their boards, other devices, and what
//! goes wrong.
//!
//! A bus is simulated in full, event by event, because its devices have something to do in every
//! scan.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::time::Duration;

use geni_board::{
    Completion, Configuration, Data, Destination, Driver, Event, Options, Start, Transmission,
    TransmitPriority,
};
use ser_node::{GeniusDiagnostics, GeniusOptions, GeniusPort};
use ser_proto::genius::{FUNCTION_GENIUS, FUNCTION_HORNER, SUBFUNCTION_SER, Subfunction};
use ser_proto::{Command, Model, Reply};
use ser_sim::SimNode;
use ser_sim::genius::{
    BlockKind, Board, BoardOptions, BoardWindow, Bus, BusTiming, Circuits, DeviceFault, DeviceId,
    DiscreteBlock, Fault, Handle, Noise, Traffic, ViolationKind, tick_ms,
};

use super::chance::Chance;
use super::conversation::{Conversation, Order};
use super::ledger::Ledger;
use super::line_host::Errand;
use super::orders::{self, Way};
use super::port::Port;
use super::taps::{BusTap, Taken, TappedWindow, answered_as};
use super::trail::Trail;

/// Bus addresses.
pub(super) const HOST: u8 = 31;
const DEAF: u8 = 20;
const FIRST_UNIT: u8 = 5;

/// The reset line at power-up, held as shortly as the boards allow.
const RESET: Start = Start::Reset { hold_ms: 20 };

/// How soon a recorder's board has sent a reply, or given it up.
const REPLIED_WITHIN_MS: u64 = 20_000;

/// A recorder's connection to the bus.
struct UnitPort {
    number: u8,
    port: GeniusPort<TappedWindow>,
    board: Handle<Board>,
    tap: BusTap,
    /// Whether its board's interrupt line is connected. Without it the recorder depends on its own
    /// looks at the board.
    has_line: bool,
    /// How often the recorder had given up its board when it was last served.
    failures: u32,
    /// Whether its board has started anew without the recorder's doing. The recorder then looked at
    /// it too early.
    restarted: bool,
    /// Since when datagrams had waited that were lost when the board started anew. The recorder
    /// waits for them until it finds that out.
    gone_since_ms: Option<u64>,
    /// Whether the recorder holds the board's reset line low.
    held: bool,
}

/// The host's conversations, over all lives.
pub struct BusHost {
    /// One with each recorder.
    pub talks: Vec<Conversation>,
    next_order_ms: Vec<u64>,
    next_broadcast_ms: u64,
    outgoing: VecDeque<Transmission>,
    chance: Chance,
}

impl BusHost {
    /// A host that has not said anything yet to this many recorders.
    #[must_use]
    pub fn new(chance: Chance, units: usize) -> BusHost {
        const NAMES: [&str; 2] = ["bus, first", "bus, second"];
        let talk = |index: usize| {
            Conversation::new(NAMES[index], ser_client::LineRate::Instant).one_at_a_time()
        };
        BusHost {
            talks: (0..units).map(talk).collect(),
            next_order_ms: vec![0; units],
            next_broadcast_ms: 0,
            outgoing: VecDeque::new(),
            chance,
        }
    }

    /// The bus is gone, with everything that was under way.
    pub fn power_cycled(&mut self, now_ms: u64) {
        self.outgoing.clear();
        self.talks.iter_mut().for_each(|talk| talk.give_up(now_ms));
    }

    /// A datagram that is no command, or none for a recorder, to one of them or to all.
    fn any_odd_datagram(&mut self) -> Transmission {
        let first = Destination::Device(FIRST_UNIT);
        let to = self.chance.pick(&[Destination::Broadcast, first, first]);
        let odd = message_of(to, &orders::odd_body(&mut self.chance));
        match self.chance.below(4) {
            0 => Transmission { subfunction: SUBFUNCTION_SER + 1, ..odd },
            1 => Transmission {
                function: FUNCTION_GENIUS,
                subfunction: Subfunction::ReadIoForces.code(),
                data: Data::from_slice(&[self.chance.byte() & 7]).unwrap_or_default(),
                ..odd
            },
            _ => odd,
        }
    }

    fn begin_next(&mut self, now_ms: u64, errand: Errand, trail: &Trail) {
        for (index, talk) in self.talks.iter_mut().enumerate().filter(|(_, talk)| talk.is_resting())
        {
            let order = match errand {
                Errand::CatchUp { since_ms } if talk.has_read_since(since_ms) => continue,
                Errand::CatchUp { .. } => Order::Read,
                Errand::Any if talk.is_behind() => Order::Read,
                Errand::Any if now_ms >= self.next_order_ms[index] => {
                    self.next_order_ms[index] = now_ms + self.chance.spread(1..=4_000);
                    orders::next_order(&mut self.chance, Way::Bus)
                }
                Errand::Any => continue,
            };
            if !matches!(order, Order::Read) {
                trail.note(format_args!("{}: {order:?}", talk.account().name()));
            }
            talk.begin(order, now_ms);
        }
        if errand == Errand::Any && now_ms >= self.next_broadcast_ms {
            self.next_broadcast_ms = now_ms + self.chance.spread(1_000..=60_000);
            let command = orders::next_broadcast(&mut self.chance);
            trail.note(format_args!("broadcast: {command:?}"));
            self.outgoing.push_back(message(Destination::Broadcast, &command));
            let odd = self.any_odd_datagram();
            self.outgoing.push_back(odd);
        }
    }
}

fn message(destination: Destination, command: &Command) -> Transmission {
    message_of(destination, &command.to_body())
}

fn message_of(destination: Destination, body: &[u8]) -> Transmission {
    Transmission {
        destination,
        function: FUNCTION_HORNER,
        subfunction: SUBFUNCTION_SER,
        priority: TransmitPriority::Normal,
        completion: Completion::Acknowledged,
        // No command is longer than a datagram.
        data: Data::from_slice(body).unwrap_or_default(),
    }
}

/// Tells the ledger of a message that a recorder has taken, and of what the recorder counts then.
fn process(taken: &Taken, arrived_ms: Option<u64>, now_ms: u64, ledger: &mut Ledger) {
    let Taken { received, broadcast, .. } = *taken;
    let is_time = match received {
        Ok(Command::SetClock(_)) => true,
        Ok(Command::Time { .. }) => broadcast,
        _ => false,
    };
    let counts = ledger.expected.genius.get_or_insert_default();
    if is_time && arrived_ms.is_none() {
        // A time is worthless if nobody knows when it arrived, and a mark as well.
        counts.clocks_refused += 1;
        return;
    }
    counts.broadcasts += u32::from(broadcast && received.is_ok());
    counts.requests += u32::from(!broadcast);
    let at_ms = arrived_ms.unwrap_or(now_ms);
    match received {
        Err(error) => {
            ledger.expected.parse_error(error);
            if let Some(command) = answered_as(error).filter(|_| !broadcast) {
                ledger.command_arrived(Port::Bus, &command, now_ms + REPLIED_WITHIN_MS);
            }
        }
        Ok(Command::SetClock(time)) => ledger.set_clock(Port::Bus, at_ms, time),
        Ok(Command::SetMode { recording }) => {
            ledger.expected.exact.settings_late += u32::from(arrived_ms.is_none());
            ledger.set_recording(at_ms, recording);
        }
        Ok(Command::Time { token }) if broadcast => ledger.marked(token, at_ms),
        Ok(Command::Time { token }) => ledger.time_asked(Port::Bus, token, at_ms),
        Ok(command) if broadcast => ledger.command_done(&command),
        Ok(command) => ledger.command_arrived(Port::Bus, &command, now_ms + REPLIED_WITHIN_MS),
    }
}

/// How bad a bus is: good, or with up to a few per cent of all messages lost.
pub fn any_noise(chance: &mut Chance) -> Noise {
    let ppm = |chance: &mut Chance| chance.pick(&[0_u32, 0, 100, 5_000, 30_000]);
    Noise {
        seed: chance.below(u64::MAX),
        damaged_ppm: ppm(chance),
        lost_ppm: ppm(chance),
        unacknowledged_ppm: ppm(chance),
    }
}

/// The bus while everything on it has power.
pub struct BusLife {
    bus: Rc<RefCell<Bus>>,
    units: Vec<UnitPort>,
    driver: Driver<BoardWindow>,
    host: Handle<Board>,
    host_restarted: bool,
    others: Vec<DeviceId>,
    chance: Chance,
    next_fault_ms: u64,
    /// The first millisecond of its time.
    begin_ms: u64,
}

impl BusLife {
    /// Switches everything on.
    #[must_use]
    pub fn new(mut chance: Chance, models: &[Model], begin_ms: u64, noise: Noise) -> BusLife {
        let bus = Rc::new(RefCell::new(Bus::with_noise(BusTiming::default(), noise)));
        let connect = |number| {
            let board = bus.borrow_mut().connect(Board::new(BoardOptions::at(number)));
            (board, BoardWindow::new(Rc::clone(&bus), board))
        };
        let units = models.iter().zip(FIRST_UNIT..).map(|(&model, number)| {
            let (board, window) = connect(number);
            let tap = BusTap::default();
            let options = GeniusOptions { start: RESET, ..GeniusOptions::new(model) };
            let port = GeniusPort::new(TappedWindow::new(window, Rc::clone(&tap)), options);
            let has_line = chance.one_in(2);
            let (restarted, gone_since_ms, held) = (false, None, false);
            UnitPort {
                number,
                port,
                board,
                tap,
                has_line,
                failures: 0,
                restarted,
                gone_since_ms,
                held,
            }
        });
        let units: Vec<UnitPort> = units.collect();
        let (host, window) = connect(HOST);
        let driver =
            Driver::new(window, Options { start: RESET, ..Options::new(Configuration::DEFAULT) });
        let deaf = bus.borrow_mut().connect(Board::powered(BoardOptions::at(DEAF))).id();
        let block =
            DiscreteBlock::new(2, BusTiming::default(), Circuits::Sixteen, BlockKind::Inputs);
        let block = bus.borrow_mut().connect(block).id();
        let next_fault_ms = begin_ms + chance.within(5_000..=60_000);
        BusLife {
            bus,
            units,
            driver,
            host,
            host_restarted: false,
            others: vec![deaf, block],
            chance,
            next_fault_ms,
            begin_ms,
        }
    }

    /// What has happened on the bus.
    #[must_use]
    pub fn traffic(&self) -> Traffic {
        self.bus.borrow().traffic()
    }

    /// Lets the bus live up to the present.
    pub fn advance(&mut self, now_ms: u64) {
        self.bus.borrow_mut().advance_to((now_ms - self.begin_ms) * 1000);
    }

    /// The millisecond of the simulation in which this microsecond of the bus lies, as a tick.
    fn ms(&self, bus_us: u64) -> u64 {
        self.begin_ms + tick_ms(bus_us)
    }

    /// Hands a recorder the pulses of its board's interrupt line, before it records what came after
    /// them.
    pub fn hand_in_pulses(&mut self, index: usize, node: &mut SimNode<'_>, ledger: &mut Ledger) {
        let pulses = self.units[index].port.window().inner().take_interrupts();
        let has_line = self.units[index].has_line;
        for at_us in pulses.into_iter().filter(|_| has_line) {
            let at_ms = self.ms(at_us);
            node.interrupt(&mut self.units[index].port, at_ms);
        }
        ledger.wait_after(self.untaken_since_ms(index));
    }

    /// Since when the oldest datagram waits that a recorder still has to take from its board. The
    /// recorder knows it by its interrupt line or by its looks. From a board that has failed it
    /// will take nothing.
    fn untaken_since_ms(&mut self, index: usize) -> Option<u64> {
        let UnitPort { port, board, tap, has_line, gone_since_ms, .. } = &mut self.units[index];
        if !port.is_ready() {
            *gone_since_ms = None;
            return None;
        }
        if !*has_line {
            return tap.borrow().untaken_since_look_ms();
        }
        let gone_since_ms = *gone_since_ms;
        let bus = self.bus.borrow();
        let untaken_us = tap.borrow().untaken_since_us(bus.get(*board));
        gone_since_ms.or(untaken_us.map(|us| self.ms(us)))
    }

    /// When a message counts as arrived: in the millisecond of its pulse, or of the look that saw
    /// its flag; `None` if there was no such look.
    ///
    /// # Errors
    /// When a look lies outside its allowed range.
    fn arrived_ms(&self, index: usize, taken: &Taken, now_ms: u64) -> Result<Option<u64>, String> {
        let came_ms = self.ms(taken.arrived_us);
        if self.units[index].has_line {
            return Ok(Some(came_ms));
        }
        match taken.seen_ms {
            Some(seen_ms) if !(came_ms..=now_ms).contains(&seen_ms) => Err(format!(
                "a datagram of {came_ms} ms counts as arrived at {seen_ms} ms, and is read at \
                 {now_ms} ms"
            )),
            seen_ms => Ok(seen_ms),
        }
    }

    /// Lets the port of a recorder work whose node has come to the present.
    ///
    /// # Errors
    /// When a datagram counts as arrived at a time at which it cannot have been seen.
    pub fn serve(
        &mut self,
        index: usize,
        now_ms: u64,
        node: &mut SimNode<'_>,
        ledger: &mut Ledger,
    ) -> Result<(), String> {
        let UnitPort { port, tap, failures, held, .. } = &mut self.units[index];
        tap.borrow_mut().begin(now_ms);
        node.serve(port);
        let was_held = std::mem::replace(held, port.reset_held());
        port.window().inner().drive_reset(*held);
        let messages = tap.borrow_mut().end();
        let counts = ledger.expected.genius.get_or_insert_default();
        counts.resets += u32::from(*held && !was_held);
        counts.ignored = tap.borrow().ignored;
        counts.requests += tap.borrow_mut().take_forces_asked();
        let failed = port.diagnostics().board.failures;
        if std::mem::replace(failures, failed) != failed {
            tap.borrow_mut().board_failed();
        }
        for taken in messages {
            let arrived_ms = self.arrived_ms(index, &taken, now_ms)?;
            process(&taken, arrived_ms, now_ms, ledger);
        }
        ledger.wait_after(self.untaken_since_ms(index));
        Ok(())
    }

    /// Lets the host look at its board and do what it wants to do now.
    ///
    /// # Errors
    /// When a recorder's log is not what it must be.
    pub fn act(
        &mut self,
        now_ms: u64,
        errand: Errand,
        host: &mut BusHost,
        ledgers: &mut [&mut Ledger],
        trail: &Trail,
    ) -> Result<(), String> {
        #[expect(clippy::cast_possible_truncation, reason = "the count wraps")]
        let event = self.driver.poll(now_ms as u32);
        if let Some(Event::Received(received)) = event
            && (received.function, received.subfunction, received.broadcast)
                == (FUNCTION_HORNER, SUBFUNCTION_SER, false)
            && let Some(index) = self.units.iter().position(|unit| unit.number == received.source)
        {
            trail.mark(&received.data);
            if let Ok(reply) = Reply::parse(&received.data) {
                ledgers[index].replied(Port::Bus, &reply)?;
            }
            host.talks[index].session().process_body(Duration::from_millis(now_ms), &received.data);
        }
        let held = self.driver.reset_held();
        self.driver.ram_mut().drive_reset(held);
        host.begin_next(now_ms, errand, trail);
        for (index, talk) in host.talks.iter_mut().enumerate() {
            if let Some(outgoing) = talk.poll(now_ms, ledgers[index])? {
                let number = self.units[index].number;
                host.outgoing.push_back(message(Destination::Device(number), &outgoing.command));
            }
        }
        if self.driver.can_transmit()
            && let Some(next) = host.outgoing.pop_front()
        {
            // A recorder that is not there does not answer, and is asked again.
            let _ = self.driver.transmit(next);
        }
        Ok(())
    }

    /// Lets something go wrong, if it is time.
    pub fn suffer(&mut self, now_ms: u64, trail: &Trail) {
        if now_ms < self.next_fault_ms {
            return;
        }
        self.next_fault_ms = now_ms + self.chance.spread(500..=60_000);
        let fault = self.any_fault();
        trail.note(format_args!("bus: {fault:?}"));
        if let Fault::Inside { device, fault: DeviceFault::Reset } = fault {
            self.host_restarted |= device == self.host.id();
            if let Some(index) = self.units.iter().position(|unit| device == unit.board.id()) {
                self.units[index].restarted = true;
                self.units[index].gone_since_ms = self.untaken_since_ms(index);
            }
        }
        self.bus.borrow_mut().inject(fault);
    }

    fn any_fault(&mut self) -> Fault {
        let chance = &mut self.chance;
        let boards: Vec<DeviceId> =
            self.units.iter().map(|unit| unit.board.id()).chain([self.host.id()]).collect();
        let everybody: Vec<DeviceId> = boards.iter().chain(&self.others).copied().collect();
        let few = |chance: &mut Chance, most| u32::try_from(chance.spread(1..=most)).unwrap_or(1);
        let inside = match chance.below(10) {
            0 => return Fault::Damage { messages: few(chance, 50) },
            1 => return Fault::Deafen { device: chance.pick(&boards), messages: few(chance, 300) },
            2 => {
                let for_us = chance.spread(1_000..=10_000_000);
                return Fault::Disconnect { device: chance.pick(&everybody), for_us };
            }
            3 => {
                // Somebody sets the switches of another device to a recorder's bus address, and
                // back.
                let number = chance.pick(&[FIRST_UNIT, DEAF]);
                return Fault::Inside {
                    device: self.others[0],
                    fault: DeviceFault::ChangeAddress(number),
                };
            }
            4 => DeviceFault::Hang,
            5 => DeviceFault::Reset,
            6 => DeviceFault::FailSelfTest(1 << chance.below(4)),
            7 => DeviceFault::FailNextStart(1 << chance.below(4)),
            8 => DeviceFault::AnswerLate { by_us: chance.below(40_000) },
            _ => DeviceFault::OutOfMemory { datagrams: few(chance, 10) },
        };
        Fault::Inside { device: chance.pick(&boards), fault: inside }
    }

    /// From now on nobody makes anything go wrong.
    pub fn mend(&mut self, trail: &Trail) {
        trail.note("bus: mended");
        let mut bus = self.bus.borrow_mut();
        bus.inject(Fault::Inside {
            device: self.others[0],
            fault: DeviceFault::ChangeAddress(DEAF),
        });
        for device in self.units.iter().map(|unit| unit.board.id()).chain([self.host.id()]) {
            bus.inject(Fault::Inside { device, fault: DeviceFault::AnswerLate { by_us: 0 } });
        }
    }

    /// What the Genius port of a recorder has counted.
    #[must_use]
    pub fn counted(&self, index: usize) -> GeniusDiagnostics {
        self.units[index].port.diagnostics()
    }

    /// Checks that all hosts have kept to the rules of their boards.
    ///
    /// # Errors
    /// When one has not.
    pub fn check(&self) -> Result<(), String> {
        let bus = self.bus.borrow();
        let boards = self.units.iter().map(|unit| (unit.number, unit.board, unit.restarted));
        for (number, board, restarted) in boards.chain([(HOST, self.host, self.host_restarted)]) {
            // Nobody tells a host that its board has started anew by itself. The host finds out by
            // looking.
            let allowed = |kind| restarted && kind == ViolationKind::TooEarly;
            let broken =
                bus.get(board).violations().iter().find(|violation| !allowed(violation.kind));
            if let Some(violation) = broken {
                return Err(format!("device {number} breaks a rule of its board: {violation}"));
            }
        }
        Ok(())
    }
}
