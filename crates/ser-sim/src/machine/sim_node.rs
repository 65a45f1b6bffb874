//! A recorder in virtual time: the recorder itself, its contacts and both ends of its line.
//!
//! Time passes only when [`SimNode::advance_to`] says so. Every millisecond then passes in order:
//! contacts due in that millisecond move, all inputs are sampled, the recorder's main loop runs.
//! However the caller is delayed, a contact moves in exactly the millisecond that its scenario
//! gives. [`SimNode::leap_to`] has the same result but passes over stretches in which nothing can
//! happen, so a quiet month takes no longer than a busy second.

use std::collections::VecDeque;

use geni_board::SharedRam;
use ser_node::{
    Capture, CaptureChannel, Debounce, DebounceTimes, Diagnostics, Event, GeniusPort, Node,
    NodeParts, TickStamp, Work,
};
use ser_proto::{Baud, Entry, MAX_SIZE, Model};

use crate::contacts::player::{Played, Player};
use crate::contacts::scenario::Scenario;
use crate::contacts::scenario_lines::Item;
use crate::machine::non_volatile::{MemoryStorage, NonVolatile, SimRtc};

/// How many bytes may wait for the other end of the line. At that limit the node is asked for no
/// more.
const OUTPUT_LIMIT: usize = 4096;

const NANOSECONDS_PER_MS: u64 = 1_000_000;

/// What a byte (start bit, eight data bits, stop bit) takes on the line, in nanoseconds at one bit
/// per second.
const BYTE_AT_1_BAUD_NS: u64 = 10 * 1_000_000_000;

/// The longest stretch that is passed over at once. A recorder can compare two ticks only if they
/// are less than 24.8 days apart.
const LONGEST_LEAP_MS: u64 = 1 << 30;

/// How fast the recorder's bytes leave it. Over TCP, those of the host take as long.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LineRate {
    /// At once.
    #[default]
    Unlimited,
    /// As the configured rate allows, ten bit times per byte.
    Real,
}

/// How a recorder is built.
#[derive(Clone, Debug)]
pub struct SimNodeOptions {
    /// Which recorder it is.
    pub model: Model,
    /// Debounce times.
    pub debounce: Debounce,
    /// How fast the recorder's bytes leave it.
    pub line_rate: LineRate,
    /// Configuration memory and clock.
    pub non_volatile: NonVolatile,
}

impl SimNodeOptions {
    /// No debounce, no line delay, fresh memory, the clock of this computer.
    #[must_use]
    pub fn new(model: Model) -> SimNodeOptions {
        SimNodeOptions {
            model,
            debounce: Debounce::OFF,
            line_rate: LineRate::Unlimited,
            non_volatile: NonVolatile::new(),
        }
    }
}

/// The memory that a recorder loses with its power.
pub struct Ram {
    channel: CaptureChannel,
    log: Vec<Event>,
    work: Work,
}

impl Ram {
    /// Memory for a log of the full size.
    #[must_use]
    pub fn new() -> Ram {
        Ram {
            channel: CaptureChannel::new(),
            log: vec![Event::EMPTY; MAX_SIZE.into()],
            work: Work::new(),
        }
    }
}

impl Default for Ram {
    fn default() -> Self {
        Ram::new()
    }
}

/// A recorder without power, and its surroundings, in which time stands still.
pub struct PoweredOff {
    options: SimNodeOptions,
    player: Player,
    now_ms: u64,
}

impl PoweredOff {
    /// A recorder that has never been switched on, all contacts open, at millisecond 0.
    #[must_use]
    pub fn new(options: SimNodeOptions) -> PoweredOff {
        PoweredOff { options, player: Player::default(), now_ms: 0 }
    }

    /// Switches the recorder on. It already samples its inputs in the present millisecond.
    pub fn power_up(self, ram: &mut Ram) -> SimNode<'_> {
        let PoweredOff { options, player, now_ms } = self;
        // Memory may hold anything after a power cut, and a recorder must not rely on it.
        *ram = Ram::new();
        let (mut capture, reader) = ram.channel.split(options.debounce);
        capture.sample(0, player.state());
        let mut node = Node::new(NodeParts {
            model: options.model,
            log: &mut ram.log,
            work: &mut ram.work,
            capture: reader,
            storage: options.non_volatile.storage.clone(),
            rtc: options.non_volatile.rtc.clone(),
            id: options.non_volatile.id,
        });
        node.poll(0);
        let baud = node.baud();
        SimNode {
            node,
            capture,
            player,
            played: Vec::new(),
            now_ms,
            power_up_ms: now_ms,
            moved_ms: now_ms,
            leapt_ms: 0,
            debounce: options.debounce,
            options,
            baud,
            on_the_line: None,
            output: VecDeque::new(),
        }
    }
}

/// A recorder under power.
pub struct SimNode<'a> {
    node: Node<'a, MemoryStorage, SimRtc>,
    capture: Capture<'a>,
    player: Player,
    played: Vec<Played>,
    now_ms: u64,
    power_up_ms: u64,
    /// When a contact moved last.
    moved_ms: u64,
    /// Milliseconds that were passed over. The node counts them as samples that it missed.
    leapt_ms: u64,
    options: SimNodeOptions,
    /// The debounce times by which the inputs are sampled.
    debounce: Debounce,
    /// The rate at which the line runs.
    baud: Baud,
    /// The byte being sent at the real rate, and when its stop bit ends, in nanoseconds.
    on_the_line: Option<(u8, u64)>,
    /// Bytes that have left the node and not been taken.
    output: VecDeque<u8>,
}

impl<'a> SimNode<'a> {
    /// A recorder that is switched on for the first time.
    pub fn new(options: SimNodeOptions, ram: &'a mut Ram) -> SimNode<'a> {
        PoweredOff::new(options).power_up(ram)
    }

    /// Cuts the power. Contacts stay as they are, and scenarios go on when time does.
    #[must_use]
    pub fn power_off(self) -> PoweredOff {
        PoweredOff { options: self.options, player: self.player, now_ms: self.now_ms }
    }

    /// The present, in milliseconds since the first power-up.
    #[must_use]
    pub fn now_ms(&self) -> u64 {
        self.now_ms
    }

    /// The recorder's tick in millisecond `at_ms`, from which stamps are made.
    #[must_use]
    pub fn tick_at(&self, at_ms: u64) -> u32 {
        #[expect(clippy::cast_possible_truncation, reason = "the tick wraps")]
        let tick = at_ms.wrapping_sub(self.power_up_ms) as u32;
        tick
    }

    /// Plays a scenario from the next millisecond on, or after those before it. Returns the
    /// millisecond in which it begins.
    pub fn play(&mut self, scenario: &Scenario) -> u64 {
        self.player.play(self.now_ms, scenario)
    }

    pub(crate) fn stream(&mut self, items: &[Item]) -> Option<u64> {
        self.player.stream(self.now_ms, items)
    }

    pub(crate) fn waiting_steps(&self) -> usize {
        self.player.waiting()
    }

    pub(crate) fn player_mut(&mut self) -> &mut Player {
        &mut self.player
    }

    /// Whether no contact is going to move.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.player.is_idle()
    }

    /// What has moved since this was last asked.
    pub fn take_played(&mut self) -> Vec<Played> {
        std::mem::take(&mut self.played)
    }

    /// When the next contact moves, as far as scenarios are laid out.
    #[must_use]
    pub fn next_move_ms(&self) -> Option<u64> {
        self.player.next_due_ms()
    }

    /// Lets every millisecond up to and including `ms` pass. An `ms` in the past changes nothing.
    pub fn advance_to(&mut self, ms: u64) {
        while self.now_ms < ms {
            self.change_debounce();
            self.pass_ms();
            self.node.poll(self.tick_at(self.now_ms));
            self.pump();
        }
    }

    /// Does the same as [`advance_to`](Self::advance_to), much faster where nothing happens. The
    /// recorder's Genius port must not need service meanwhile.
    ///
    /// A recorder has nothing to do while its inputs stay as they are, its line is silent and it
    /// has nothing to say; it has no other reason to act. For samples that it missed, the recorder
    /// assumes that nothing changed. Here that is true of the samples that are passed over.
    pub fn leap_to(&mut self, ms: u64) {
        while self.now_ms < ms {
            let next_move_ms = self.player.next_due_ms().unwrap_or(u64::MAX);
            let still_until_ms = ms.min(next_move_ms.saturating_sub(1));
            if self.is_at_rest() && still_until_ms > self.now_ms {
                self.pass_over(still_until_ms);
            } else {
                self.advance_to(self.now_ms + 1);
            }
        }
    }

    /// Lets time pass while the recorder's main loop is held up and only its interrupts run, so
    /// changes queue up. The main loop runs again in the last of these milliseconds.
    pub fn hold_up_to(&mut self, ms: u64) {
        while self.now_ms < ms {
            self.pass_ms();
        }
        self.node.poll(self.tick_at(self.now_ms));
        self.pump();
    }

    /// Ages the recorder as if it had been on for that much longer with nothing happening. Its tick
    /// and its clock go on; the tick wraps at 32 bits.
    pub fn grow_older(&mut self, by_ms: u64) {
        let mut left_ms = by_ms;
        while left_ms > 0 {
            let leap_ms = left_ms.min(LONGEST_LEAP_MS);
            left_ms -= leap_ms;
            self.leapt_ms += leap_ms - 1;
            self.power_up_ms = self.power_up_ms.wrapping_sub(leap_ms);
            self.sample_and_poll();
        }
    }

    fn pass_ms(&mut self) {
        self.now_ms += 1;
        let tick = self.tick_at(self.now_ms);
        if let Some(moved) = self.player.due(self.now_ms) {
            self.played.push(moved.played(tick, tick));
            self.moved_ms = self.now_ms;
        }
        self.capture.sample(tick, self.player.state());
    }

    /// Whether nothing is on its way through the filters or onto the line.
    #[must_use]
    pub fn is_at_rest(&self) -> bool {
        // Debounce holds an edge back twice at most: until the change is accepted, and until no
        // earlier one can come.
        let longest_ms = u64::from(self.debounce.longest_ms());
        let settled = self.now_ms - self.moved_ms >= 2 * longest_ms;
        let is_filtering =
            self.node.debounce_change().is_some() || !self.node.chattering().is_empty();
        settled && !is_filtering && self.on_the_line.is_none()
    }

    /// The main loop hands other debounce times over before the next sample.
    fn change_debounce(&mut self) {
        let Some(debounce) = self.node.debounce_change() else { return };
        if self.capture.take_times(&DebounceTimes::new(&debounce)) {
            self.node.debounce_changed(debounce);
            self.debounce = debounce;
        }
    }

    fn pass_over(&mut self, until_ms: u64) {
        let until_ms = until_ms.min(self.now_ms + LONGEST_LEAP_MS);
        self.leapt_ms += until_ms - self.now_ms - 1;
        self.now_ms = until_ms;
        self.sample_and_poll();
    }

    fn sample_and_poll(&mut self) {
        let tick = self.tick_at(self.now_ms);
        self.capture.sample(tick, self.player.state());
        self.node.poll(tick);
    }

    /// Lets a Genius port of the recorder work. To be called once in each millisecond that passes.
    pub fn serve<W: SharedRam>(&mut self, port: &mut GeniusPort<W>) {
        self.node.genius_poll(port);
        self.pump();
    }

    /// The GENI board has pulled its interrupt line in millisecond `at_ms`. To be called before
    /// time passes on.
    pub fn interrupt<W: SharedRam>(&mut self, port: &mut GeniusPort<W>, at_ms: u64) {
        let tick = self.tick_at(at_ms);
        self.node.genius_interrupt(port, tick);
    }

    /// Bytes arrive on the recorder's line in the present millisecond.
    pub fn receive(&mut self, bytes: &[u8]) {
        let tick = self.tick_at(self.now_ms);
        for &byte in bytes {
            self.node.serial_receive(byte, tick);
            self.pump();
        }
    }

    /// A byte has arrived on the recorder's line in millisecond `at_ms`, so many microseconds after
    /// the sample, and its main loop takes it now.
    pub fn receive_late(&mut self, byte: u8, at_ms: u64, us: u16) {
        let tick_ms = self.tick_at(at_ms);
        self.node.serial_receive(byte, TickStamp { tick_ms, us });
        self.pump();
    }

    /// The recorder's UART meets a byte that it cannot read.
    pub fn line_error(&mut self) {
        self.node.serial_line_errors(1);
    }

    /// Bytes that the recorder has sent and nobody has taken.
    #[must_use]
    pub fn output(&mut self) -> &[u8] {
        self.output.make_contiguous()
    }

    /// Says that the first `count` bytes of [`output`](Self::output) have been taken.
    pub fn taken(&mut self, count: usize) {
        self.output.drain(..count.min(self.output.len()));
        self.pump();
    }

    /// Takes everything that the recorder has to say in the present millisecond.
    pub fn take_output(&mut self) -> Vec<u8> {
        let mut bytes = Vec::new();
        self.pump();
        while !self.output.is_empty() {
            bytes.extend(self.output.drain(..));
            self.pump();
        }
        bytes
    }

    /// The rate at which the recorder's line runs.
    #[must_use]
    pub fn baud(&self) -> Baud {
        self.baud
    }

    /// Whether bytes on its line take their time.
    pub(crate) fn is_paced(&self) -> bool {
        self.options.line_rate == LineRate::Real
    }

    /// How many milliseconds were passed over since power-up, which the recorder's own count of missed
    /// samples has. Like that, it stops at the largest value.
    #[must_use]
    pub fn passed_over(&self) -> u32 {
        u32::try_from(self.leapt_ms).unwrap_or(u32::MAX)
    }

    /// What the recorder dropped, refused or lost since power-up. Milliseconds that were passed
    /// over do not count as missed.
    #[must_use]
    pub fn diagnostics(&self) -> Diagnostics {
        let seen = self.node.diagnostics();
        // The node's own count stops at its largest value, reached when 49 days were passed over.
        // From then on it says nothing.
        Diagnostics {
            samples_missed: seen.samples_missed.saturating_sub(self.passed_over()),
            ..seen
        }
    }

    /// How many changes of an input (1–32) were left out as chatter since power-up.
    #[must_use]
    pub fn suppressed(&self, input: u8) -> u32 {
        self.node.suppressed(input)
    }

    /// The log as it is now: the total since the last erase, modulo 65536, and the entries from the
    /// oldest to the newest. Nothing goes over the line for it.
    #[must_use]
    pub fn log(&self) -> (u16, Vec<Entry>) {
        const COUNT: u8 = 10;
        let mut entries: Vec<Entry> = Vec::new();
        for start in (1..=MAX_SIZE).step_by(COUNT.into()) {
            entries.extend(self.node.read(start, COUNT).entries);
        }
        let head = self.node.read(1, 0);
        // In a ring that has wrapped, the oldest entry is in the slot to be written next.
        let oldest = usize::from(head.next_slot).min(entries.len());
        entries.rotate_left(oldest);
        (head.total, entries)
    }

    /// Whether there is room for another command to wait for its turn.
    #[must_use]
    pub fn has_room(&self) -> bool {
        self.node.serial_has_room()
    }

    /// Moves bytes from the node onto the line, and changes the rate when the line is empty.
    fn pump(&mut self) {
        loop {
            if self.output.is_empty()
                && self.on_the_line.is_none()
                && let Some(baud) = self.node.baud_change()
            {
                self.node.baud_changed(baud);
                self.baud = baud;
            }
            if self.output.len() >= OUTPUT_LIMIT {
                return;
            }
            match self.options.line_rate {
                LineRate::Unlimited => match self.node.serial_transmit() {
                    Some(byte) => self.output.push_back(byte),
                    None => return,
                },
                LineRate::Real => {
                    if !self.pump_at_real_rate() {
                        return;
                    }
                }
            }
        }
    }

    /// Ends the byte on the line and begins the next. False when there is nothing to do in this
    /// millisecond.
    fn pump_at_real_rate(&mut self) -> bool {
        let now_ns = self.now_ms * NANOSECONDS_PER_MS;
        let start_ns = match self.on_the_line {
            Some((_, end_ns)) if end_ns > now_ns => return false,
            Some((byte, end_ns)) => {
                self.output.push_back(byte);
                end_ns
            }
            None => now_ns,
        };
        let byte_ns = BYTE_AT_1_BAUD_NS / u64::from(self.baud.bits_per_second());
        self.on_the_line = self.node.serial_transmit().map(|byte| (byte, start_ns + byte_ns));
        self.on_the_line.is_some()
    }
}
