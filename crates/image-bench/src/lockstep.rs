//! The ARM image in QEMU in virtual time. It runs from stop to stop, and the world moves while it
//! is held.
//!
//! # Design
//! QEMU derives time from the count of instructions (`-icount`), and its plugin
//! `image-bench-plugin` holds the processor before chosen instructions. Between two stops nothing
//! reaches the board from outside. What happens is then the same in every run and on every machine,
//! and every instruction can be looked at.
//!
//! Inputs, clock and GENI board are in the memory that both sides map. Bytes for the board's UART
//! go through QEMU's standard input. The UART's state, read through QEMU's test interface
//! (`-qtest`), tells that they have arrived. QEMU has no line rate, but it does keep a byte that
//! its standard output does not take. That output is a pipe for one byte, so the transmitter is
//! busy for as long as the bench leaves the byte there.
//!
//! # Tradeoffs
//! One instruction lasts 2⁵ ns, which is 31.25 million in a second, less than any chip that one
//! would flash. At 2⁰ ns the processor would be so fast that nothing would be a load. Numbers of
//! instructions do not depend on it.
//!
//! # Notes
//! An idle processor makes QEMU 7.2 jump two timer periods ahead instead of one. The bench
//! therefore has to prevent the processor from sleeping, with a `nop` in place of each `wfi`: see
//! [`Lockstep::patch`].

mod line_out;
mod probe;
mod tracer;

use std::ffi::OsString;
use std::fs::File;
use std::io::{self, Write};
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::os::unix::net::UnixListener;
use std::path::{Path, PathBuf};
use std::process::{ChildStdin, Command as Process, Stdio};
use std::sync::atomic::AtomicBool;
use std::thread;
use std::time::{Duration, Instant};

use ser_proto::Model;
use tempfile::TempDir;

use ser_sim::EmulatorOptions;
use ser_sim::ForcedFault;
use ser_sim::SimError;
use ser_sim::genius::Board;
use ser_sim::qemu::emulator_files::EmulatorFiles;
use ser_sim::qemu::external_bus::ExternalBus;
use ser_sim::qemu::process::{PROGRAM, Qemu, is_temporary, read_printed, spawn};

use line_out::LineOut;
use probe::Probe;
use tracer::Tracer;

/// How long QEMU may take for anything, because machines stall for seconds.
const PATIENCE: Duration = Duration::from_secs(120);

/// How often the bench looks again while it waits.
const LOOK_EVERY: Duration = Duration::from_millis(1);

/// The exponent of an instruction's duration: two to the power of this, in nanoseconds.
const INSTRUCTION_SHIFT: u32 = 5;

/// Instructions that the processor executes in a millisecond.
pub const INSTRUCTIONS_PER_MS: u64 = 1_000_000 >> INSTRUCTION_SHIFT;

/// How a board is set up. Boards otherwise differ in nothing.
#[derive(Clone, Debug)]
pub struct LockstepOptions {
    /// The image and the emulator.
    pub emulator: EmulatorOptions,
    /// The plugin for QEMU, built from `image-bench-plugin`.
    pub plugin: PathBuf,
    /// Which recorder the board is strapped to be.
    pub model: Model,
    /// Debounce time of all inputs that the board is strapped for; 0 is off.
    pub debounce_ms: u8,
    /// Whether it has a GENI board.
    pub geni: bool,
    /// Addresses of the instructions to stop at. The first instruction after a reset has to be one.
    pub stops: Vec<u32>,
}

/// An emulated board that is held at a stop.
pub struct Lockstep {
    bus: ExternalBus,
    /// The last seen state of the GENI board's reset line.
    geni_reset: u32,
    tracer: Tracer,
    probe: Probe,
    input: ChildStdin,
    output: LineOut,
    qemu: Qemu,
    /// Holds memory, sockets, and what QEMU prints. Dropped last.
    directory: TempDir,
}

impl Lockstep {
    /// Switches on a board, and holds it at the very first instruction. All contacts are open.
    ///
    /// # Errors
    /// When the emulator or the plugin cannot be started.
    pub fn start(options: &LockstepOptions) -> Result<Lockstep, SimError> {
        let files = EmulatorFiles::open(&options.emulator, &AtomicBool::new(false))?;
        let directory = TempDir::with_prefix("ser-sim-")
            .map_err(SimError::io("make a temporary directory for the emulator"))?;
        let memory = directory.path().join("memory");
        let bus = ExternalBus::open(&memory)
            .map_err(SimError::io(format!("use {} as external memory", memory.display())))?;
        bus.set_straps(options.model, options.debounce_ms);
        bus.fit_geni(options.geni);
        bus.set_inputs(0);
        bus.set_clock(0);

        let [plugin_at, probe_at] = ["plugin", "probe"].map(|name| directory.path().join(name));
        let listen =
            |path: &Path| UnixListener::bind(path).map_err(SimError::io("listen to the emulator"));
        let (plugin, probe) = (listen(&plugin_at)?, listen(&probe_at)?);
        let program = options.emulator.program.clone().unwrap_or_else(|| PROGRAM.into());
        let printed = File::create(directory.path().join(PRINTED))
            .map_err(SimError::io("make a temporary file"))?;
        let mut process = Process::new(&program);
        let handed_over = files.hand_over(&bus).map_err(SimError::io("start the emulator"))?;
        process.args(&handed_over.arguments).args(extra(options, &plugin_at, &probe_at));
        let (output, qemus) =
            LineOut::new().map_err(SimError::io("make a pipe for the emulator"))?;
        process.stdin(Stdio::piped()).stdout(qemus).stderr(printed);
        let mut qemu = spawn(&mut process, &program)?;
        // QEMU now has our copies of its files, and of its end of the pipe.
        drop((handed_over, process));
        let input = qemu.0.stdin.take().ok_or(SimError::Ended)?;
        let mut accept = |listener| accept(listener, &mut qemu, directory.path());
        let (tracer, probe) = (Tracer::new(accept(&plugin)?), Probe::new(accept(&probe)?));
        let geni_reset = bus.geni_reset();
        let mut lockstep =
            Lockstep { bus, geni_reset, tracer, probe, input, output, qemu, directory };
        lockstep.tracer.read(&mut |_| {}).map_err(|error| lockstep.explain(error))?;
        Ok(lockstep)
    }

    /// Lets the board run to the next stop, and returns its address. `executed` is told of every
    /// instruction, from the one at which the board is held up to that stop, which is not included.
    ///
    /// # Errors
    /// When the emulator has ended or hangs.
    pub fn run_and_tell(&mut self, executed: &mut impl FnMut(u32)) -> Result<u32, SimError> {
        self.tracer
            .go(true)
            .and_then(|()| self.tracer.read(executed))
            .map_err(|error| self.explain(error))
    }

    /// Lets the board run to the next stop without telling of instructions, which is faster.
    ///
    /// # Errors
    /// When the emulator has ended or hangs.
    pub fn run(&mut self) -> Result<u32, SimError> {
        self.tracer
            .go(false)
            .and_then(|()| self.tracer.read(&mut |_| {}))
            .map_err(|error| self.explain(error))
    }

    /// Replaces an instruction that has not been executed yet by another one.
    ///
    /// # Errors
    /// When the emulator has ended or hangs.
    pub fn patch(&mut self, address: u32, instruction: u16) -> Result<(), SimError> {
        self.probe.write_halfword(address, instruction).map_err(|error| self.explain(error))
    }

    /// Moves all contacts at once.
    pub fn set_inputs(&self, inputs: u32) {
        self.bus.set_inputs(inputs);
    }

    /// Advances the battery-backed clock to `count_ms`.
    pub fn set_clock(&self, count_ms: u64) {
        self.bus.set_clock(count_ms);
    }

    /// Makes something go wrong in the next pass of the main loop.
    pub fn force(&self, fault: ForcedFault) {
        self.bus.force(fault as u32);
    }

    /// The tick of the latest sample.
    #[must_use]
    pub fn tick_ms(&self) -> u32 {
        self.bus.sample_counter()
    }

    /// How often the image has started.
    #[must_use]
    pub fn boots(&self) -> u32 {
        self.bus.boots()
    }

    /// Gives the UART a byte, if it has room for one. False if it has not.
    ///
    /// # Errors
    /// When the emulator has ended or hangs.
    pub fn receive(&mut self, byte: u8) -> Result<bool, SimError> {
        let received = self.try_receive(byte);
        received.map_err(|error| self.explain(error))
    }

    fn try_receive(&mut self, byte: u8) -> io::Result<bool> {
        if self.probe.uart_is_full()? {
            return Ok(false);
        }
        self.input.write_all(&[byte])?;
        self.input.flush()?;
        self.until(Probe::uart_is_full)?;
        Ok(true)
    }

    /// Takes the byte out of the transmitter's shift register, if there is one. The next byte, if
    /// there is one, takes its place. The transmitter is busy until then.
    ///
    /// # Errors
    /// When the emulator has ended or hangs.
    pub fn take_sent(&mut self) -> Result<Option<u8>, SimError> {
        let taken = self.try_take_sent();
        taken.map_err(|error| self.explain(error))
    }

    fn try_take_sent(&mut self) -> io::Result<Option<u8>> {
        let next = self.probe.uart_is_sending()?;
        let byte = self.output.take()?;
        if byte.is_some() && next {
            self.until(|probe| probe.uart_is_sending().map(|sending| !sending))?;
        }
        Ok(byte)
    }

    /// Waits until QEMU has moved a byte.
    fn until(&mut self, mut moved: impl FnMut(&mut Probe) -> io::Result<bool>) -> io::Result<()> {
        let deadline = Instant::now() + PATIENCE;
        while !moved(&mut self.probe)? {
            if Instant::now() > deadline {
                return Err(io::Error::from(io::ErrorKind::TimedOut));
            }
        }
        Ok(())
    }

    /// Shows the GENI board what the image has done to its shared RAM and its reset line.
    pub fn tell_geni(&mut self, board: &mut Board) {
        let reset = self.bus.geni_reset();
        if reset != self.geni_reset {
            self.geni_reset = reset;
            board.hold_reset();
            if reset & 1 == 0 {
                board.release_reset();
            }
        }
        board.sync_with(|offset| self.bus.read_geni(offset));
    }

    /// Shows the image what the GENI board has done to its shared RAM.
    pub fn hear_geni(&mut self, board: &mut Board) {
        board.publish(|offset, byte| self.bus.write_geni(offset, byte));
    }

    /// Finds out why the emulator does not talk to us.
    fn explain(&mut self, error: io::Error) -> SimError {
        explain(error, &mut self.qemu, self.directory.path())
    }
}

/// File for what QEMU prints.
const PRINTED: &str = "qemu.txt";

/// Options that make QEMU's time virtual and let the bench in.
fn extra(options: &LockstepOptions, plugin_at: &Path, probe_at: &Path) -> Vec<OsString> {
    let mut plugin = OsString::from("file=");
    plugin.push(doubled_commas(&options.plugin));
    plugin.push(",socket=");
    plugin.push(doubled_commas(plugin_at));
    for stop in &options.stops {
        plugin.push(format!(",stop={stop:x}"));
    }
    let mut probe = OsString::from("unix:");
    probe.push(doubled_commas(probe_at));
    let icount = format!("shift={INSTRUCTION_SHIFT},sleep=off");
    vec![
        "-icount".into(),
        icount.into(),
        "-plugin".into(),
        plugin,
        "-qtest".into(),
        probe,
        "-qtest-log".into(),
        "none".into(),
    ]
}

/// A comma ends an option of QEMU unless it is doubled.
fn doubled_commas(path: &Path) -> OsString {
    let bytes = path.as_os_str().as_bytes();
    OsString::from_vec(
        bytes.iter().flat_map(|&byte| [byte].repeat(if byte == b',' { 2 } else { 1 })).collect(),
    )
}

/// Waits for the emulator to connect.
fn accept(
    listener: &UnixListener,
    qemu: &mut Qemu,
    directory: &Path,
) -> Result<std::os::unix::net::UnixStream, SimError> {
    let deadline = Instant::now() + PATIENCE;
    let accepted = loop {
        let ended = qemu.0.try_wait().map_err(SimError::io("look after the emulator"))?.is_some();
        let accepted = listener.set_nonblocking(true).and_then(|()| listener.accept());
        match accepted {
            Err(error) if is_temporary(&error) && !ended && Instant::now() < deadline => {
                thread::sleep(LOOK_EVERY);
            }
            accepted => break accepted,
        }
    };
    let ready = accepted.and_then(|(stream, _)| {
        stream.set_nonblocking(false)?;
        stream.set_read_timeout(Some(PATIENCE))?;
        Ok(stream)
    });
    ready.map_err(|error| explain(error, qemu, directory))
}

fn explain(error: io::Error, qemu: &mut Qemu, directory: &Path) -> SimError {
    let printed = read_printed(&directory.join(PRINTED));
    let lost = matches!(
        error.kind(),
        io::ErrorKind::UnexpectedEof | io::ErrorKind::BrokenPipe | io::ErrorKind::ConnectionReset
    );
    // A process that hangs up is about to end.
    let ended = if lost { qemu.0.wait().ok() } else { qemu.0.try_wait().ok().flatten() };
    match ended {
        Some(status) => SimError::EmulatorEnded { how: status.to_string(), printed },
        None if is_temporary(&error) => SimError::NoAnswer { waited: PATIENCE, printed },
        None => SimError::io("talk to the emulator")(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commas_in_paths_do_not_end_qemus_options() {
        assert_eq!(doubled_commas(Path::new("/a,b/c")), "/a,,b/c");
    }

    #[test]
    fn an_emulator_that_knows_no_such_options_says_so() {
        let image = tempfile::NamedTempFile::new().unwrap();
        let mut emulator = EmulatorOptions::new(image.path());
        // The shell does not know the option -M.
        emulator.program = Some("/bin/sh".into());
        let options = LockstepOptions {
            emulator,
            plugin: "plugin.so".into(),
            model: Model::Ser160,
            debounce_ms: 0,
            geni: false,
            stops: vec![0xC0],
        };
        let error = Lockstep::start(&options).err().unwrap().to_string();
        assert!(error.contains("exit status: 2") && error.contains("-M"), "{error}");
    }
}
