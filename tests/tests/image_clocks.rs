//! One broadcast sets the clocks of the ARM image and of two recorders in this process, all on one
//! bus and reporting all the time. Time is virtual, so every run is the same on every machine.
#![cfg(target_os = "linux")]

use image_bench::bench::{Bench, Parts, Setup};
use image_bench::genius::Genius;
use image_bench::program::Program;
use ser_proto::{Command, Decoded, Entry, FrameDecoder, Inputs, MAX_BODY_LEN, Reply, TimeStamp};
use ser_sim::testing::image;
use ser_trial::genius_world::REPORT;

/// Where the emulator's plugin is: set by `cargo xtask test`, which builds it.
const PLUGIN_VARIABLE: &str = "SER_QEMU_PLUGIN";

const ROUNDS: u8 = 20;

const CLOCKS_AGREE_WITHIN_MS: i64 = 1;

/// By when the GENI boards have started and the host knows the recorders.
const START_LIMIT_MS: u64 = 30_000;

/// By when all three have carried out a broadcast.
const CARRIED_OUT_MS: u64 = 250;

/// By when a reply has come over the line.
const REPLY_LIMIT_MS: u64 = 2_000;

/// An input that toggles all the time, so that every recorder has a report to send whenever it may.
const BUSY: u8 = 1;
const PERIOD_MS: u64 = 5;

/// An input that moves at all recorders in the same sample. Its stamps are compared.
const COMMON: u8 = 2;

/// How many reports of each recorder come at least while a broadcast is carried out. A recorder
/// sends one in some 60 ms.
const REPORTS_PER_ROUND: u32 = 2;

struct Plant<'p> {
    bench: Bench<'p>,
    frames: FrameDecoder<MAX_BODY_LEN>,
    common_on: bool,
    /// Reports of the image that the host has received.
    image_reports: u32,
}

impl<'p> Plant<'p> {
    fn start(parts: &Parts, program: &'p Program) -> Plant<'p> {
        let bench = Bench::start(parts, program, Setup { debounce_ms: 0, genius: true }).unwrap();
        let mut plant =
            Plant { bench, frames: FrameDecoder::new(), common_on: false, image_reports: 0 };
        for number in [1, 9] {
            plant.genius().connect(number);
        }
        while !plant.genius().is_ready() {
            assert!(plant.bench.now_ms() < START_LIMIT_MS, "not everybody is on the bus");
            plant.bench.pass_ms().unwrap();
        }
        let configured = plant.ask(&Command::Configure(REPORT));
        assert!(matches!(configured, Reply::Configuration(_)), "{configured:?}");
        let others = &mut plant.genius().others;
        others.iter_mut().for_each(|other| other.send_command(&Command::Configure(REPORT)));
        plant.run(1_000, true);
        plant
    }

    fn genius(&mut self) -> &mut Genius {
        self.bench.genius.as_mut().expect("there is a bus")
    }

    /// Moves a contact at all recorders.
    fn toggle(&mut self, input: u8, on: bool) {
        self.bench.toggle(1 << (input - 1));
        self.genius().others.iter_mut().for_each(|other| other.contact(input, on));
    }

    fn run(&mut self, ms: u64, busy: bool) {
        for _ in 0..ms {
            self.bench.pass_ms().unwrap();
            let now_ms = self.bench.now_ms();
            if busy && now_ms.is_multiple_of(PERIOD_MS) {
                self.toggle(BUSY, now_ms.is_multiple_of(2 * PERIOD_MS));
            }
            let received = self.genius().take_received();
            let reports =
                received.iter().filter(|body| matches!(Reply::parse(body), Ok(Reply::Read(_))));
            self.image_reports += u32::try_from(reports.count()).expect("few");
        }
    }

    /// How many reports each recorder has sent, the image first.
    fn reports(&mut self) -> Vec<u32> {
        let image = self.image_reports;
        let others = &self.genius().others;
        [image]
            .into_iter()
            .chain(others.iter().map(|other| other.port.diagnostics().reports_sent))
            .collect()
    }

    /// Asks the image over its line.
    fn ask(&mut self, command: &Command) -> Reply {
        self.bench.send_command(command);
        for _ in 0..REPLY_LIMIT_MS {
            self.bench.pass_ms().unwrap();
            for byte in self.bench.take_sent() {
                if let Some(Decoded::Frame(body)) = self.frames.push(byte) {
                    return Reply::parse(body).expect("a reply");
                }
            }
        }
        panic!("no reply to {command:?}");
    }

    fn erase_logs(&mut self) {
        assert_eq!(self.ask(&Command::Erase), Reply::Erased);
        let others = &mut self.genius().others;
        others.iter_mut().for_each(|other| other.send_command(&Command::Erase));
    }

    /// The recorders' stamps of the latest move of the common contact, the image's first.
    fn stamps_ms(&mut self) -> Vec<i64> {
        let Reply::Read(head) = self.ask(&Command::Read { start: 1, count: 1 }) else {
            panic!("no log")
        };
        let mut image = Vec::new();
        for start in (1..=head.total).step_by(10) {
            let Reply::Read(reply) = self.ask(&Command::Read { start, count: 10 }) else {
                panic!("no log")
            };
            image.extend(reply.entries);
        }
        let stamp = |log: Vec<Entry>| {
            let moved = |changed: Inputs| changed.contains(COMMON);
            milliseconds(
                log.into_iter().rfind(|entry| moved(entry.changed)).expect("it is recorded").time,
            )
        };
        let others =
            self.genius().others.iter().map(|other| other.node.log().1).collect::<Vec<_>>();
        [image].into_iter().chain(others).map(stamp).collect()
    }
}

fn milliseconds(time: TimeStamp) -> i64 {
    ((i64::from(time.hour) * 60 + i64::from(time.minute)) * 60 + i64::from(time.second)) * 1000
        + i64::from(time.millisecond)
}

#[test]
#[ignore = "needs the emulator and the image: cargo xtask test"]
fn one_broadcast_sets_the_image_and_two_recorders_that_report_all_the_time() {
    let plugin = std::env::var_os(PLUGIN_VARIABLE);
    let plugin =
        plugin.unwrap_or_else(|| panic!("{PLUGIN_VARIABLE} is not set: run `cargo xtask test`"));
    let parts = Parts { image: image(), plugin: plugin.into() };
    let program = Program::read(&parts.image).unwrap_or_else(|error| panic!("{error}"));
    let mut plant = Plant::start(&parts, &program);
    let mut all = Vec::new();
    for round in 0..ROUNDS {
        plant.erase_logs();
        // Each round is at another phase of the scan, while everybody is about to report.
        plant.run(60 + 7 * u64::from(round), true);
        while !plant.genius().is_ready() {
            plant.run(1, true);
        }
        let time = TimeStamp {
            year: 26,
            month: 11,
            day: 22,
            hour: round,
            minute: 59 - round,
            second: 3 * (round % 20),
            millisecond: 41 * u16::from(round),
        };
        let before = plant.reports();
        plant.genius().broadcast(&Command::SetClock(time)).unwrap();
        plant.run(CARRIED_OUT_MS, true);
        // All of them were busy in this round.
        let reports: Vec<u32> =
            plant.reports().iter().zip(&before).map(|(after, before)| after - before).collect();
        assert!(
            reports.iter().all(|&count| count >= REPORTS_PER_ROUND),
            "round {round}: {reports:?}"
        );
        let arrived_ms = plant.genius().read_arrived_ms();
        plant.common_on ^= true;
        plant.toggle(COMMON, plant.common_on);
        // All recorders see it in the sample that comes next.
        let moved_ms = plant.bench.now_ms();
        plant.run(5, false);
        let stamps = plant.stamps_ms();
        let spread = stamps.iter().max().expect("three") - stamps.iter().min().expect("three");
        assert!(spread <= CLOCKS_AGREE_WITHIN_MS, "round {round}, set to {time}: {stamps:?}");
        // None of them has an interrupt line, so each uses its next look at its board.
        for (stamp, arrived_ms) in stamps.iter().zip(arrived_ms) {
            let off_ms =
                (stamp - milliseconds(time)) - i64::try_from(moved_ms - arrived_ms).expect("short");
            assert!(
                (-CLOCKS_AGREE_WITHIN_MS..=0).contains(&off_ms),
                "round {round}: {off_ms} ms off"
            );
        }
        all.push(stamps.iter().map(|stamp| stamp - stamps[0]).collect::<Vec<_>>());
    }
    println!("stamps against those of the image: {all:?}");
    plant.genius().check().unwrap();
}
