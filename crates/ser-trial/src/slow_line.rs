//! A recorder at the end of a line that takes its time, in virtual time: bytes at their rate, an
//! adapter that holds them back, a host and a main loop that are away now and then, and replies that
//! are lost or come late.
//!
//! The world knows when each question really arrived, so a test can hold against it what a host
//! takes for certain.

use std::collections::VecDeque;
use std::io;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use oorandom::Rand64;
use ser_client::{Clock, Options, Transport, Unit};
use ser_proto::{Baud, ESC};
use ser_sim::{LineRate, Ram, Scenario, SimNode, SimNodeOptions, Step};

/// Start bit, eight data bits, stop bit.
const BITS_PER_BYTE: u64 = 10;

/// More than the bytes of the questions that may still be answered.
const ARRIVALS_KEPT: usize = 256;

const NS_PER_US: u64 = 1000;
const NS_PER_MS: u64 = 1_000_000;

/// What a line and its two ends are like.
#[derive(Clone, Copy, Debug)]
pub struct SlowLine {
    /// The rate, in both directions.
    pub baud: Baud,
    /// When the recorder's first millisecond begins, in nanoseconds.
    pub phase_ns: u64,
    /// How much faster the recorder's clock is than the host's, in parts per million.
    pub fast_ppm: i32,
    /// What an adapter on the way to the host holds back: it hands over what has come so often.
    pub adapter: Option<Duration>,
    /// How long the host may be away, each time that it sends or waits.
    pub host_away: Duration,
    /// How long the recorder's main loop may be away, each time that a byte comes.
    pub recorder_away: Duration,
    /// One of so many replies is lost; 0 for none.
    pub loses: u64,
    /// One of so many replies is held up for seconds; 0 for none.
    pub holds_up: u64,
    /// From which all chance follows.
    pub seed: u64,
}

impl SlowLine {
    /// A quiet line: nothing is lost, and nobody is away.
    #[must_use]
    pub fn quiet(baud: Baud) -> SlowLine {
        SlowLine {
            baud,
            phase_ns: 350_000,
            fast_ppm: 0,
            adapter: None,
            host_away: Duration::ZERO,
            recorder_away: Duration::ZERO,
            loses: 0,
            holds_up: 0,
            seed: 1,
        }
    }
}

/// A recorder, the bytes on their way to it and back, and the time.
struct State {
    line: SlowLine,
    node: SimNode<'static>,
    chance: Rand64,
    now_ns: u64,
    /// Bytes on their way, with the time at which their stop bits end.
    to_recorder: VecDeque<(u64, u8)>,
    to_host: VecDeque<(u64, u8)>,
    /// When the last byte of each direction has left.
    sent_ns: u64,
    replied_ns: u64,
    /// Until when the recorder's main loop is away, and what has arrived meanwhile.
    away_until_ns: u64,
    arrived: VecDeque<(u64, u8)>,
    /// When the latest bytes really arrived.
    arrivals: VecDeque<u64>,
    /// Whether the reply that is being said is lost.
    is_lost: bool,
}

/// The world: a clock for hosts, and the truth for tests. Clones share it.
#[derive(Clone)]
pub struct SlowWorld(Arc<Mutex<State>>);

/// The host's end of the line.
struct HostEnd(SlowWorld);

impl SlowWorld {
    /// A recorder that has just been switched on, at the end of this line.
    #[must_use]
    pub fn new(line: SlowLine, options: SimNodeOptions) -> SlowWorld {
        // It lives as long as its host, which has no fixed lifetime.
        let ram = Box::leak(Box::new(Ram::new()));
        let node = SimNode::new(SimNodeOptions { line_rate: LineRate::Unlimited, ..options }, ram);
        SlowWorld(Arc::new(Mutex::new(State {
            line,
            node,
            chance: Rand64::new(line.seed.into()),
            now_ns: line.phase_ns,
            to_recorder: VecDeque::new(),
            to_host: VecDeque::new(),
            sent_ns: 0,
            replied_ns: 0,
            away_until_ns: 0,
            arrived: VecDeque::new(),
            arrivals: VecDeque::new(),
            is_lost: false,
        })))
    }

    /// A host of the recorder.
    #[must_use]
    pub fn host(&self, options: Options) -> Unit {
        Unit::with_clock(Box::new(HostEnd(self.clone())), options, Arc::new(self.clone()))
    }

    /// Whether a byte arrived at the recorder at this time, to two microseconds.
    #[must_use]
    pub fn was_an_arrival(&self, at: Duration) -> bool {
        let state = self.lock();
        let is_near = |ns: &u64| Duration::from_nanos(*ns).abs_diff(at) <= Duration::from_micros(2);
        state.arrivals.iter().any(is_near)
    }

    /// When the recorder's tick showed this, by the clock of the host.
    #[must_use]
    pub fn when_tick_was(&self, tick_us: u64) -> Duration {
        let state = self.lock();
        let ns = u128::from(tick_us) * u128::from(state.tick_ns()) / 1000;
        Duration::from_nanos(state.line.phase_ns + u64::try_from(ns).unwrap_or(u64::MAX))
    }

    /// Moves an input in the next millisecond of the recorder, and returns when that begins.
    pub fn move_input(&self, input: u8, on: bool) -> Duration {
        let mut state = self.lock();
        let tick_ms = state.node.play(&Scenario::from_steps([Step { at_ms: 0, input, on }]));
        Duration::from_nanos(state.line.phase_ns + tick_ms * state.tick_ns())
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    /// How long a millisecond of the recorder lasts, in nanoseconds.
    fn tick_ns(&self) -> u64 {
        // A millionth of a millisecond is a nanosecond.
        NS_PER_MS.saturating_add_signed(-i64::from(self.line.fast_ppm))
    }

    fn byte_ns(&self) -> u64 {
        BITS_PER_BYTE * 1_000_000_000 / u64::from(self.line.baud.bits_per_second())
    }

    /// The millisecond of the recorder at this time.
    fn tick_at(&self, ns: u64) -> u64 {
        ns.saturating_sub(self.line.phase_ns) / self.tick_ns()
    }

    /// Up to this long, by chance.
    fn some(&mut self, most: Duration) -> u64 {
        let most = u64::try_from(most.as_nanos()).unwrap_or(u64::MAX);
        if most == 0 { 0 } else { self.chance.rand_range(0..most) }
    }

    fn happens(&mut self, one_in: u64) -> bool {
        one_in > 0 && self.chance.rand_range(0..one_in) == 0
    }

    /// Lets time pass, and everything happen that is due until then.
    fn advance_to(&mut self, until_ns: u64) {
        loop {
            let next_tick = self.line.phase_ns + (self.tick_at(self.now_ns) + 1) * self.tick_ns();
            let next_byte = self.to_recorder.front().map_or(u64::MAX, |&(ns, _)| ns);
            let next = next_tick.min(next_byte.max(self.now_ns));
            if next > until_ns {
                self.now_ns = self.now_ns.max(until_ns);
                return;
            }
            self.now_ns = next;
            if let Some(&(ns, byte)) = self.to_recorder.front()
                && ns <= next
            {
                self.to_recorder.pop_front();
                self.arrive(byte);
            }
            let tick = self.tick_at(self.now_ns);
            if self.now_ns >= self.away_until_ns {
                self.node.advance_to(tick);
                self.take_arrived();
                self.reply();
            }
        }
    }

    /// A byte arrives in the recorder's interrupt. Its main loop may be away then.
    fn arrive(&mut self, byte: u8) {
        self.arrivals.push_back(self.now_ns);
        if self.arrivals.len() > ARRIVALS_KEPT {
            self.arrivals.pop_front();
        }
        self.arrived.push_back((self.now_ns, byte));
        let away = self.line.recorder_away;
        self.away_until_ns = self.away_until_ns.max(self.now_ns + self.some(away));
    }

    /// The main loop takes what has arrived, each byte with the moment of its arrival.
    fn take_arrived(&mut self) {
        while let Some((ns, byte)) = self.arrived.pop_front() {
            let tick = self.tick_at(ns);
            let since = ns - self.line.phase_ns - tick * self.tick_ns();
            let us = u16::try_from(since / NS_PER_US).unwrap_or(u16::MAX);
            self.node.receive_late(byte, tick, us);
        }
    }

    /// What the recorder says goes onto the line.
    fn reply(&mut self) {
        let byte_ns = self.byte_ns();
        for byte in self.node.take_output() {
            if byte == ESC {
                self.is_lost = self.happens(self.line.loses);
                if self.happens(self.line.holds_up) {
                    self.replied_ns =
                        self.now_ns + 1_000 * NS_PER_MS + self.some(Duration::from_secs(2));
                }
            }
            self.replied_ns = self.replied_ns.max(self.now_ns) + byte_ns;
            if self.is_lost {
                continue;
            }
            let at = match self.line.adapter {
                None => self.replied_ns,
                Some(every) => {
                    let every = u64::try_from(every.as_nanos()).unwrap_or(u64::MAX);
                    self.replied_ns.next_multiple_of(every)
                }
            };
            self.to_host.push_back((at, byte));
        }
    }
}

impl Clock for SlowWorld {
    fn now(&self) -> Duration {
        Duration::from_nanos(self.lock().now_ns)
    }

    fn wait(&self, time: Duration) {
        let mut state = self.lock();
        let until = state.now_ns + u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
        state.advance_to(until);
    }
}

impl Transport for HostEnd {
    fn read(&mut self, buf: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let mut state = self.0.lock();
        let until = state.now_ns + u64::try_from(timeout.as_nanos()).unwrap_or(u64::MAX);
        while state.to_host.front().is_none_or(|&(ns, _)| ns > state.now_ns) {
            if state.now_ns >= until {
                return Ok(0);
            }
            let next = state.to_host.front().map_or(until, |&(ns, _)| ns.min(until));
            let step = next.min(state.now_ns + NS_PER_MS);
            state.advance_to(step);
        }
        // The host comes back a little later, and finds all that has come meanwhile.
        let away = state.line.host_away;
        let back = state.now_ns + state.some(away);
        state.advance_to(back);
        let now_ns = state.now_ns;
        let come = state.to_host.iter().take_while(|&&(ns, _)| ns <= now_ns).count();
        let count = come.min(buf.len());
        for (place, (_, byte)) in buf.iter_mut().zip(state.to_host.drain(..count)) {
            *place = byte;
        }
        Ok(count)
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut state = self.0.lock();
        let away = state.line.host_away;
        let mut at_ns = state.now_ns + state.some(away);
        at_ns = at_ns.max(state.sent_ns);
        let byte_ns = state.byte_ns();
        for &byte in bytes {
            at_ns += byte_ns;
            state.to_recorder.push_back((at_ns, byte));
        }
        state.sent_ns = at_ns;
        Ok(())
    }

    fn set_baud(&mut self, _: u32) -> io::Result<()> {
        Ok(())
    }

    fn bits_per_second(&self) -> Option<u32> {
        Some(self.0.lock().line.baud.bits_per_second())
    }
}
