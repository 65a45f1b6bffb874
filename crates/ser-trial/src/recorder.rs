//! A recorder under test, native or as the ARM image, behind a pseudo-terminal.

use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use chrono::NaiveDateTime;
use ser_client::{Endpoint, GeniHost, Options, Unit, Unsolicited, open};
use ser_proto::{Entry, Model};
use ser_sim::genius::Noise;
use ser_sim::testing::{Kind, PATIENCE, image};
use ser_sim::{
    Backend, EmulatedBoard, EmulatorOptions, GeniusOptions, Notice, Played, Port, Scenario,
    SimOptions, Simulator, Step,
};
use tempfile::TempDir;

/// The recorder's bus address, where it is on a bus.
pub const NODE: u8 = 5;

/// Client options for a machine that stalls.
pub const PATIENT: Options = Options { timeout: Duration::from_secs(20), retries: 5 };

/// A recorder that is switched on.
pub struct Recorder {
    simulator: Simulator,
    /// The problems that the simulator has told of.
    notices: Arc<Mutex<Vec<String>>>,
    /// Holds the host's window, if it is on a bus.
    _folder: Option<TempDir>,
}

impl Recorder {
    /// Switches on a recorder with all contacts open.
    ///
    /// # Panics
    /// When it does not answer, or the image is not there.
    #[must_use]
    pub fn start(kind: Kind, model: Model) -> Recorder {
        Recorder::start_with(SimOptions { backend: kind.backend(), ..options(model) }, None)
    }

    /// Switches on a recorder that is on a Genius bus with a host, with all contacts open.
    ///
    /// # Panics
    /// When it does not answer, or the image is not there.
    #[must_use]
    pub fn start_on_bus(kind: Kind, model: Model) -> Recorder {
        Recorder::start_on_noisy_bus(kind, model, Noise::default())
    }

    /// Switches on a recorder on a bus on which messages are damaged and lost.
    ///
    /// # Panics
    /// When it does not answer, or the image is not there.
    #[must_use]
    pub fn start_on_noisy_bus(kind: Kind, model: Model, noise: Noise) -> Recorder {
        let folder = tempfile::tempdir().expect("a folder");
        let genius = GeniusOptions::new(folder.path().join("host"), vec![(NODE, model)]);
        let genius = GeniusOptions { noise, ..genius };
        let options =
            SimOptions { backend: kind.backend(), genius: Some(genius), ..options(model) };
        Recorder::start_with(options, Some(folder))
    }

    /// Switches on the ARM image, which writes its log to a file.
    ///
    /// # Panics
    /// When it does not answer, or the image is not there.
    #[must_use]
    pub fn start_logging(log: &Path) -> Recorder {
        Recorder::start_image(EmulatorOptions {
            log: Some(log.to_owned()),
            ..EmulatorOptions::new(image())
        })
    }

    /// Switches on the ARM image with a memory and a log in files.
    ///
    /// # Panics
    /// When it does not answer, or the image is not there.
    #[must_use]
    pub fn start_keeping(memory: &Path, log: &Path) -> Recorder {
        Recorder::start_image(EmulatorOptions {
            memory: Some(memory.to_owned()),
            log: Some(log.to_owned()),
            ..EmulatorOptions::new(image())
        })
    }

    /// Switches on the ARM image with a memory that may have been in use before.
    ///
    /// # Panics
    /// When it does not answer, or the image is not there.
    #[must_use]
    pub fn start_with_memory(memory: &Path) -> Recorder {
        Recorder::start_image(EmulatorOptions {
            memory: Some(memory.to_owned()),
            ..EmulatorOptions::new(image())
        })
    }

    fn start_image(emulator: EmulatorOptions) -> Recorder {
        let backend = Backend::Emulator(emulator);
        Recorder::start_with(SimOptions { backend, ..options(Model::Ser320) }, None)
    }

    fn start_with(options: SimOptions, folder: Option<TempDir>) -> Recorder {
        let notices = Arc::new(Mutex::new(Vec::new()));
        let noticed = Arc::clone(&notices);
        let notice = Notice(Box::new(move |text| lock(&noticed).push(text.to_owned())));
        let simulator = Simulator::start(SimOptions { notice: Some(notice), ..options });
        let simulator = simulator.unwrap_or_else(|error| panic!("{error}"));
        Recorder { simulator, notices, _folder: folder }
    }

    /// The emulated board.
    ///
    /// # Panics
    /// When the recorder runs in this process.
    #[must_use]
    pub fn board(&self) -> &EmulatedBoard {
        self.simulator.board().expect("an emulated recorder")
    }

    /// What `--port` takes for its serial line.
    #[must_use]
    pub fn port(&self) -> &str {
        self.simulator.port()
    }

    /// A client on the line, at 9600 bit/s.
    ///
    /// # Panics
    /// When the line cannot be opened.
    #[must_use]
    pub fn unit(&self) -> Unit {
        let endpoint: Endpoint = self.port().parse().expect("the simulator names its port");
        let transport = open(&endpoint, 9600).unwrap_or_else(|error| panic!("{error}"));
        Unit::new(transport, PATIENT)
    }

    /// The host on the recorder's bus. There is one at a time.
    ///
    /// # Panics
    /// When its board cannot be reached.
    #[must_use]
    pub fn host(&self) -> GeniHost {
        let port = self.simulator.ports().last().expect("a port");
        let window =
            port.strip_prefix("geni:").and_then(|port| port.split_once('?')).expect("a window").0;
        GeniHost::open(window, PATIENCE).unwrap_or_else(|error| panic!("{error}"))
    }

    /// Checks that the recorder has kept to the rules of its GENI board.
    ///
    /// # Panics
    /// When it has not.
    pub fn assert_lawful(&self) {
        let notices = lock(&self.notices);
        let broken: Vec<_> = notices.iter().filter(|notice| notice.contains("rule")).collect();
        assert!(broken.is_empty(), "{broken:#?}");
    }

    /// Moves contacts, `(ms, input, closed)`, and waits until the recorder has sampled them all.
    ///
    /// # Panics
    /// When that takes too long.
    pub fn play(&self, steps: &[(u64, u8, bool)]) {
        self.start_playing(steps);
        self.simulator.wait_played(PATIENCE).unwrap_or_else(|error| panic!("{error}"));
    }

    /// Moves contacts while the caller goes on.
    ///
    /// # Panics
    /// When the simulator has ended.
    pub fn start_playing(&self, steps: &[(u64, u8, bool)]) {
        let steps = steps.iter().map(|&(at_ms, input, on)| Step { at_ms, input, on });
        self.simulator.play(Scenario::from_steps(steps)).unwrap_or_else(|error| panic!("{error}"));
    }

    /// Waits until all contacts have moved.
    ///
    /// # Panics
    /// When that takes too long.
    pub fn wait_played(&self) {
        self.simulator.wait_played(PATIENCE).unwrap_or_else(|error| panic!("{error}"));
    }

    /// What has moved, and between which samples.
    #[must_use]
    pub fn played(&self) -> Vec<Played> {
        self.simulator.played()
    }

    /// Switches the recorder off and on.
    ///
    /// # Panics
    /// When it does not come up again.
    pub fn power_cycle(&self) {
        self.simulator.power_cycle().unwrap_or_else(|error| panic!("{error}"));
    }
}

fn options(model: Model) -> SimOptions {
    SimOptions { keep_played: true, ..SimOptions::new(model, Port::Pty { link: None }) }
}

fn lock<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Takes what the recorder says unasked until `enough` has seen enough.
///
/// # Panics
/// When that takes too long.
pub fn listen(unit: &mut Unit, mut enough: impl FnMut(Unsolicited) -> bool) {
    let deadline = Instant::now() + PATIENCE;
    while Instant::now() < deadline {
        if let Some(message) = unit.wait_event(Duration::from_millis(100)).expect("the line is up")
            && enough(message)
        {
            return;
        }
    }
    panic!("the recorder has not said what it should");
}

/// The time of an entry in milliseconds since 1970.
///
/// # Panics
/// When there is no such time.
#[must_use]
pub fn stamp_ms(entry: &Entry) -> i64 {
    let time = NaiveDateTime::try_from(entry.time).expect("a recorder stamps with a real date");
    time.and_utc().timestamp_millis()
}

/// Checks that entries are the moves that were played: the same inputs in the same order, and
/// stamps exactly as far apart as the samples that can have seen them.
///
/// # Panics
/// When they are not.
pub fn assert_entries_are(entries: &[Entry], played: &[Played]) {
    assert_eq!(entries.len(), played.len(), "each move of contacts is one event");
    let Some((first, first_move)) = entries.first().zip(played.first()) else { return };
    for (entry, moved) in entries.iter().zip(played) {
        assert_eq!((entry.changed, entry.state), (moved.changed, moved.state), "{moved:?}");
        let delta_ms = stamp_ms(entry) - stamp_ms(first);
        let least = i64::from(moved.tick_before) - i64::from(first_move.tick_after);
        let most = i64::from(moved.tick_after) - i64::from(first_move.tick_before);
        assert!(
            (least..=most).contains(&delta_ms),
            "{delta_ms} ms after the first, {least}…{most} played"
        );
    }
}
