//! The ARM image in QEMU as a machine.
//!
//! # Design
//! QEMU's standard input and output are the RS-232 port. The contacts are a latch in the board's
//! external memory, a file that both sides map. There the board also says which sample it took
//! last.
//!
//! On a Genius bus the file also holds the shared RAM of the board's GENI. Whoever plays the bus
//! plays the GENI, too.
//!
//! The board finds its battery-backed clock in the same external memory: a count of milliseconds
//! that is written from here whenever the board is looked after, at least every 2 ms unless this
//! computer is busy. The count starts with this computer's time of day, so the clock goes on from
//! one simulator to the next with the same memory.
//!
//! A step is written when its time has come, and not before the board has sampled the step before.
//! On a stalled machine contacts move late, but no two moves become one and none is lost. Each move
//! is kept with the samples around it. A board that restarts by itself takes the contacts as it
//! finds them. They move again once it samples them, and a move that the restart interrupted does
//! not count.

use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, ErrorKind, Read, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::path::PathBuf;
use std::process::{ChildStdin, ChildStdout, Command as Process, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant, SystemTime};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use ser_proto::{Baud, Command, Decoded, FrameDecoder, FrameEncoder, MAX_BODY_LEN, Model, Reply};
use tempfile::TempDir;

use crate::contacts::player::{Move, Played, Player};
use crate::contacts::scenario::Scenario;
use crate::contacts::scenario_lines::Item;
use crate::error::SimError;
use crate::machine::Machine;
use crate::machine::pace::Pace;
use crate::options::EmulatorOptions;
use crate::qemu::emulator_files::EmulatorFiles;
use crate::qemu::external_bus::ExternalBus;
use crate::qemu::process::{PROGRAM, Qemu, is_temporary, never_wait, read_printed, spawn};

/// How long the image may take to answer, because QEMU starts slowly on a busy machine.
const ANSWER_WITHIN: Duration = Duration::from_secs(60);

/// How often the image is asked meanwhile.
const ASK_EVERY: Duration = Duration::from_millis(250);

/// Bytes that may wait for the board, and for the host.
const WAITING_LIMIT: usize = 4096;

/// How soon the board is looked after when nothing is going on, and when contacts move.
const PATIENCE: Duration = Duration::from_millis(2);
const PATIENCE_PLAYING: Duration = Duration::from_micros(100);

/// A board in QEMU.
pub(crate) struct Emulator {
    program: PathBuf,
    files: EmulatorFiles,
    bus: Arc<ExternalBus>,
    /// The battery-backed clock's count.
    clock: Pace,
    /// How often the board had started when it was looked at last.
    boots: u32,
    /// Whether it has started and not yet sampled its contacts.
    booting: bool,
    running: Option<Running>,
    coming_up: Option<ComingUp>,
    player: Player,
    played: Vec<Played>,
    moving: Option<Moving>,
    /// By how much the latest contact move came late.
    late_ms: u64,
    pace: Pace,
    /// Holds the memory, where no file was given, and what QEMU prints. Dropped last.
    directory: TempDir,
}

/// A move of contacts that the board has not sampled yet.
struct Moving {
    moved: Move,
    tick_before: u32,
}

/// How far a board is that has just been switched on.
struct ComingUp {
    began: Instant,
    asked: Option<Instant>,
    /// Whether the last question has been asked.
    settled: bool,
}

/// QEMU at work.
struct Running {
    qemu: Qemu,
    input: ChildStdin,
    output: ChildStdout,
    to_board: VecDeque<u8>,
    from_board: FromBoard,
}

impl Emulator {
    /// A board without power. It has a GENI if it is to be on a Genius bus. If its log is a pipe
    /// that nobody reads, this waits unless told to stop.
    pub(crate) fn new(
        options: &EmulatorOptions,
        model: Model,
        debounce_ms: u8,
        geni: bool,
        stop: &AtomicBool,
    ) -> Result<Emulator, SimError> {
        let files = EmulatorFiles::open(options, stop)?;
        let directory = TempDir::with_prefix("ser-sim-")
            .map_err(SimError::io("make a temporary directory for the emulator"))?;
        let memory = options.memory.clone().unwrap_or_else(|| directory.path().join("memory"));
        let bus = ExternalBus::open(&memory)
            .map_err(SimError::io(format!("use {} as external memory", memory.display())))?;
        bus.set_straps(model, debounce_ms);
        bus.fit_geni(geni);
        bus.set_inputs(0);
        Ok(Emulator {
            program: options.program.clone().unwrap_or_else(|| PROGRAM.into()),
            files,
            boots: bus.boots(),
            bus: Arc::new(bus),
            clock: Pace::from(Instant::now(), time_of_day_ms()),
            booting: false,
            running: None,
            coming_up: None,
            player: Player::default(),
            played: Vec::new(),
            moving: None,
            late_ms: 0,
            pace: Pace::new(),
            directory,
        })
    }

    /// What the board sees besides its serial line.
    pub(crate) fn external_bus(&self) -> Arc<ExternalBus> {
        Arc::clone(&self.bus)
    }

    /// Counts time as `pace` does from now on.
    pub(crate) fn keep_pace(&mut self, pace: Pace) {
        self.pace = pace;
    }

    /// Its contacts.
    pub(crate) fn player_mut(&mut self) -> &mut Player {
        &mut self.player
    }

    /// Switches the board on, or off and on again, and waits until it answers. Returns early when
    /// told to stop.
    pub(crate) fn power_up(&mut self, stop: &AtomicBool) -> Result<(), SimError> {
        self.switch_on()?;
        while !stop.load(Ordering::Relaxed) && !self.is_up()? {
            self.pause();
        }
        Ok(())
    }

    /// Cuts the power.
    pub(crate) fn switch_off(&mut self) {
        self.running = None;
        self.coming_up = None;
    }

    /// Switches the board on, or off and on again.
    pub(crate) fn switch_on(&mut self) -> Result<(), SimError> {
        self.switch_off();
        self.bus.clear_sample();
        // A fault to force, or a time, from an earlier run is not for this one.
        self.bus.force(0);
        self.bus.set_clock(self.clock.now_ms());
        self.begin_booting();
        self.running = Some(self.start()?);
        self.coming_up = Some(ComingUp { began: Instant::now(), asked: None, settled: false });
        Ok(())
    }

    /// Whether the board that was switched on answers by now. To be asked repeatedly.
    pub(crate) fn is_up(&mut self) -> Result<bool, SimError> {
        self.look_after()?;
        let (Some(running), Some(coming_up)) = (&mut self.running, &mut self.coming_up) else {
            return Ok(true);
        };
        if running.from_board.told_mode && self.bus.is_sampled() {
            running.forget_output();
            self.coming_up = None;
            return Ok(true);
        }
        let waited = coming_up.began.elapsed();
        if waited > ANSWER_WITHIN {
            return Err(SimError::NoAnswer { waited, printed: self.printed() });
        }
        if running.from_board.rate.is_none() {
            if coming_up.asked.is_none_or(|asked| asked.elapsed() > ASK_EVERY) {
                coming_up.asked = Some(Instant::now());
                running.ask(&Command::QueryConfiguration);
            }
        } else if !coming_up.settled {
            // Answers come in order. After this one, no answer to an earlier question is left to
            // confuse a host.
            coming_up.settled = true;
            running.ask(&Command::QueryMode);
        }
        Ok(false)
    }

    /// Waits a moment, or until the board says something.
    pub(crate) fn pause(&self) {
        let timeout = Timespec::try_from(PATIENCE).unwrap_or_default();
        let mut output: Vec<PollFd<'_>> = self
            .running
            .iter()
            .map(|running| PollFd::new(&running.output, PollFlags::IN))
            .collect();
        // Whatever the outcome, the caller looks again.
        let _ = poll(&mut output, Some(&timeout));
    }

    fn start(&self) -> Result<Running, SimError> {
        let doing = || format!("start {}", self.program.display());
        let printed =
            File::create(self.printed_path()).map_err(SimError::io("make a temporary file"))?;
        let mut process = Process::new(&self.program);
        let handed_over = self.files.hand_over(&self.bus).map_err(SimError::io(doing()))?;
        process.args(&handed_over.arguments);
        process.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(printed);
        let mut qemu = spawn(&mut process, &self.program)?;
        drop(handed_over);
        let (input, output) = (qemu.0.stdin.take(), qemu.0.stdout.take());
        let (Some(input), Some(output)) = (input, output) else {
            return Err(SimError::io(doing())(io::Error::other("no pipes")));
        };
        never_wait(&input).and_then(|()| never_wait(&output)).map_err(SimError::io(doing()))?;
        Ok(Running { qemu, input, output, to_board: VecDeque::new(), from_board: FromBoard::new() })
    }

    /// Advances the clock, carries bytes to and from QEMU and checks that it is alive.
    fn look_after(&mut self) -> Result<(), SimError> {
        self.bus.set_clock(self.clock.now_ms());
        let Some(running) = &mut self.running else { return Ok(()) };
        let ended = running.qemu.0.try_wait().map_err(SimError::io("look after the emulator"))?;
        if let Some(status) = ended {
            return Err(SimError::EmulatorEnded {
                how: status.to_string(),
                printed: self.printed(),
            });
        }
        running.carry().map_err(SimError::io("talk to the emulator"))
    }

    /// Ends the moves that the board has not sampled yet, because it takes the contacts as they are
    /// when it starts.
    fn begin_booting(&mut self) {
        self.booting = true;
        self.moving = None;
    }

    /// Whether the board is starting, by itself or because it was switched on.
    fn is_booting(&mut self) -> bool {
        let boots = self.bus.boots();
        if boots != self.boots {
            self.boots = boots;
            self.begin_booting();
        }
        self.booting &= !self.bus.is_sampled();
        self.booting
    }

    fn move_contacts(&mut self) {
        if self.is_booting() {
            return;
        }
        if let Some(moving) =
            self.moving.take_if(|moving| self.bus.sampled_inputs() == moving.moved.state)
        {
            self.played.push(moving.moved.played(moving.tick_before, self.bus.sample_counter()));
        }
        if self.moving.is_some() {
            return;
        }
        let now_ms = self.pace.now_ms();
        if let Some(moved) = self.player.due(now_ms) {
            self.late_ms =
                self.late_ms.max(now_ms.saturating_sub(moved.start_ms.saturating_add(moved.at_ms)));
            let tick_before = self.bus.sample_counter();
            self.bus.set_inputs(moved.state);
            self.moving = Some(Moving { moved, tick_before });
        }
    }

    fn printed_path(&self) -> PathBuf {
        self.directory.path().join("qemu.txt")
    }

    fn printed(&self) -> String {
        read_printed(&self.printed_path())
    }
}

impl Running {
    fn ask(&mut self, question: &Command) {
        self.to_board.extend(FrameEncoder::new(question.to_body()));
    }

    fn carry(&mut self) -> io::Result<()> {
        while !self.to_board.is_empty() {
            let (first, _) = self.to_board.as_slices();
            match self.input.write(first) {
                Ok(written) => drop(self.to_board.drain(..written)),
                Err(error) if is_temporary(&error) => break,
                // QEMU is ending. The next look at the process says how.
                Err(error) if error.kind() == ErrorKind::BrokenPipe => break,
                Err(error) => return Err(error),
            }
        }
        let mut buffer = [0; 1024];
        while self.from_board.bytes.len() < WAITING_LIMIT {
            match self.output.read(&mut buffer) {
                Ok(0) => break,
                Ok(read) => buffer[..read].iter().for_each(|&byte| self.from_board.push(byte)),
                Err(error) if is_temporary(&error) => break,
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    /// Drops the output from before anybody could listen, and the answers to our own questions.
    fn forget_output(&mut self) {
        self.from_board.taken(usize::MAX);
    }
}

/// Bytes from the board, and the rates at which they are sent. The emulated UART does not tell the
/// rate, but a configuration reply announces every change of it.
struct FromBoard {
    bytes: VecDeque<u8>,
    decoder: FrameDecoder<MAX_BODY_LEN>,
    /// The rate of the first byte; `None` until the board has announced one.
    rate: Option<Baud>,
    /// Where in `bytes` other rates begin.
    changes: VecDeque<(usize, Baud)>,
    /// Whether a mode reply has come.
    told_mode: bool,
}

impl FromBoard {
    fn new() -> FromBoard {
        FromBoard {
            bytes: VecDeque::new(),
            decoder: FrameDecoder::new(),
            rate: None,
            changes: VecDeque::new(),
            told_mode: false,
        }
    }

    fn push(&mut self, byte: u8) {
        self.bytes.push_back(byte);
        let Some(Decoded::Frame(body)) = self.decoder.push(byte) else { return };
        let configuration = match Reply::parse(body) {
            Ok(Reply::Configuration(configuration)) => configuration,
            Ok(Reply::Mode(_)) => return self.told_mode = true,
            _ => return,
        };
        let latest = self.changes.back().map(|&(_, rate)| rate).or(self.rate);
        match latest {
            None => self.rate = Some(configuration.baud),
            Some(rate) if rate == configuration.baud => {}
            Some(_) => self.changes.push_back((self.bytes.len(), configuration.baud)),
        }
    }

    /// The waiting bytes that are sent at the present rate.
    fn output(&mut self) -> &[u8] {
        let end = self.changes.front().map_or(self.bytes.len(), |&(at, _)| at);
        self.bytes.make_contiguous().get(..end).unwrap_or_default()
    }

    fn taken(&mut self, count: usize) {
        let count = count.min(self.bytes.len());
        self.bytes.drain(..count);
        for (at, _) in &mut self.changes {
            *at = at.saturating_sub(count);
        }
        while let Some(&(0, rate)) = self.changes.front() {
            self.rate = Some(rate);
            self.changes.pop_front();
        }
    }
}

impl Machine for Emulator {
    fn advance(&mut self) -> Result<(), SimError> {
        self.look_after()?;
        self.move_contacts();
        Ok(())
    }

    fn room(&self) -> usize {
        self.running
            .as_ref()
            .map_or(0, |running| WAITING_LIMIT.saturating_sub(running.to_board.len()))
    }

    fn receive(&mut self, bytes: &[u8]) {
        if let Some(running) = &mut self.running {
            running.to_board.extend(bytes);
            // What cannot be written now is written by the next pass, which also reports errors.
            let _ = running.carry();
        }
    }

    fn output(&mut self) -> &[u8] {
        self.running.as_mut().map_or(&[], |running| running.from_board.output())
    }

    fn taken(&mut self, count: usize) {
        if let Some(running) = &mut self.running {
            running.from_board.taken(count);
        }
    }

    fn baud(&self) -> Baud {
        self.running.as_ref().and_then(|running| running.from_board.rate).unwrap_or_default()
    }

    fn play(&mut self, scenario: &Scenario) -> u64 {
        self.player.play(self.pace.now_ms(), scenario)
    }

    fn stream(&mut self, items: &[Item]) -> Option<u64> {
        self.player.stream(self.pace.now_ms(), items)
    }

    fn waiting_steps(&self) -> usize {
        self.player.waiting()
    }

    fn is_idle(&self) -> bool {
        self.player.is_idle() && self.moving.is_none()
    }

    fn take_played(&mut self) -> Vec<Played> {
        std::mem::take(&mut self.played)
    }

    fn take_lateness_ms(&mut self) -> u64 {
        std::mem::take(&mut self.late_ms)
    }

    fn patience(&self) -> Duration {
        if self.is_idle() { PATIENCE } else { PATIENCE_PLAYING }
    }

    fn descriptors(&self) -> Vec<BorrowedFd<'_>> {
        // While nobody takes the waiting output, more of it is no reason to wake up.
        let running =
            self.running.iter().filter(|running| running.from_board.bytes.len() < WAITING_LIMIT);
        running.map(|running| running.output.as_fd()).collect()
    }
}

/// Milliseconds since 1970 by this computer's clock.
fn time_of_day_ms() -> u64 {
    let since_1970 = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since_1970.as_millis()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use ser_proto::{Configuration, Mode};

    use super::*;

    fn frame(reply: &Reply) -> Vec<u8> {
        FrameEncoder::new(reply.to_body()).collect()
    }

    #[test]
    fn a_new_rate_holds_from_the_byte_after_the_reply_that_announces_it() {
        let mut from_board = FromBoard::new();
        let configuration = Configuration::default();
        let changed = Configuration { baud: Baud::B19200, ..configuration };
        let first = frame(&Reply::Configuration(configuration));
        let announcement = frame(&Reply::Configuration(changed));
        let after = frame(&Reply::Mode(Mode { recording: true, version: 100 }));
        for &byte in first.iter().chain(&announcement).chain(&after) {
            from_board.push(byte);
        }
        assert_eq!(from_board.output(), [first, announcement].concat());
        assert_eq!(from_board.rate, Some(Baud::B9600));
        from_board.taken(5);
        let rest = from_board.output().len();
        from_board.taken(rest);
        assert_eq!(from_board.rate, Some(Baud::B19200));
        assert_eq!(from_board.output(), after);
    }

    #[test]
    fn a_missing_emulator_is_named_with_its_package() {
        let image = tempfile::NamedTempFile::new().unwrap();
        let mut options = EmulatorOptions::new(image.path());
        options.program = Some("/nonexistent/qemu-system-arm".into());
        let mut emulator =
            Emulator::new(&options, Model::Ser160, 0, false, &AtomicBool::new(false)).unwrap();
        let error = emulator.power_up(&AtomicBool::new(false)).unwrap_err().to_string();
        assert!(
            error.contains("not installed") && error.contains("package qemu-system-arm"),
            "{error}"
        );
    }

    #[test]
    fn an_emulator_that_ends_says_how_and_why() {
        let image = tempfile::NamedTempFile::new().unwrap();
        let mut options = EmulatorOptions::new(image.path());
        // The shell does not know the option -M.
        options.program = Some("/bin/sh".into());
        let mut emulator =
            Emulator::new(&options, Model::Ser160, 0, false, &AtomicBool::new(false)).unwrap();
        let error = emulator.power_up(&AtomicBool::new(false)).unwrap_err().to_string();
        assert!(error.contains("exit status: 2") && error.contains("-M"), "{error}");
    }
}
