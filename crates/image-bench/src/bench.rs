//! The emulated board on a bench: contacts, a serial line at full rate and, if wanted, a Genius
//! bus, all in step with the board's own milliseconds.
//!
//! The bench acts while the capture interrupt is about to take its sample. What it changes then is
//! already in that sample.

use std::collections::VecDeque;
use std::path::PathBuf;

use crate::lockstep::{Lockstep, LockstepOptions};
use ser_board::serial_line::CHARACTER_BITS;
use ser_proto::{Baud, Command, FrameEncoder, Model};
use ser_sim::{EmulatorOptions, ForcedFault, SimError};

use super::genius::Genius;
use super::program::{Handler, Kind, Program};
use super::tally::Tally;

/// NOP. With it the processor goes on where it would sleep.
const NOP: u16 = 0xBF00;

/// Bytes per second on the line, which are thousandths of a byte per millisecond.
pub const RATE: u32 = Baud::B19200.bits_per_second() / CHARACTER_BITS;
const BYTE: u32 = 1000;

/// What the battery-backed clock shows first: 2026-11-22 10:00.
pub const FIRST_MS: u64 = 1_795_341_600_000;

/// What one direction of the line could have carried by now but did not.
#[derive(Clone, Copy, Debug, Default)]
struct Credit(u32);

impl Credit {
    /// A millisecond passes. A line that waits for an interrupt catches up for that long and no
    /// more.
    fn pass_ms(&mut self) {
        self.0 = (self.0 + RATE).min(4 * BYTE);
    }

    /// Whether a byte is due.
    fn is_due(self) -> bool {
        self.0 >= BYTE
    }

    /// Carries a byte.
    fn carry(&mut self) {
        self.0 -= BYTE;
    }

    /// There is nothing to carry. An idle line saves nothing up.
    fn idle(&mut self) {
        self.0 = self.0.min(BYTE);
    }
}

/// The files that the bench needs.
#[derive(Clone, Debug)]
pub struct Parts {
    /// The image, an ELF file.
    pub image: PathBuf,
    /// The plugin for the emulator.
    pub plugin: PathBuf,
}

/// How the board is strapped and what is connected.
#[derive(Clone, Copy, Debug)]
pub struct Setup {
    /// Debounce time of all inputs.
    pub debounce_ms: u8,
    /// Whether there is a Genius bus.
    pub genius: bool,
}

/// The bench.
pub struct Bench<'p> {
    /// What was executed while the bench was [told](Bench::tell) of it.
    pub tally: Tally<'p>,
    /// The bus, if there is one.
    pub genius: Option<Genius>,
    program: &'p Program,
    board: Lockstep,
    telling: bool,
    /// The instruction at which the board is held.
    at: u32,
    now_ms: u64,
    inputs: u32,
    to_board: VecDeque<u8>,
    credit_to: Credit,
    credit_from: Credit,
    sent: Vec<u8>,
    /// Whether the board had nothing to send when a byte from it was due.
    silent: bool,
    carried: Carried,
    /// The tick of the latest sample when the board got its latest byte.
    brought_ms: u64,
}

/// Bytes that the serial line has carried.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Carried {
    /// To the board.
    pub to: u64,
    /// From it.
    pub from: u64,
}

impl<'p> Bench<'p> {
    /// Switches the board on. All contacts are open.
    ///
    /// # Errors
    /// When the emulator does not start.
    pub fn start(parts: &Parts, program: &'p Program, setup: Setup) -> Result<Bench<'p>, String> {
        let mut stops = vec![program.reset(), program.entry(Handler::Capture)];
        stops.extend(
            [Handler::Receive, Handler::Transmit].into_iter().flat_map(|it| program.returns(it)),
        );
        let options = LockstepOptions {
            emulator: EmulatorOptions::new(&parts.image),
            plugin: parts.plugin.clone(),
            model: Model::Ser320,
            debounce_ms: setup.debounce_ms,
            geni: setup.genius,
            stops,
        };
        let mut board = Lockstep::start(&options).map_err(|error| error.to_string())?;
        for address in program.all(Kind::Sleep) {
            board.patch(address, NOP).map_err(|error| error.to_string())?;
        }
        board.set_clock(FIRST_MS);
        Ok(Bench {
            tally: Tally::new(program),
            genius: setup.genius.then(Genius::new),
            program,
            board,
            telling: false,
            at: program.reset(),
            now_ms: 0,
            inputs: 0,
            to_board: VecDeque::new(),
            credit_to: Credit::default(),
            credit_from: Credit::default(),
            sent: Vec::new(),
            silent: true,
            carried: Carried::default(),
            brought_ms: 0,
        })
    }

    /// Counts every instruction from now on, or none.
    pub fn tell(&mut self, telling: bool) {
        if telling && !self.telling {
            // The instruction at which the board is held has not been counted.
            self.tally.executed(self.at);
        }
        self.telling = telling;
    }

    /// The tick of the sample that is about to be taken.
    #[must_use]
    pub fn now_ms(&self) -> u64 {
        self.now_ms
    }

    /// Lets a millisecond pass, and holds the board before the next sample.
    ///
    /// # Errors
    /// When the board misses a sample, starts anew, or the emulator ends.
    pub fn pass_ms(&mut self) -> Result<(), String> {
        let capture = self.program.entry(Handler::Capture);
        while self.run()? != capture {
            self.carry()?;
        }
        if u64::from(self.board.tick_ms()) != self.now_ms {
            return Err(format!(
                "the sample of {} ms is missing: the latest is that of {} ms",
                self.now_ms,
                self.board.tick_ms()
            ));
        }
        self.now_ms += 1;
        self.board.set_clock(FIRST_MS + self.now_ms);
        if let Some(genius) = &mut self.genius {
            genius.advance(self.now_ms, &mut self.board);
        }
        self.credit_to.pass_ms();
        self.credit_from.pass_ms();
        self.carry()
    }

    fn run(&mut self) -> Result<u32, String> {
        let tally = &mut self.tally;
        let stop = if self.telling {
            self.board.run_and_tell(&mut |address| tally.executed(address))
        } else {
            self.board.run()
        };
        let stop = stop.map_err(|error| error.to_string())?;
        if stop == self.program.reset() {
            return Err("the image has started anew".to_owned());
        }
        if self.telling {
            self.tally.executed(stop);
        }
        self.at = stop;
        Ok(stop)
    }

    /// Carries the next byte of each direction, if it is due.
    fn carry(&mut self) -> Result<(), String> {
        self.bring().and_then(|()| self.take()).map_err(|error| error.to_string())
    }

    /// Brings the board a byte, if there is room for it.
    fn bring(&mut self) -> Result<(), SimError> {
        let Some(&byte) = self.to_board.front() else {
            self.credit_to.idle();
            return Ok(());
        };
        if self.credit_to.is_due() && self.board.receive(byte)? {
            self.credit_to.carry();
            self.carried.to += 1;
            self.brought_ms = self.now_ms;
            self.to_board.pop_front();
        }
        Ok(())
    }

    /// Takes a byte from the board. Its transmitter is busy until then.
    fn take(&mut self) -> Result<(), SimError> {
        if !self.credit_from.is_due() {
            return Ok(());
        }
        let byte = self.board.take_sent()?;
        self.silent = byte.is_none();
        if let Some(byte) = byte {
            self.credit_from.carry();
            self.carried.from += 1;
            self.sent.push(byte);
        } else {
            self.credit_from.idle();
        }
        Ok(())
    }

    /// Moves these contacts, in the sample that is about to be taken.
    pub fn toggle(&mut self, inputs: u32) {
        self.inputs ^= inputs;
        self.board.set_inputs(self.inputs);
    }

    /// Stops the main loop. The watchdog tolerates that for two seconds.
    pub fn hang_main_loop(&self) {
        self.board.force(ForcedFault::MainLoopHangs);
    }

    /// Puts bytes on the line, after those that wait.
    pub fn send(&mut self, bytes: &[u8]) {
        self.to_board.extend(bytes);
    }

    /// Puts a command on the line.
    pub fn send_command(&mut self, command: &Command) {
        self.to_board.extend(FrameEncoder::new(command.to_body()));
    }

    /// What the line has carried so far.
    #[must_use]
    pub fn carried(&self) -> Carried {
        self.carried
    }

    /// In which of its milliseconds the board got its latest byte, by the tick that its receive
    /// interrupt then reads.
    #[must_use]
    pub fn brought_ms(&self) -> u64 {
        self.brought_ms
    }

    /// Bytes that wait for the line.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.to_board.len()
    }

    /// Whether the board says nothing on the line.
    #[must_use]
    pub fn is_silent(&self) -> bool {
        self.silent
    }

    /// Takes what the board has said on the line.
    pub fn take_sent(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.sent)
    }
}
