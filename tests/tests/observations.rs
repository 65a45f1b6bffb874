//! What a host takes for certain of a recorder's clock is true, at every phase of the recorder's
//! millisecond and at every rate of the line. Recorder and line are simulated, in virtual time.

use std::collections::VecDeque;
use std::io;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

use ser_client::{Clock, Delivery, LogFollower, Options, RequestError, Transport, Unit};
use ser_node::Debounce;
use ser_proto::{Baud, Configuration, Configure, Entry, Model, TimeStamp};
use ser_sim::{LineRate, Ram, Scenario, SimNode, SimNodeOptions, Step};

const NOON: TimeStamp =
    TimeStamp { year: 26, month: 11, day: 22, hour: 12, minute: 0, second: 0, millisecond: 0 };

/// Start bit, eight data bits, stop bit.
const BITS_PER_BYTE: u64 = 10;

/// How finely time passes, in microseconds.
const STEP_US: u64 = 50;

/// The recorder counts whole milliseconds: its clock may have begun to show a time that much before a
/// command came, or that much after.
const MILLISECOND: Duration = Duration::from_millis(1);

/// How long a recorder holds a change back at the most.
const HOLD_BACK: Duration = Duration::from_millis(320);

/// A recorder, and the bytes on their way to it.
struct Recorder {
    node: SimNode<'static>,
    now_us: u64,
    /// When the recorder's first millisecond began, by the host's clock.
    phase_us: u64,
    /// Each byte with the time at which its stop bit ends.
    on_the_way: VecDeque<(u64, u8)>,
}

impl Recorder {
    fn advance(&mut self) {
        self.now_us += STEP_US;
        self.node.advance_to((self.now_us - self.phase_us) / 1000);
        while let Some(&(at_us, byte)) = self.on_the_way.front()
            && at_us <= self.now_us
        {
            self.on_the_way.pop_front();
            self.node.receive(&[byte]);
        }
    }

    fn byte_us(&self) -> u64 {
        BITS_PER_BYTE * 1_000_000 / u64::from(self.node.baud().bits_per_second())
    }
}

/// A recorder whose time passes when its host waits.
#[derive(Clone)]
struct World(Arc<Mutex<Recorder>>);

/// The line to it.
struct Line(World);

impl World {
    fn new(options: SimNodeOptions) -> World {
        // The node lives as long as its host, which has no fixed lifetime.
        let ram = Box::leak(Box::new(Ram::new()));
        let node = SimNode::new(SimNodeOptions { line_rate: LineRate::Real, ..options }, ram);
        let (now_us, phase_us) = (1_000_000, 999_650);
        World(Arc::new(Mutex::new(Recorder {
            node,
            now_us,
            phase_us,
            on_the_way: VecDeque::new(),
        })))
    }

    fn lock(&self) -> MutexGuard<'_, Recorder> {
        self.0.lock().expect("no test has panicked")
    }

    /// A host at this rate.
    fn unit(&self, baud: Baud) -> Unit {
        let configure = Configure { baud: Some(baud), ..Configuration::default().into() };
        self.host().configure(configure).expect("the rate is changed");
        self.wait(Duration::from_millis(100));
        self.host()
    }

    fn host(&self) -> Unit {
        let options = Options { timeout: Duration::from_secs(1), retries: 0 };
        Unit::with_clock(Box::new(Line(self.clone())), options, Arc::new(self.clone()))
    }

    /// Moves an input in a millisecond of the recorder, and returns when that began.
    fn move_input(&self, on: bool) -> Duration {
        let mut recorder = self.lock();
        let begins_ms =
            recorder.node.play(&Scenario::from_steps([Step { at_ms: 0, input: 3, on }]));
        Duration::from_micros(recorder.phase_us + begins_ms * 1000)
    }
}

impl Clock for World {
    fn now(&self) -> Duration {
        Duration::from_micros(self.lock().now_us)
    }

    fn wait(&self, time: Duration) {
        let until = self.now() + time;
        while self.now() < until {
            self.lock().advance();
        }
    }
}

impl Transport for Line {
    fn read(&mut self, buf: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let until = self.0.now() + timeout;
        let mut recorder = self.0.lock();
        loop {
            let said = recorder.node.output();
            let count = said.len().min(buf.len());
            if count > 0 {
                buf[..count].copy_from_slice(&said[..count]);
                recorder.node.taken(count);
                return Ok(count);
            }
            if Duration::from_micros(recorder.now_us) >= until {
                return Ok(0);
            }
            recorder.advance();
        }
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut recorder = self.0.lock();
        let byte_us = recorder.byte_us();
        for (place, &byte) in (1..).zip(bytes) {
            let at_us = recorder.now_us + place * byte_us;
            recorder.on_the_way.push_back((at_us, byte));
        }
        Ok(())
    }

    fn set_baud(&mut self, _: u32) -> io::Result<()> {
        Ok(())
    }

    fn bits_per_second(&self) -> Option<u32> {
        Some(self.0.lock().node.baud().bits_per_second())
    }
}

fn entries(unit: &mut Unit, follower: &mut LogFollower) -> Vec<Entry> {
    let mut entries = Vec::new();
    follower
        .read_new(unit, &mut |step| -> Result<(), RequestError> {
            entries.extend(step.deliveries.iter().filter_map(|delivery| match delivery {
                Delivery::Event { entry, .. } => Some(*entry),
                Delivery::Lost { .. } => None,
            }));
            Ok(())
        })
        .expect("the log is read");
    entries
}

/// Milliseconds of the hour after noon.
fn after_noon(time: &TimeStamp) -> Duration {
    assert_eq!(time.hour, NOON.hour, "within the hour");
    let seconds = u64::from(time.minute) * 60 + u64::from(time.second);
    Duration::from_millis(seconds * 1000 + u64::from(time.millisecond))
}

#[test]
fn a_clock_shows_what_was_set_between_the_two_times_that_the_host_tells() {
    for baud in [Baud::B300, Baud::B9600, Baud::B19200] {
        for phase_us in (0..1000).step_by(100) {
            let world = World::new(SimNodeOptions::new(Model::Ser160));
            let mut unit = world.unit(baud);
            // The last answer came with a millisecond of the recorder's.
            world.wait(Duration::from_micros(phase_us));
            unit.set_clock(|_| NOON).expect("the clock is set");
            let (from, to) = unit.last_exchange().expect("an answer").carried_out();
            world.wait(Duration::from_millis(7));
            // An entry says what the clock shows in a known millisecond.
            let moved_at = world.move_input(true);
            world.wait(Duration::from_millis(3));
            let entries = entries(&mut unit, &mut LogFollower::new(None, 2048));
            let showed_noon_at = moved_at - after_noon(&entries[0].time);
            assert!(
                (from - MILLISECOND..=to + MILLISECOND).contains(&showed_noon_at),
                "{baud:?}, {phase_us} µs: noon at {showed_noon_at:?}, and not in {from:?}..={to:?}"
            );
            // The line is most of the way, and the host allows for it.
            assert!(to - from <= world_slack(baud), "{baud:?}: {:?}", to - from);
        }
    }
}

/// A twentieth of the time that the command and its answer are on the line, a millisecond of the
/// recorder's, and one for its answer.
fn world_slack(baud: Baud) -> Duration {
    const BYTES: u64 = 40;
    let line = Duration::from_micros(
        BYTES * BITS_PER_BYTE * 1_000_000 / u64::from(baud.bits_per_second()),
    );
    // The recorder sends whole milliseconds' worth of bytes.
    line / 20 + 4 * MILLISECOND
}

#[test]
fn an_entry_that_was_not_there_at_one_look_was_not_recorded_long_before() {
    // With and without the longest debounce, which holds a change back.
    for debounce in [Debounce::OFF, Debounce::uniform(255)] {
        for phase_us in [0, 500, 950] {
            let options = SimNodeOptions { debounce, ..SimNodeOptions::new(Model::Ser160) };
            let world = World::new(options);
            let mut unit = world.unit(Baud::B9600);
            world.wait(Duration::from_micros(phase_us));
            let mut follower = LogFollower::new(None, 2048);
            assert!(entries(&mut unit, &mut follower).is_empty());
            let mut complete_at = follower.complete_at().expect("a look");
            let mut moved_at = VecDeque::new();
            for look in 0..40 {
                if look % 8 == 0 {
                    moved_at.push_back(world.move_input(look % 16 == 0));
                }
                world.wait(Duration::from_millis(37));
                let new = entries(&mut unit, &mut follower);
                for _ in new {
                    let moved_at = moved_at.pop_front().expect("what was moved");
                    assert!(complete_at - HOLD_BACK <= moved_at, "{complete_at:?} {moved_at:?}");
                    assert!(moved_at <= unit.now());
                }
                complete_at = follower.complete_at().expect("a look");
            }
            assert!(moved_at.is_empty(), "all were recorded");
        }
    }
}
