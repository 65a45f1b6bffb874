//! Commands of all kinds on both ports at once, with a tenth of all messages lost or damaged. Every
//! reader of the log gets every event once.

use geni_board::Destination::Device;
use ser_proto::{
    AutoReport, Command, Configure, Entry, FrameEncoder, Inputs, Model, ReadReply, Reply, TimeStamp,
};
use ser_sim::genius::Noise;
use ser_sim::{Scenario, Step};
use ser_trial::genius_world::{HOST, World};
use ser_trial::simulation::chance::Chance;

const UNIT: u8 = 5;
const SIZE: u16 = 512;
const SCANS: u64 = 12_000;

/// The rate of messages on the bus that nobody can read, and of those that one receiver cannot: a
/// tenth together.
const NOISE_PPM: u32 = 50_000;

/// How long a host waits for a reply before it asks again.
const PATIENCE_MS: u64 = 250;

/// A host's place in the log: how many events it has, and what they were.
#[derive(Default)]
struct Reader {
    events: Vec<(u32, u32)>,
    /// How many deliveries contained nothing new.
    repeated: u32,
}

impl Reader {
    /// Takes what is new in a read reply, and nothing else. Total and next slot say which events
    /// they are.
    fn take(&mut self, reply: &ReadReply) {
        let total = u64::from(reply.total);
        let back = (u64::from(reply.next_slot) + u64::from(SIZE) - u64::from(reply.start - 1))
            % u64::from(SIZE);
        let back = if back == 0 { u64::from(SIZE) } else { back };
        let Some(first) = total.checked_sub(back) else { return };
        let known = self.events.len() as u64;
        assert!(first <= known, "events {known} to {first} are missing");
        let skipped = usize::try_from(known - first).expect("small");
        // After the newest event the ring goes on with the oldest one.
        let upto = reply.entries.len().min(usize::try_from(back).expect("small"));
        let new = reply.entries.get(skipped..upto).unwrap_or_default();
        self.repeated += u32::from(new.is_empty() && upto > 0);
        self.events.extend(new.iter().map(|entry: &Entry| (entry.changed.0, entry.state.0)));
    }

    /// Asks for the next events.
    fn next(&self) -> Command {
        let slot = u16::try_from(self.events.len() % usize::from(SIZE)).expect("a slot");
        Command::Read { start: slot + 1, count: 10 }
    }
}

fn any_command(chance: &mut Chance, reader: &Reader) -> Command {
    match chance.below(10) {
        0 => Command::QueryConfiguration,
        1 => Command::Configure(Configure {
            size: None,
            baud: None,
            auto_report: AutoReport::Genius,
            report_address: HOST,
            auto_print: chance.one_in(2),
        }),
        2 => Command::LastBroadcast,
        3 => Command::QueryMode,
        4 => Command::SetMode { recording: true },
        5 => Command::Print { start: 1, count: 3 },
        6 => Command::SetClock(TimeStamp {
            year: 26,
            month: 11,
            day: 22,
            hour: 12,
            minute: 0,
            second: 0,
            millisecond: 0,
        }),
        _ => reader.next(),
    }
}

/// Compares events, and shows only the first difference instead of thousands of events.
fn assert_same(read: &[(u32, u32)], expected: &[(u32, u32)]) {
    let differs = read.iter().zip(expected).position(|(read, expected)| read != expected);
    assert_eq!(differs.map(|at| (at, read[at], expected[at])), None);
    assert_eq!(read.len(), expected.len());
}

/// Everything that could differ between two runs.
#[derive(Debug, PartialEq)]
struct Outcome {
    events: Vec<(u32, u32)>,
    repeated_on_genius: u32,
    repeated_on_serial: u32,
    traffic: ser_sim::genius::Traffic,
    node: ser_node::Diagnostics,
    port: ser_node::GeniusDiagnostics,
}

fn run(seed: u64) -> Outcome {
    let mut chance = Chance::new(seed);
    let noise =
        Noise { seed, damaged_ppm: NOISE_PPM, lost_ppm: NOISE_PPM, unacknowledged_ppm: 10_000 };
    let mut world = World::with_noise(&[(UNIT, Model::Ser160)], noise);
    let configure = Configure {
        size: Some(SIZE),
        baud: None,
        auto_report: AutoReport::Genius,
        report_address: HOST,
        auto_print: false,
    };
    world.recorders[0].serial_ask(&Command::Configure(configure));
    world.until("both are on the bus", |world| {
        (world.host.driver.is_ready() && world.recorders[0].port.is_ready()).then_some(())
    });

    let (mut genius, mut serial) = (Reader::default(), Reader::default());
    let mut expected = Vec::new();
    let mut state = 0_u32;
    let mut asked_ms: Option<u64> = None;
    let end_of_events = SCANS * 9 / 10;
    let first_scan = world.bus.borrow().traffic().scans;
    let scan = |world: &World| world.bus.borrow().traffic().scans - first_scan;
    while scan(&world) < SCANS {
        // One contact or two, now and then.
        if scan(&world) < end_of_events && chance.one_in(12) {
            let changed = 1 << chance.below(16) | 1 << chance.below(16);
            state ^= changed;
            let steps = Inputs(changed).numbers().map(|input| Step {
                at_ms: 0,
                input,
                on: state >> (input - 1) & 1 == 1,
            });
            world.recorders[0].node.play(&Scenario::from_steps(steps));
            expected.push((changed, state));
        }
        world.step();

        // The host on the bus has one question at a time.
        while let Some((_, data)) = world.take_message(UNIT) {
            // A report looks like the answer to a question, and serves as one.
            if let Reply::Read(reply) = Reply::parse(&data).expect("boards discard what is damaged")
                && !reply.entries.is_empty()
            {
                genius.take(&reply);
            }
            asked_ms = None;
        }
        let patient = asked_ms.is_some_and(|asked_ms| world.now_ms - asked_ms < PATIENCE_MS);
        if !patient && world.host.driver.can_transmit() {
            let command = any_command(&mut chance, &genius);
            world.send(Device(UNIT), &command);
            asked_ms = Some(world.now_ms);
        }

        // The host on the line: a tenth of its frames, and of the recorder's, are damaged.
        if chance.one_in(12) {
            let command = any_command(&mut chance, &serial);
            let mut frame: Vec<u8> = FrameEncoder::new(command.to_body()).collect();
            if chance.one_in(10) {
                let at = usize::try_from(chance.below(frame.len() as u64)).expect("small");
                frame[at] ^= 1 << chance.below(7);
            }
            world.recorders[0].node.receive(&frame);
        }
        let lost = chance.one_in(10);
        for reply in world.recorders[0].serial_said().0 {
            if let Reply::Read(reply) = reply
                && !lost
                && !reply.entries.is_empty()
            {
                serial.take(&reply);
            }
        }
        world.host.sent.clear();
    }
    world.assert_lawful();
    assert_same(&genius.events, &expected);
    assert_same(&serial.events, &expected);
    let node = world.recorders[0].node.diagnostics();
    assert_eq!((node.edges_lost, node.events_unreported), (0, 0));
    let traffic = world.bus.borrow().traffic();
    Outcome {
        events: expected,
        repeated_on_genius: genius.repeated,
        repeated_on_serial: serial.repeated,
        traffic,
        node,
        port: world.recorders[0].port.diagnostics(),
    }
}

#[test]
fn every_event_is_read_once_whatever_is_lost() {
    for seed in 1..=5 {
        let outcome = run(seed);
        assert!(outcome.events.len() > usize::from(SIZE), "{}", outcome.events.len());
        assert!(outcome.traffic.damaged > 0 && outcome.traffic.lost > 0);
        assert!(outcome.port.reports_failed > 0 && outcome.port.replies_lost > 0);
        assert!(outcome.node.frames_checksum > 0);
        assert!(outcome.repeated_on_genius > 0, "reports and replies overlap");
        assert_eq!(outcome, run(seed), "the same seed, another result");
    }
}
