//! A simulated recorder that keeps pace with real time and answers on a serial line.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use ser_node::Debounce;
use ser_proto::Model;

use crate::contacts::player::Played;
use crate::contacts::scenario::Scenario;
use crate::contacts::source::{Contacts, read_stream};
use crate::error::SimError;
#[cfg(unix)]
use crate::genius_bench::GeniusBench;
use crate::genius_options::GeniusOptions;
use crate::line;
use crate::line::wire::Wire;
use crate::machine::Machine;
use crate::machine::native::Native;
use crate::machine::pace::Pace;
use crate::machine::sim_node::{PoweredOff, Ram, SimNodeOptions};
use crate::options::{Backend, EmulatorOptions, SimOptions};
#[cfg(unix)]
use crate::qemu::emulated_board::EmulatedBoard;
use crate::service::{Outcome, Request, Service, Shared};

/// How soon [`run`] and [`Simulator::wait`] notice that they are to stop.
const STOP_CHECK: Duration = Duration::from_millis(20);

/// A recorder that runs until this is dropped.
pub struct Simulator {
    port: String,
    #[cfg(unix)]
    board: Option<EmulatedBoard>,
    requests: Sender<Request>,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<Result<(), SimError>>>,
}

impl Simulator {
    /// Switches a recorder on and returns as soon as it answers on its port.
    ///
    /// # Errors
    /// When the port cannot be opened, the emulator cannot be started or the image does not answer.
    pub fn start(options: SimOptions) -> Result<Simulator, SimError> {
        Simulator::start_unless(options, &AtomicBool::new(false))
    }

    fn start_unless(options: SimOptions, stop: &AtomicBool) -> Result<Simulator, SimError> {
        let line = line::open(&options.port)?;
        let (requests, request_receiver) = channel();
        let shared = Arc::new(Shared::default());
        let (ready_sender, ready) = channel();
        let SimOptions {
            model,
            contacts,
            debounce_ms,
            backend,
            genius,
            notice,
            keep_played,
            port: _,
        } = options;
        let mut service = Service {
            line,
            wire: Wire::new(),
            requests: request_receiver,
            stream: None,
            notice,
            keeps_played: keep_played,
            shared: Arc::clone(&shared),
        };
        let thread = thread::Builder::new()
            .name("ser-sim".to_owned())
            .spawn(move || {
                let shared = Arc::clone(&service.shared);
                let nodes = genius.as_ref().map_or(Vec::new(), |genius| genius.nodes.clone());
                let model = nodes.first().map_or(model, |&(_, model)| model);
                let start = Start {
                    model,
                    nodes,
                    contacts,
                    #[cfg(unix)]
                    board: None,
                    ready: ready_sender,
                };
                let result = match backend {
                    #[cfg(unix)]
                    backend if let Some(genius) = &genius => {
                        run_on_bus(&mut service, backend, debounce_ms, genius, start)
                    }
                    #[cfg(not(unix))]
                    _ if genius.is_some() => Err(SimError::Unsupported("a Genius bus")),
                    Backend::Native { line_rate, non_volatile } => {
                        let debounce = Debounce::uniform(debounce_ms);
                        let options = SimNodeOptions { model, debounce, line_rate, non_volatile };
                        run_native(&mut service, options, start)
                    }
                    #[cfg(unix)]
                    Backend::Emulator(options) => {
                        run_emulator(&mut service, &options, debounce_ms, start)
                    }
                    #[cfg(not(unix))]
                    Backend::Emulator(_) => Err(SimError::Unsupported("the emulated board")),
                };
                // The link is removed before anybody is told that the simulator has ended.
                drop(service);
                shared.update(|status| status.ended = true);
                result
            })
            .map_err(SimError::io("start a thread"))?;
        let mut simulator = Simulator {
            port: String::new(),
            #[cfg(unix)]
            board: None,
            requests,
            shared,
            thread: Some(thread),
        };
        loop {
            match ready.recv_timeout(STOP_CHECK) {
                Ok(ready) => {
                    simulator.port = ready.port;
                    #[cfg(unix)]
                    {
                        simulator.board = ready.board;
                    }
                    return Ok(simulator);
                }
                Err(RecvTimeoutError::Timeout) if !stop.load(Ordering::Relaxed) => {}
                Err(_) => return Err(simulator.join().err().unwrap_or(SimError::Ended)),
            }
        }
    }

    /// How a host reaches the recorder: the path of a pseudo-terminal, or `tcp://ADDRESS:PORT`.
    #[must_use]
    pub fn port(&self) -> &str {
        self.port.lines().next().unwrap_or_default()
    }

    /// How a host reaches the recorders: the port of the first, if it has one, and then each of
    /// them on the bus.
    pub fn ports(&self) -> impl Iterator<Item = &str> {
        self.port.lines()
    }

    /// The emulated board, if it plays the recorder (the first one, on a bus).
    #[cfg(unix)]
    #[must_use]
    pub fn board(&self) -> Option<&EmulatedBoard> {
        self.board.as_ref()
    }

    /// Plays a scenario from the next millisecond on, or after those before it. Returns the
    /// millisecond in which it begins, counted from the simulator's start.
    ///
    /// # Errors
    /// When the simulator has ended.
    pub fn play(&self, scenario: Scenario) -> Result<u64, SimError> {
        self.ask(|reply| Request::Play(scenario, None, reply))
    }

    /// The same from the millisecond on in which this moment lies, so that several recorders see
    /// one incident at the same time.
    ///
    /// # Errors
    /// When the simulator has ended.
    pub fn play_at(&self, at: Instant, scenario: Scenario) -> Result<(), SimError> {
        self.ask(|reply| Request::Play(scenario, Some(at), reply)).map(drop)
    }

    /// Waits until all contacts have moved and the recorder has sampled them.
    ///
    /// # Errors
    /// When that takes longer than `timeout`, or the simulator has ended.
    pub fn wait_played(&self, timeout: Duration) -> Result<(), SimError> {
        let status = self.shared.wait(timeout, |status| status.idle || status.ended);
        if status.ended {
            Err(SimError::Ended)
        } else if status.idle {
            Ok(())
        } else {
            Err(SimError::StillPlaying)
        }
    }

    /// Every contact move so far that changed anything. Empty without
    /// [`keep_played`](SimOptions::keep_played).
    #[must_use]
    pub fn played(&self) -> Vec<Played> {
        self.shared.status().played.clone()
    }

    /// Switches the recorder off and on again, while contacts and line stay as they are. Returns
    /// when the recorder answers.
    ///
    /// # Errors
    /// When the simulator has ended, or the recorder does not come up again.
    pub fn power_cycle(&self) -> Result<(), SimError> {
        self.ask(Request::PowerCycle)
    }

    /// Waits until `stop` is set or the simulator ends by itself, and ends it.
    ///
    /// # Errors
    /// What ended it: contacts that are wrong, an emulator that ended, a line that failed.
    pub fn wait(self, stop: &AtomicBool) -> Result<(), SimError> {
        while !stop.load(Ordering::Relaxed)
            && !self.shared.wait(STOP_CHECK, |status| status.ended).ended
        {}
        self.stop()
    }

    /// Ends the simulator. The line is gone when this returns.
    ///
    /// # Errors
    /// What ended it before, if something did.
    pub fn stop(mut self) -> Result<(), SimError> {
        self.join()
    }

    fn ask<T>(&self, request: impl FnOnce(Sender<T>) -> Request) -> Result<T, SimError> {
        let (reply, answer) = channel();
        self.requests.send(request(reply)).map_err(|_| SimError::Ended)?;
        answer.recv().map_err(|_| SimError::Ended)
    }

    fn join(&mut self) -> Result<(), SimError> {
        self.shared.stop.store(true, Ordering::Relaxed);
        let Some(thread) = self.thread.take() else { return Ok(()) };
        // A panic has already printed its message.
        thread.join().unwrap_or(Err(SimError::Ended))
    }
}

impl Drop for Simulator {
    fn drop(&mut self) {
        let _ = self.join();
    }
}

impl fmt::Debug for Simulator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Simulator").field("port", &self.port).finish_non_exhaustive()
    }
}

/// Simulates a recorder until `stop` is set. When the recorder answers, `ready` is told how a host
/// reaches it, one way a line.
///
/// # Errors
/// As [`Simulator::start`] and [`Simulator::wait`]. Being stopped is never an error.
pub fn run(
    options: SimOptions,
    stop: &AtomicBool,
    ready: impl FnOnce(&str),
) -> Result<(), SimError> {
    match Simulator::start_unless(options, stop) {
        Ok(simulator) => {
            ready(&simulator.port);
            simulator.wait(stop)
        }
        Err(SimError::Ended) if stop.load(Ordering::Relaxed) => Ok(()),
        Err(error) => Err(error),
    }
}

/// What is done once, when the recorder answers for the first time.
struct Start {
    model: Model,
    /// The nodes on the bus, if there is one.
    nodes: Vec<(u8, Model)>,
    contacts: Contacts,
    #[cfg(unix)]
    board: Option<EmulatedBoard>,
    ready: Sender<Ready>,
}

/// What the owner of a simulator gets when the recorder answers.
struct Ready {
    /// All ways to reach the nodes, one a line.
    port: String,
    #[cfg(unix)]
    board: Option<EmulatedBoard>,
}

impl Start {
    fn go(self, service: &mut Service, machine: &mut dyn Machine) -> Result<(), SimError> {
        service.line.publish()?;
        match self.contacts {
            Contacts::None => {}
            Contacts::Scenario(scenario) => {
                machine.play(&scenario);
            }
            Contacts::Stream { name, source } => {
                service.stream = Some(read_stream(&name, source, self.model, &self.nodes));
            }
        }
        service.report(machine);
        // The caller of `start` waits for this, unless it is gone.
        let _ = self.ready.send(Ready {
            port: names(service.line.name(), machine),
            #[cfg(unix)]
            board: self.board,
        });
        Ok(())
    }
}

/// All the ways to reach the nodes, one a line.
fn names(line: String, machine: &dyn Machine) -> String {
    let line = Some(line).filter(|line| !line.is_empty());
    line.into_iter().chain(machine.bus_ports()).collect::<Vec<_>>().join("\n")
}

#[cfg(unix)]
fn run_on_bus(
    service: &mut Service,
    backend: Backend,
    debounce_ms: u8,
    genius: &GeniusOptions,
    mut start: Start,
) -> Result<(), SimError> {
    let shared = Arc::clone(&service.shared);
    let mut options = SimNodeOptions {
        debounce: Debounce::uniform(debounce_ms),
        ..SimNodeOptions::new(start.model)
    };
    let image = match backend {
        Backend::Native { line_rate, non_volatile } => {
            options = SimNodeOptions { line_rate, non_volatile, ..options };
            None
        }
        Backend::Emulator(image) => Some(crate::qemu::emulator::Emulator::new(
            &image,
            start.model,
            debounce_ms,
            true,
            &shared.stop,
        )?),
    };
    start.board = image.as_ref().map(|image| EmulatedBoard::new(image.external_bus()));
    let mut bench = GeniusBench::new(&options, image, genius)?;
    let mut rams = bench.rams();
    let mut start = Some(start);
    let mut cycled: Option<Sender<()>> = None;
    loop {
        let mut machine = bench.power_up(&mut rams)?;
        if !machine.come_up(&shared.stop)? {
            return Ok(());
        }
        if let Some(start) = start.take() {
            start.go(service, &mut machine)?;
        }
        if let Some(reply) = cycled.take() {
            let _ = reply.send(());
        }
        match service.serve(&mut machine)? {
            Outcome::Stopped => return Ok(()),
            Outcome::PowerCycle(reply) => cycled = Some(reply),
        }
        machine.power_off();
    }
}

fn run_native(
    service: &mut Service,
    options: SimNodeOptions,
    start: Start,
) -> Result<(), SimError> {
    let pace = Pace::new();
    let mut ram = Ram::new();
    let mut off = PoweredOff::new(options);
    let mut start = Some(start);
    let mut cycled: Option<Sender<()>> = None;
    loop {
        let mut native = Native { node: off.power_up(&mut ram), pace };
        if let Some(start) = start.take() {
            start.go(service, &mut native)?;
        }
        if let Some(reply) = cycled.take() {
            let _ = reply.send(());
        }
        match service.serve(&mut native)? {
            Outcome::Stopped => return Ok(()),
            Outcome::PowerCycle(reply) => cycled = Some(reply),
        }
        off = native.node.power_off();
    }
}

#[cfg(unix)]
fn run_emulator(
    service: &mut Service,
    options: &EmulatorOptions,
    debounce_ms: u8,
    mut start: Start,
) -> Result<(), SimError> {
    let shared = Arc::clone(&service.shared);
    let mut emulator = crate::qemu::emulator::Emulator::new(
        options,
        start.model,
        debounce_ms,
        false,
        &shared.stop,
    )?;
    start.board = Some(EmulatedBoard::new(emulator.external_bus()));
    emulator.power_up(&shared.stop)?;
    start.go(service, &mut emulator)?;
    loop {
        match service.serve(&mut emulator)? {
            Outcome::Stopped => return Ok(()),
            Outcome::PowerCycle(reply) => {
                emulator.power_up(&shared.stop)?;
                let _ = reply.send(());
            }
        }
    }
}
