//! A host asks the ARM image for the time, at several rates of the line and while its inputs move:
//! the moment that the image gives is the one at which the question arrived, and it lies in the
//! bounds that the client states. Time is virtual, so every run is the same on every machine.
#![cfg(target_os = "linux")]

use std::collections::VecDeque;
use std::time::Duration;

use image_bench::bench::{Bench, Parts, Setup};
use image_bench::program::Program;
use ser_client::{LineRate, Session, Timing};
use ser_proto::{
    AutoReport, Baud, ClockReading, ClockSource, Command, Configure, FrameEncoder, Reply, TimeStamp,
};
use ser_sim::testing::image;
use ser_trial::simulation::chance::Chance;

/// Where the emulator's plugin is: set by `cargo xtask test`, which builds it.
const PLUGIN_VARIABLE: &str = "SER_QEMU_PLUGIN";

/// How often the image is asked at each rate.
const ROUNDS: [(Baud, u32); 4] =
    [(Baud::B19200, 350), (Baud::B9600, 110), (Baud::B4800, 30), (Baud::B1200, 10)];

const TIMEOUT: Duration = Duration::from_secs(1);

/// Start bit, eight data bits, stop bit.
const BITS_PER_BYTE: u64 = 10;

const NS_PER_MS: u64 = 1_000_000;

/// From the end of a byte to its stamp: the interrupts that run first.
const STAMPED_WITHIN_US: u64 = 50;

/// When the image has started and taken its baseline.
const STARTED_MS: u64 = 100;

/// 2026-11-22 12:00, and in milliseconds since 1970.
const NOON: TimeStamp =
    TimeStamp { year: 26, month: 11, day: 22, hour: 12, minute: 0, second: 0, millisecond: 0 };
const NOON_MS: u64 = 1_795_348_800_000;

/// 2000-01-01 00:00, in milliseconds since 1970: where a clock begins that nobody has set.
const NEVER_SET_MS: u64 = 946_684_800_000;

/// The image, and a host at the other end of its line.
struct Line<'p> {
    bench: Bench<'p>,
    session: Session,
    chance: Chance,
    baud: Baud,
    /// Bytes on their way, with the time at which their stop bits end.
    to_image: VecDeque<(u64, u8)>,
    to_host: VecDeque<(u64, u8)>,
    replied_ns: u64,
    /// In which milliseconds inputs moved.
    moved_ms: Vec<u64>,
    busy: bool,
}

impl<'p> Line<'p> {
    fn start(parts: &Parts, program: &'p Program) -> Line<'p> {
        let setup = Setup { debounce_ms: 0, genius: false };
        let bench = Bench::start(parts, program, setup).unwrap();
        let baud = Baud::B9600;
        let line_rate = LineRate::BitsPerSecond(baud.bits_per_second());
        let session = Session::new(Timing { timeout: TIMEOUT, retries: 0, line_rate });
        let mut line = Line {
            bench,
            session,
            chance: Chance::new(1),
            baud,
            to_image: VecDeque::new(),
            to_host: VecDeque::new(),
            replied_ns: 0,
            moved_ms: Vec::new(),
            busy: false,
        };
        line.run(STARTED_MS);
        line
    }

    fn now(&self) -> Duration {
        Duration::from_millis(self.bench.now_ms())
    }

    fn byte_ns(&self) -> u64 {
        BITS_PER_BYTE * 1_000_000_000 / u64::from(self.baud.bits_per_second())
    }

    /// Lets a millisecond pass, and brings what arrives at its end.
    fn pass_ms(&mut self) {
        self.bench.pass_ms().unwrap();
        let now_ms = self.bench.now_ms();
        if self.busy && self.chance.one_in(3) {
            self.moved_ms.push(now_ms);
            let inputs = 1 << self.chance.below(32);
            self.bench.toggle(inputs);
        }
        let now_ns = now_ms * NS_PER_MS;
        let byte_ns = self.byte_ns();
        for byte in self.bench.take_sent() {
            self.replied_ns = self.replied_ns.max(now_ns - NS_PER_MS) + byte_ns;
            self.to_host.push_back((self.replied_ns, byte));
        }
        // The bench gives the image one byte at the beginning of a millisecond, and none before it
        // is whole.
        if self.bench.waiting() == 0
            && let Some(byte) = take_due(&mut self.to_image, now_ns)
        {
            self.bench.send(&[byte]);
        }
        while let Some(byte) = take_due(&mut self.to_host, now_ns) {
            self.session.process(Duration::from_nanos(now_ns), &[byte]);
        }
    }

    fn run(&mut self, ms: u64) {
        (0..ms).for_each(|_| self.pass_ms());
    }

    /// Puts bytes on the line, behind those that are on it.
    fn send(&mut self, bytes: impl IntoIterator<Item = u8>) {
        let last_ns = self.to_image.back().map_or(0, |&(at_ns, _)| at_ns);
        let mut at_ns = last_ns.max(self.bench.now_ms() * NS_PER_MS);
        for byte in bytes {
            at_ns += self.byte_ns();
            self.to_image.push_back((at_ns, byte));
        }
    }

    /// Asks, and waits for the answer.
    fn ask(&mut self, command: Command) -> Reply {
        self.session.request(command).expect("nothing else is under way");
        loop {
            let now = self.now();
            let frame = self.session.dispatch(now).map(|attempt| attempt.frame().to_vec());
            self.send(frame.into_iter().flatten());
            match self.session.take_answer() {
                Some(Ok(reply)) => return reply,
                Some(Err(_)) => panic!("no reply to {command:?}"),
                None => self.pass_ms(),
            }
        }
    }

    fn change_rate(&mut self, baud: Baud) {
        let configure = Configure {
            size: None,
            baud: Some(baud),
            auto_report: AutoReport::Off,
            report_address: 0,
            auto_print: false,
        };
        assert!(matches!(self.ask(Command::Configure(configure)), Reply::Configuration(_)));
        self.baud = baud;
        self.session.set_line_rate(LineRate::BitsPerSecond(baud.bits_per_second()));
        self.run(20);
    }

    /// Has the image say something long, behind which the next answer waits.
    fn keep_it_talking(&mut self) {
        self.send(FrameEncoder::new(Command::Read { start: 1, count: 10 }.to_body()));
    }

    /// Asks for the time, and checks the answer. Returns how wide the stated bounds are.
    fn ask_time(&mut self, token: u16, clock_at_0_ms: u64, source: ClockSource) -> Duration {
        let Reply::Time(reading) = self.ask(Command::Time { token }) else { panic!("no time") };
        let ClockReading { clock_us, tick_us, next_sequence, .. } = reading;
        let arrived_ms = self.bench.brought_ms();
        let arrived_us = arrived_ms * 1000;
        assert!(
            (arrived_us + 1..arrived_us + STAMPED_WITHIN_US).contains(&tick_us),
            "{tick_us} us, and the last byte arrived at {arrived_us} us ({:?})",
            self.baud
        );
        let (from, to) = self.session.exchange().expect("an exchange").carried_out();
        let moment = Duration::from_micros(tick_us);
        assert!((from..=to).contains(&moment), "{moment:?} is not in {from:?}..={to:?}");
        // What the clock is off is the difference of its time and the true one. The host knows it
        // to the width of its bounds.
        let shows_us = u64::try_from(clock_us).expect("after 1970");
        assert_eq!(shows_us, clock_at_0_ms * 1000 + tick_us, "token {token}");
        assert_eq!((reading.token, reading.source), (token, source));
        // All changes that were sampled up to then, and none after it.
        let events = self.moved_ms.iter().filter(|&&ms| ms <= arrived_ms).count();
        assert_eq!(next_sequence, events as u64 + 1, "token {token}");
        to - from
    }
}

/// The next byte, if its stop bit has ended.
fn take_due(bytes: &mut VecDeque<(u64, u8)>, now_ns: u64) -> Option<u8> {
    bytes.front().filter(|(at_ns, _)| *at_ns <= now_ns)?;
    bytes.pop_front().map(|(_, byte)| byte)
}

#[test]
#[ignore = "needs the emulator and the image: cargo xtask test"]
fn the_image_says_when_five_hundred_questions_arrived_at_four_rates() {
    let plugin = std::env::var_os(PLUGIN_VARIABLE);
    let plugin =
        plugin.unwrap_or_else(|| panic!("{PLUGIN_VARIABLE} is not set: run `cargo xtask test`"));
    let parts = Parts { image: image(), plugin: plugin.into() };
    let program = Program::read(&parts.image).unwrap_or_else(|error| panic!("{error}"));
    let mut line = Line::start(&parts, &program);
    let Reply::Time(first) = line.ask(Command::Time { token: 0 }) else { panic!("no time") };
    // A battery-backed clock that was never set is not believed.
    let at_0_us = u64::try_from(first.clock_us).expect("after 1970") - first.tick_us;
    assert_eq!((first.source, at_0_us), (ClockSource::NeverSet, NEVER_SET_MS * 1000));
    let (mut clock_at_0_ms, mut source) = (NEVER_SET_MS, ClockSource::NeverSet);
    line.busy = true;
    let mut token = 0;
    for (baud, rounds) in ROUNDS {
        line.change_rate(baud);
        let mut widest = Duration::ZERO;
        for round in 0..rounds {
            let pause_ms = line.chance.below(8);
            line.run(pause_ms);
            if round == rounds / 2 {
                assert_eq!(line.ask(Command::SetClock(NOON)), Reply::ClockSet);
                (clock_at_0_ms, source) =
                    (NOON_MS - line.bench.brought_ms(), ClockSource::HostOverRs232);
            }
            // At the lowest rate the host would give up meanwhile.
            if baud != Baud::B1200 && round % 10 == 0 {
                line.keep_it_talking();
            }
            token += 1;
            widest = widest.max(line.ask_time(token, clock_at_0_ms, source));
        }
        println!("{rounds} questions at {baud:?}: certain to {widest:?}");
    }
    assert_eq!(token, 500);
    assert!(line.moved_ms.len() > 5_000, "{}", line.moved_ms.len());
}
