//! The host on the RS-232 line, its wire, and what goes wrong there.

use std::collections::VecDeque;
use std::time::Duration;

use ser_client::LineRate;
use ser_proto::{Baud, Command, ESC, FrameEncoder, Model, encoded_len};
use ser_sim::SimNode;

use super::activity::Tempo;
use super::chance::Chance;
use super::conversation::{Conversation, Order};
use super::ledger::Ledger;
use super::noise::{FrameGuard, Heard, OneIn, travel};
use super::orders::{self, Way};
use super::port::Port;
use super::taps::LineTap;
use super::trail::Trail;

const NS_PER_MS: u64 = 1_000_000;

/// Start bit, eight data bits, stop bit.
const BITS_PER_BYTE: u64 = 10;

/// How long the host waits at each rate, as the client does when it looks for a recorder's rate.
const SEARCH_TIMEOUT: Duration = Duration::from_millis(250);
const USUAL_TIMEOUT: Duration = Duration::from_secs(1);
const USUAL_RETRIES: u32 = 2;

/// How long a host waits when nothing answers at any rate.
const SEARCH_AGAIN_MS: u64 = 20_000;

/// The time limit of commands on the line: the recorder never gives one up.
const NEVER: u64 = u64::MAX;

/// What may be asked for now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Errand {
    /// Anything.
    Any,
    /// Only what is new in the log, in a reading that begins at this time or later.
    CatchUp {
        /// When everything has come to rest.
        since_ms: u64,
    },
}

/// A byte on its way to the recorder, its rate, and when it arrives.
struct OnTheWay {
    at_ns: u64,
    byte: u8,
    baud: Baud,
}

impl OnTheWay {
    /// The tick that the recorder's interrupt reads when the byte arrives. It is that of the latest
    /// sample, as with the pulses of a GENI board.
    fn tick_ms(&self) -> u64 {
        self.at_ns / NS_PER_MS
    }
}

/// The host and its line.
pub struct LineHost {
    /// Its conversation.
    pub talk: Conversation,
    chance: Chance,
    baud: Baud,
    on_the_way: VecDeque<OnTheWay>,
    free_ns: u64,
    tempo: Tempo,
    next_order_ms: u64,
    search_again_ms: u64,
    stuck_until_ms: u64,
    /// The line is bad until then.
    bad_until_ms: u64,
    one_in: OneIn,
    guard: FrameGuard,
    /// The rate that is tried next in the search for the recorder's rate, and the one to return to.
    seeking: Option<(usize, Baud)>,
    tap: LineTap,
    /// What was printed in earlier lives.
    printed_before: (u64, u64),
    heard: Vec<Heard>,
}

impl LineHost {
    /// A host that has not said anything yet, at the rate of a new recorder.
    #[must_use]
    pub fn new(chance: Chance) -> LineHost {
        let baud = Baud::default();
        let mut host = LineHost {
            talk: Conversation::new("line", LineRate::BitsPerSecond(baud.bits_per_second())),
            chance,
            baud,
            on_the_way: VecDeque::new(),
            free_ns: 0,
            tempo: Tempo::Plant,
            next_order_ms: 0,
            search_again_ms: 0,
            stuck_until_ms: 0,
            bad_until_ms: 0,
            one_in: None,
            guard: FrameGuard::new(),
            seeking: None,
            tap: LineTap::new(),
            printed_before: (0, 0),
            heard: Vec::new(),
        };
        host.set_baud(baud);
        host
    }

    /// Damaged frames that looked intact.
    #[must_use]
    pub fn forged(&self) -> u64 {
        self.guard.stopped()
    }

    /// The number of events printed, and the number of events and edges reported as not printed.
    #[must_use]
    pub fn printed(&self) -> (u64, u64) {
        let (printed, missing) = self.tap.printout.counts();
        (self.printed_before.0 + printed, self.printed_before.1 + missing)
    }

    /// The recorder has been switched off and on. What was on the line is gone.
    pub fn power_cycled(&mut self) {
        self.on_the_way.clear();
        self.printed_before = self.printed();
        self.tap = LineTap::new();
        self.guard = FrameGuard::new();
        self.set_baud(self.baud);
    }

    /// The recorder is switched on in a plant that is this busy.
    pub fn power_comes_on(&mut self, now_ms: u64, tempo: Tempo) {
        self.tempo = tempo;
        self.next_order_ms = now_ms;
    }

    /// The line is bad for a while.
    pub fn disturb(&mut self, until_ms: u64, one_in: u64) {
        self.bad_until_ms = until_ms;
        self.one_in = Some(one_in);
    }

    /// The line is good again, and the host is not stuck.
    pub fn mend(&mut self) {
        self.bad_until_ms = 0;
        self.stuck_until_ms = 0;
    }

    /// The host does not look at its port for a while.
    pub fn get_stuck(&mut self, until_ms: u64) {
        self.stuck_until_ms = until_ms;
    }

    /// Bytes from elsewhere get onto the line.
    pub fn stray_bytes(&mut self, now_ms: u64) {
        let count = self.chance.spread(1..=60);
        let bytes: Vec<u8> = (0..count)
            .map(|_| if self.chance.one_in(4) { 0x1B } else { self.chance.byte() })
            .collect();
        self.send(now_ms, &bytes);
        for _ in 0..self.chance.below(4) {
            let odd = framed(&orders::odd_body(&mut self.chance));
            self.send(now_ms, &odd);
        }
    }

    /// Sends many commands at once without waiting for an answer.
    pub fn flood(&mut self, now_ms: u64) {
        for _ in 0..self.chance.within(17..=40) {
            let command = match orders::next_order(&mut self.chance, Way::Line) {
                Order::Ask(command) => command,
                Order::Read | Order::SetClock(_) => Command::Read { start: 1, count: 10 },
            };
            let frame: Vec<u8> = FrameEncoder::new(command.to_body()).collect();
            self.send(now_ms, &frame);
        }
    }

    fn line_rate(&self) -> LineRate {
        LineRate::BitsPerSecond(self.baud.bits_per_second())
    }

    fn set_baud(&mut self, baud: Baud) {
        self.baud = baud;
        self.guard.forget();
        let rate = self.line_rate();
        self.talk.session().set_line_rate(rate);
    }

    fn send(&mut self, now_ms: u64, bytes: &[u8]) {
        let byte_ns = BITS_PER_BYTE * 1_000_000_000 / u64::from(self.baud.bits_per_second());
        let mut at_ns = self.free_ns.max(now_ms * NS_PER_MS);
        for &byte in bytes {
            at_ns += byte_ns;
            self.on_the_way.push_back(OnTheWay { at_ns, byte, baud: self.baud });
        }
        self.free_ns = at_ns;
    }

    /// When something happens next, if the recorder says nothing.
    #[must_use]
    pub fn next_ms(&self, now_ms: u64, errand: Errand) -> u64 {
        let byte_ms = self.on_the_way.front().map_or(NEVER, OnTheWay::tick_ms);
        if now_ms < self.stuck_until_ms {
            return byte_ms.min(self.stuck_until_ms);
        }
        let order_ms = if self.talk.is_resting() { self.order_ms(errand) } else { NEVER };
        byte_ms.min(order_ms).min(self.talk.wake_ms().unwrap_or(NEVER))
    }

    /// When a resting host begins something.
    fn order_ms(&self, errand: Errand) -> u64 {
        match errand {
            _ if self.is_searching() => self.search_again_ms,
            Errand::Any if !self.talk.is_behind() => self.next_order_ms,
            Errand::CatchUp { since_ms } if self.talk.has_read_since(since_ms) => NEVER,
            Errand::Any | Errand::CatchUp { .. } => 0,
        }
    }

    /// Whether the host looks for the rate at which the recorder talks.
    #[must_use]
    pub fn is_searching(&self) -> bool {
        self.seeking.is_some() || self.talk.failures() >= 2
    }

    /// Hands the recorder what has arrived by now.
    pub fn deliver(&mut self, now_ms: u64, node: &mut SimNode<'_>, ledger: &mut Ledger) {
        while self.on_the_way.front().is_some_and(|first| first.tick_ms() <= now_ms) {
            let Some(OnTheWay { byte, baud, .. }) = self.on_the_way.pop_front() else { break };
            let one_in = self.one_in.filter(|_| now_ms < self.bad_until_ms);
            let mut heard = std::mem::take(&mut self.heard);
            travel(byte, one_in, baud != node.baud(), &mut self.chance, &mut heard);
            for heard in heard.drain(..) {
                match heard {
                    Heard::Byte(byte) => self.hand_in(byte, now_ms, node, ledger),
                    Heard::Error => {
                        ledger.expected.exact.line_errors += 1;
                        node.line_error();
                    }
                }
            }
            self.heard = heard;
        }
    }

    fn hand_in(&mut self, byte: u8, now_ms: u64, node: &mut SimNode<'_>, ledger: &mut Ledger) {
        match self.tap.goes_in(byte, node.has_room(), &mut ledger.expected) {
            Some(Command::SetClock(time)) => ledger.set_clock(Port::Line, now_ms, time),
            Some(Command::SetMode { recording }) => ledger.set_recording(now_ms, recording),
            Some(Command::Time { token }) => ledger.time_asked(Port::Line, token, now_ms),
            Some(command) => ledger.command_arrived(Port::Line, &command, NEVER),
            None => {}
        }
        node.receive(&[byte]);
    }

    /// Takes what the recorder has said.
    ///
    /// # Errors
    /// When it is nothing that a recorder may say.
    pub fn listen(
        &mut self,
        now_ms: u64,
        node: &mut SimNode<'_>,
        ledger: &mut Ledger,
        trail: &Trail,
    ) -> Result<(), String> {
        if now_ms < self.stuck_until_ms || node.output().is_empty() {
            return Ok(());
        }
        let (bytes, baud) = (node.output().to_vec(), node.baud());
        trail.mark(&bytes);
        let one_in = self.one_in.filter(|_| now_ms < self.bad_until_ms);
        let mut heard = std::mem::take(&mut self.heard);
        for byte in &bytes {
            if let Some(reply) = self.tap.comes_out(*byte, ledger)? {
                ledger.expected.unprinted = narrow(self.tap.printout.unprinted());
                ledger.replied(Port::Line, &reply)?;
            }
            self.guard.said(*byte);
            travel(*byte, one_in, baud != self.baud, &mut self.chance, &mut heard);
        }
        let heard_bytes = heard.drain(..).filter_map(|heard| match heard {
            Heard::Byte(byte) => Some(self.guard.heard(byte)),
            Heard::Error => None,
        });
        let arrived: Vec<u8> = heard_bytes.collect();
        self.heard = heard;
        self.talk.session().process(Duration::from_millis(now_ms), &arrived);
        node.taken(bytes.len());
        Ok(())
    }

    /// Lets the host do what it wants to do now.
    ///
    /// # Errors
    /// When the recorder's log is not what it must be.
    pub fn act(
        &mut self,
        now_ms: u64,
        errand: Errand,
        ledger: &Ledger,
        trail: &Trail,
    ) -> Result<(), String> {
        if now_ms < self.stuck_until_ms {
            return Ok(());
        }
        if self.talk.is_resting() && self.order_ms(errand) <= now_ms {
            self.begin_next(now_ms, errand, trail);
        }
        while let Some(outgoing) = self.talk.poll(now_ms, ledger)? {
            self.send(now_ms, &outgoing.frame);
        }
        if let Some(in_force) = self.talk.take_in_force()
            && in_force.baud != self.baud
            && self.seeking.is_none()
        {
            self.set_baud(in_force.baud);
        }
        Ok(())
    }

    fn begin_next(&mut self, now_ms: u64, errand: Errand, trail: &Trail) {
        if self.is_searching() {
            return self.seek(now_ms, trail);
        }
        let order = match errand {
            Errand::Any if !self.talk.is_behind() => {
                orders::next_order(&mut self.chance, Way::Line)
            }
            _ => Order::Read,
        };
        if !matches!(order, Order::Read) {
            trail.note(format_args!("line: {order:?}"));
        }
        self.talk.begin(order, now_ms);
        let pause_ms = match self.chance.below(10) {
            _ if self.tempo != Tempo::Plant => self.chance.spread(20..=3_000),
            0..5 => self.chance.spread(20..=5_000),
            5..9 => self.chance.spread(1_000..=600_000),
            _ => self.chance.within(600_000..=4 * 3_600_000),
        };
        self.next_order_ms = now_ms + pause_ms;
    }

    /// Asks at one rate after the other, as the client does.
    fn seek(&mut self, now_ms: u64, trail: &Trail) {
        let (index, usual) = match self.seeking {
            None => (0, self.baud),
            Some((_, usual)) if self.talk.failures() == 0 => {
                trail.note(format_args!("line: found at {:?} after {usual:?}", self.baud));
                return self.end_search(self.baud);
            }
            Some((index, usual)) => (index + 1, usual),
        };
        let Some(&baud) = Baud::ALL.iter().rev().nth(index) else {
            self.end_search(usual);
            self.search_again_ms = now_ms + SEARCH_AGAIN_MS;
            return;
        };
        self.seeking = Some((index, usual));
        self.set_baud(baud);
        let question = Command::Read { start: 1, count: 1 };
        let bytes =
            encoded_len(question.to_body().len()) + encoded_len(Model::Ser320.read_reply_len(1));
        let patience = SEARCH_TIMEOUT + self.line_rate().time_for(bytes);
        self.talk.session().set_line_rate(LineRate::Instant);
        self.talk.session().set_patience(patience, 0);
        self.talk.begin(Order::Ask(question), now_ms);
    }

    fn end_search(&mut self, baud: Baud) {
        self.seeking = None;
        self.set_baud(baud);
        self.talk.session().set_patience(USUAL_TIMEOUT, USUAL_RETRIES);
    }
}

/// The frame around a body that need not be a command.
fn framed(body: &[u8]) -> Vec<u8> {
    let len = u8::try_from(body.len()).unwrap_or(u8::MAX);
    let sum = body.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
    let bytes = [len].into_iter().chain(body.iter().copied()).chain([sum]);
    let digits: String = bytes.map(|byte| format!("{byte:02X}")).collect();
    [&[ESC], digits.as_bytes()].concat()
}

fn narrow(count: u64) -> u32 {
    u32::try_from(count).unwrap_or(u32::MAX)
}
