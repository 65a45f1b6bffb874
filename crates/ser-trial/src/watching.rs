//! How many events `watch` delivers while they come faster and faster. The client's own watcher
//! talks to the recorder over a line that has its rate in both directions, in virtual time.

use std::collections::VecDeque;
use std::io;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use ser_client::{
    Clock, Delivery, LogFollower, LogWatcher, Options, ReportSwitch, RequestError, Transport, Unit,
};
use ser_proto::{AutoReport, Baud, Configuration, Configure, MAX_ENTRIES, Model, encoded_len};
use ser_sim::{Ram, Scenario, SimNode, SimNodeOptions, Step};

/// Start bit, eight data bits, stop bit.
const BITS_PER_BYTE: u64 = 10;

const NS_PER_MS: u64 = 1_000_000;

/// The rate of the line.
const BAUD: Baud = Baud::B19200;

/// How long the watcher waits in one go.
const HEARTBEAT: Duration = Duration::from_millis(100);

/// How long a watcher may take to catch up when no more events come.
const LONG_ENOUGH_MS: u64 = 600_000;

/// How a log is watched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// With reports as long as the line carries them, as `watch` does it.
    Reports,
    /// By polling, as `watch --poll` does it.
    Polling,
}

/// Events, and who watches them.
#[derive(Clone, Copy, Debug)]
pub struct Load {
    /// How the log is watched.
    pub way: Way,
    /// Entries that the ring holds.
    pub size: u16,
    /// Events a second, at most 1000.
    pub per_second: u32,
    /// For how many seconds.
    pub seconds: u32,
}

/// What became of the events.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Watched {
    /// All that happened.
    pub events: u64,
    /// Delivered by the time that the last one happened.
    pub in_time: u64,
    /// Delivered in all.
    pub delivered: u64,
    /// Reported as lost.
    pub lost: u64,
}

/// How many events a second a line at 19200 bit/s carries, in replies of ten entries and nothing
/// else.
#[must_use]
pub fn line_carries() -> f64 {
    let bytes = encoded_len(Model::Ser160.read_reply_len(MAX_ENTRIES));
    let bytes = u32::try_from(bytes).expect("a few hundred");
    f64::from(BAUD.bits_per_second()) / 10.0 / f64::from(bytes) * 10.0
}

impl Load {
    /// Lets the events happen, and watches until all are accounted for.
    ///
    /// # Panics
    /// If the recorder does not answer, or events come twice, or not in order.
    #[must_use]
    pub fn run(self) -> Watched {
        let world = World::new();
        let options = Options { timeout: Duration::from_secs(1), retries: 2 };
        let mut unit =
            Unit::with_clock(Box::new(Line(world.clone())), options, Arc::new(world.clone()));
        let found = unit.configuration().expect("an answer");
        let configure = Configure { size: Some(self.size), baud: Some(BAUD), ..found.into() };
        let found = unit.configure(configure).expect("it is as it was asked for");
        let mut watcher = self.watcher(found);
        let mut watched =
            Watched { events: (self.per_second * self.seconds).into(), ..Watched::default() };
        // Events before the first reading are not part of the trial, so the watcher is set up
        // first.
        while !self.is_set_up(&watcher) {
            watcher
                .step::<RequestError>(&mut unit, HEARTBEAT, &mut |_| Ok(()))
                .expect("nothing happens yet");
        }
        let (load_ends_ms, mut last) = (world.lock().begin(self), 0);
        while watched.delivered + watched.lost < watched.events {
            let step = watcher.step::<RequestError>(&mut unit, HEARTBEAT, &mut |step| {
                let in_time = world.now_ms() <= load_ends_ms;
                for delivery in step.deliveries {
                    watched.take(delivery, in_time, &mut last);
                }
                Ok(())
            });
            step.expect("the line is good");
            assert!(
                world.now_ms() < load_ends_ms + LONG_ENOUGH_MS,
                "{self:?}: {watched:?}, and no more comes"
            );
        }
        watched
    }

    fn watcher(self, found: Configuration) -> LogWatcher {
        let follower = LogFollower::new(None, found.size);
        let reporting =
            |auto_report| Configure { auto_report, size: None, baud: None, ..found.into() };
        match self.way {
            Way::Polling => LogWatcher::polling(follower, Duration::from_secs(1), true),
            Way::Reports => {
                let (on, off) = (reporting(AutoReport::Rs232), reporting(AutoReport::Off));
                let switch = ReportSwitch { on, off, is_on: false };
                LogWatcher::reporting(follower, Duration::from_secs(10), switch)
            }
        }
    }

    fn is_set_up(self, watcher: &LogWatcher) -> bool {
        watcher.cursor().is_some() && (self.way == Way::Polling || watcher.has_switched())
    }
}

impl Watched {
    fn take(&mut self, delivery: &Delivery, in_time: bool, last: &mut u64) {
        match *delivery {
            Delivery::Event { sequence, .. } => {
                *last += 1;
                assert_eq!(sequence, Some(*last), "in order, and none twice");
                self.delivered += 1;
                self.in_time += u64::from(in_time);
            }
            Delivery::Lost { after, lost } => {
                assert_eq!(after, Some(*last));
                assert!(lost.known_count() > 0, "{lost:?}");
                *last += u64::from(lost.known_count());
                self.lost += u64::from(lost.known_count());
            }
        }
    }
}

/// The recorder, and the bytes on their way to it.
struct Recorder {
    node: SimNode<'static>,
    /// Each byte with the time at which its stop bit ends.
    on_the_way: VecDeque<(u64, u8)>,
    free_ns: u64,
}

impl Recorder {
    /// Lets the events begin. Returns the time of the last.
    fn begin(&mut self, load: Load) -> u64 {
        let now_ms = self.node.now_ms();
        let at_ms = |event: u32| u64::from(event) * 1000 / u64::from(load.per_second);
        let steps = (0..load.per_second * load.seconds).map(|event| Step {
            at_ms: at_ms(event),
            input: 1,
            on: event.is_multiple_of(2),
        });
        self.node.play(&Scenario::from_steps(steps));
        now_ms + u64::from(load.seconds) * 1000
    }

    fn advance(&mut self) {
        self.node.advance_to(self.node.now_ms() + 1);
        while let Some(&(at_ns, byte)) = self.on_the_way.front()
            && at_ns <= self.node.now_ms() * NS_PER_MS
        {
            self.on_the_way.pop_front();
            self.node.receive(&[byte]);
        }
    }
}

/// A recorder whose time passes when its host waits.
#[derive(Clone)]
struct World(Arc<Mutex<Recorder>>);

/// The line to it.
struct Line(World);

impl World {
    fn new() -> World {
        // The node lives as long as its host, which has no fixed lifetime.
        let ram = Box::leak(Box::new(Ram::new()));
        let options = SimNodeOptions {
            line_rate: ser_sim::LineRate::Real,
            ..SimNodeOptions::new(Model::Ser160)
        };
        let node = SimNode::new(options, ram);
        World(Arc::new(Mutex::new(Recorder { node, on_the_way: VecDeque::new(), free_ns: 0 })))
    }

    fn lock(&self) -> MutexGuard<'_, Recorder> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn now_ms(&self) -> u64 {
        self.lock().node.now_ms()
    }
}

impl Clock for World {
    fn now(&self) -> Duration {
        Duration::from_millis(self.now_ms())
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
            if Duration::from_millis(recorder.node.now_ms()) >= until {
                return Ok(0);
            }
            recorder.advance();
        }
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut recorder = self.0.lock();
        let byte_ns =
            BITS_PER_BYTE * 1_000_000_000 / u64::from(recorder.node.baud().bits_per_second());
        recorder.free_ns = recorder.free_ns.max(recorder.node.now_ms() * NS_PER_MS);
        for &byte in bytes {
            recorder.free_ns += byte_ns;
            let at_ns = recorder.free_ns;
            recorder.on_the_way.push_back((at_ns, byte));
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
