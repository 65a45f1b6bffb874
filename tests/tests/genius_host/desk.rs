//! A host's desk: the file that is its window, and behind it boards, bus and recorders. Their time
//! passes while the host waits for something.

use std::fs::{File, OpenOptions};
use std::os::unix::fs::FileExt;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use geni_board::SharedRam;
use ser_client::{Clock, GeniHost, GeniWindow, OpenError, Options, Unit};
use ser_proto::Model;
use ser_sim::genius::{Noise, RAM_LEN};
use ser_trial::genius_world::{Recorder, World};
use tempfile::TempDir;

/// A time long before which everybody is on the bus.
const START_LIMIT_MS: u64 = 60_000;

/// How long boards still assign themselves to each other after all are logged in.
const SETTLING_MS: u64 = 500;

type Order = Box<dyn FnOnce(&mut Bench) + Send>;

/// A time in which nothing moves.
#[derive(Clone, Copy)]
pub(crate) struct Stall {
    /// How long until it begins.
    pub(crate) in_ms: u64,
    /// How long it lasts.
    pub(crate) for_ms: u64,
}

impl Stall {
    /// Whether this millisecond is part of the stall.
    fn step(&mut self) -> bool {
        if self.in_ms > 0 {
            self.in_ms -= 1;
            return false;
        }
        let stalls = self.for_ms > 0;
        self.for_ms = self.for_ms.saturating_sub(1);
        stalls
    }
}

/// What is behind the window. It stays in the thread that made it.
pub(crate) struct Bench {
    pub(crate) world: World,
    window: File,
    /// Whether the host's board is held in reset. The host at the window does not have that line.
    pub(crate) in_reset: bool,
    /// A recorder that does nothing while its board goes on.
    pub(crate) paused: Option<Recorder>,
    /// A stall to come, in which nothing behind the window moves, as on a computer that is busy
    /// with other things.
    pub(crate) stall: Option<Stall>,
    /// How long nothing has moved in all.
    stalled_ms: u64,
}

impl Bench {
    /// Lets a millisecond pass in which each side sees what the other wrote before.
    fn step(&mut self) {
        if self.stall.as_mut().is_some_and(Stall::step) {
            self.stalled_ms += 1;
            return;
        }
        let board = self.world.host.board;
        let mut image = [0; RAM_LEN];
        // A file that is no longer complete tells nobody anything.
        let whole = self.window.read_exact_at(&mut image, 0).is_ok();
        if whole {
            self.world.bus.borrow_mut().get_mut(board).sync_from_host(&image);
        }
        self.world.step_without_host();
        let in_reset = self.in_reset;
        self.world.host.driver.ram_mut().drive_reset(in_reset);
        if whole {
            let window = &self.window;
            self.world.bus.borrow_mut().get_mut(board).publish(|offset, byte| {
                window.write_all_at(&[byte], offset.into()).expect("the window takes a byte");
            });
        }
    }

    pub(crate) fn run(&mut self, ms: u64) {
        (0..ms).for_each(|_| self.step());
    }

    /// Lets time pass until the host's board has logged all recorders in.
    fn start(&mut self) {
        let numbers: Vec<u8> =
            self.world.recorders.iter().map(|recorder| recorder.number).collect();
        while !numbers.iter().all(|&number| self.is_logged_in(number)) {
            self.step();
            assert!(self.world.now_ms < START_LIMIT_MS, "somebody is not on the bus");
        }
        self.run(SETTLING_MS);
    }

    fn is_logged_in(&self, number: u8) -> bool {
        // The third byte of a device table entry.
        let offset = 0x1E02 + 8 * u16::from(number);
        let ready = self.world.recorders.iter().all(|recorder| recorder.port.is_ready());
        ready && self.world.host.driver.ram().read(offset) == 1
    }

    /// The time of a bus scan, rounded up to milliseconds.
    pub(crate) fn scan_ms(&self) -> u64 {
        self.world.bus.borrow().scan_time_ns().expect("a running bus").div_ceil(1_000_000)
    }
}

/// A window in a folder of its own, and what is behind it.
pub(crate) struct Desk {
    folder: TempDir,
    clock: Arc<BenchTime>,
}

impl Desk {
    /// Recorders that are on the bus with the host's board.
    pub(crate) fn new(recorders: &[(u8, Model)]) -> Desk {
        Desk::with_noise(recorders, Noise::default())
    }

    /// Recorders and the host's board on a noisy bus.
    pub(crate) fn with_noise(recorders: &[(u8, Model)], noise: Noise) -> Desk {
        Desk::of_world(recorders, move |recorders| World::with_noise(recorders, noise))
    }

    /// Recorders and the host with GENI boards of this model number.
    pub(crate) fn with_boards(recorders: &[(u8, Model)], board_model: u8) -> Desk {
        Desk::of_world(recorders, move |recorders| {
            World::with_boards(recorders, Noise::default(), board_model)
        })
    }

    fn of_world(
        recorders: &[(u8, Model)],
        world: impl FnOnce(&[(u8, Model)]) -> World + Send + 'static,
    ) -> Desk {
        let folder = tempfile::tempdir().expect("a folder");
        let (orders, received) = channel::<Order>();
        let path = folder.path().join("host");
        let recorders = recorders.to_vec();
        thread::spawn(move || {
            let world = world(&recorders);
            let window = window(&path);
            let mut bench =
                Bench { world, window, in_reset: false, paused: None, stall: None, stalled_ms: 0 };
            bench.start();
            received.into_iter().for_each(|order| order(&mut bench));
        });
        let clock = Arc::new(BenchTime { now_ms: AtomicU64::new(0), orders: Mutex::new(orders) });
        // This returns when the bus is up.
        clock.wait(Duration::ZERO);
        Desk { folder, clock }
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn window(&self) -> GeniWindow {
        GeniWindow::from(self.path("host").to_str().expect("text"))
    }

    /// A host at any window, in this desk's time.
    pub(crate) fn open(&self, window: GeniWindow) -> Result<GeniHost, OpenError> {
        self.open_patiently(window, Duration::from_secs(1))
    }

    /// A host with more patience, or less.
    pub(crate) fn open_patiently(
        &self,
        window: GeniWindow,
        patience: Duration,
    ) -> Result<GeniHost, OpenError> {
        GeniHost::open_in(Arc::clone(&self.clock) as Arc<dyn Clock>, window, patience)
    }

    /// A host for a user who may give up.
    pub(crate) fn open_unless(
        &self,
        window: GeniWindow,
        stop: &Arc<AtomicBool>,
    ) -> Result<GeniHost, OpenError> {
        let clock = Arc::clone(&self.clock) as Arc<dyn Clock>;
        GeniHost::open_in_unless(clock, window, Duration::from_secs(1), stop)
    }

    pub(crate) fn host(&self) -> GeniHost {
        self.open(self.window()).unwrap_or_else(|error| panic!("{error}"))
    }

    /// Does something behind the window.
    pub(crate) fn with<T: Send + 'static>(
        &self,
        order: impl FnOnce(&mut Bench) -> T + Send + 'static,
    ) -> T {
        self.clock.with(order)
    }

    /// Moves the first contact of a recorder, given by index. Returns in which millisecond.
    pub(crate) fn contact(&self, recorder: usize, closed: bool) -> u64 {
        self.with(move |bench| {
            bench.world.recorders[recorder].contact(1, closed);
            bench.world.now_ms + 1
        })
    }

    /// Lets time pass while the host does nothing.
    pub(crate) fn run(&self, ms: u64) {
        self.clock.wait(Duration::from_millis(ms));
    }

    /// The present, for everybody.
    pub(crate) fn now_ms(&self) -> u64 {
        self.clock.now_ms.load(Ordering::Relaxed)
    }
}

/// A client with the usual patience, in the desk's time.
pub(crate) fn unit(host: &GeniHost, number: u8) -> Unit {
    host.unit(number, Options::default())
}

fn window(path: &PathBuf) -> File {
    let mut options = OpenOptions::new();
    let file =
        options.read(true).write(true).create(true).truncate(true).open(path).expect("a file");
    file.set_len(RAM_LEN as u64).expect("room");
    file
}

/// The time behind the window.
struct BenchTime {
    now_ms: AtomicU64,
    orders: Mutex<Sender<Order>>,
}

impl BenchTime {
    fn with<T: Send + 'static>(&self, order: impl FnOnce(&mut Bench) -> T + Send + 'static) -> T {
        let (sender, done) = channel();
        let order: Order = Box::new(move |bench| {
            let result = order(bench);
            sender.send((result, bench.world.now_ms + bench.stalled_ms)).expect("somebody waits");
        });
        self.orders
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .send(order)
            .expect("the bench is there");
        let (result, now_ms) = done.recv().expect("the bench is well");
        // Several threads may wait for the same bench.
        self.now_ms.fetch_max(now_ms, Ordering::Relaxed);
        result
    }
}

impl Clock for BenchTime {
    fn now(&self) -> Duration {
        Duration::from_millis(self.now_ms.load(Ordering::Relaxed))
    }

    fn wait(&self, time: Duration) {
        let ms = u64::try_from(time.as_nanos().div_ceil(1_000_000)).expect("not for ever");
        self.with(move |bench| bench.run(ms));
    }
}
