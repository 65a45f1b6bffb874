//! A recorder on the bus, under power: the built-in one or the ARM image, each with its GENI
//! board.
//!
//! The built-in recorder lives in virtual time and reaches its board directly. The image lives in real
//! time. It reaches its board's shared RAM through the emulated board's external memory, which is
//! compared with the simulated board's RAM once per millisecond.

use std::sync::Arc;

use ser_node::GeniusPort;

use super::shared_board::{BoardRam, SharedBoard};
use crate::contacts::player::Player;
use crate::error::SimError;
use crate::genius::{Violation, ViolationKind, tick_ms};
use crate::machine::Machine;
use crate::machine::native::Native;
use crate::machine::pace::Pace;
use crate::machine::sim_node::{PoweredOff, SimNode};
use crate::qemu::emulator::Emulator;
use crate::qemu::external_bus::ExternalBus;

/// A recorder under power, and its board.
pub(super) struct Recorder<'a> {
    number: u8,
    board: SharedBoard,
    body: Body<'a>,
}

enum Body<'a> {
    BuiltIn(Box<BuiltIn<'a>>),
    Image(Image<'a>),
}

struct BuiltIn<'a> {
    native: Native<'a>,
    port: GeniusPort<BoardRam>,
    /// Whether the port holds the GENI board's reset line.
    in_reset: bool,
    /// Where the node goes when its power is cut.
    off: &'a mut Option<PoweredOff>,
}

struct Image<'a> {
    emulator: &'a mut Emulator,
    memory: Arc<ExternalBus>,
    /// The reset line's word as it was last seen.
    reset: u32,
}

impl<'a> Recorder<'a> {
    /// The built-in node. It moves to `off` when its power is cut.
    pub(super) fn new(
        number: u8,
        board: SharedBoard,
        node: SimNode<'a>,
        port: GeniusPort<BoardRam>,
        off: &'a mut Option<PoweredOff>,
    ) -> Recorder<'a> {
        let native = Native { node, pace: Pace::new() };
        let body = Body::BuiltIn(Box::new(BuiltIn { native, port, in_reset: false, off }));
        Recorder { number, board, body }
    }

    /// The ARM image, which is already switched on.
    pub(super) fn with_image(
        number: u8,
        board: SharedBoard,
        emulator: &'a mut Emulator,
    ) -> Recorder<'a> {
        let memory = emulator.external_bus();
        let reset = memory.geni_reset();
        let body = Body::Image(Image { emulator, memory, reset });
        Recorder { number, board, body }
    }

    /// Its bus address.
    pub(super) fn number(&self) -> u8 {
        self.number
    }

    /// The built-in node, whose time can run ahead of real time.
    pub(super) fn built_in_node(&mut self) -> Option<&mut SimNode<'a>> {
        match &mut self.body {
            Body::BuiltIn(built_in) => Some(&mut built_in.native.node),
            Body::Image(_) => None,
        }
    }

    /// Its contacts and its serial line.
    pub(super) fn unit(&self) -> &dyn Machine {
        match &self.body {
            Body::BuiltIn(built_in) => &built_in.native,
            Body::Image(image) => image.emulator,
        }
    }

    /// Its contacts and its serial line, mutably.
    pub(super) fn unit_mut(&mut self) -> &mut dyn Machine {
        match &mut self.body {
            Body::BuiltIn(built_in) => &mut built_in.native,
            Body::Image(image) => image.emulator,
        }
    }

    /// What moves its contacts.
    pub(super) fn player_mut(&mut self) -> &mut Player {
        match &mut self.body {
            Body::BuiltIn(built_in) => built_in.native.node.player_mut(),
            Body::Image(image) => image.emulator.player_mut(),
        }
    }

    /// Counts time as the bus does from now on.
    pub(super) fn keep_pace(&mut self, pace: Pace) {
        match &mut self.body {
            Body::BuiltIn(built_in) => built_in.native.pace = pace,
            Body::Image(image) => image.emulator.keep_pace(pace),
        }
    }

    /// Whether it answers by now. To be asked repeatedly.
    pub(super) fn is_up(&mut self) -> Result<bool, SimError> {
        match &mut self.body {
            Body::BuiltIn(_) => Ok(true),
            Body::Image(image) => image.emulator.is_up(),
        }
    }

    /// Waits a moment if the recorder lives in real time.
    pub(super) fn pause(&self) {
        if let Body::Image(image) = &self.body {
            image.emulator.pause();
        }
    }

    /// Does what has to be done regularly, however little time has passed.
    pub(super) fn look_after(&mut self) -> Result<(), SimError> {
        match &mut self.body {
            Body::BuiltIn(_) => Ok(()),
            Body::Image(image) => image.emulator.advance(),
        }
    }

    /// Lets the recorder live up to millisecond `ms`, and tells its board what the recorder has
    /// done.
    pub(super) fn advance_to(&mut self, ms: u64) {
        match &mut self.body {
            Body::BuiltIn(built_in) => built_in.advance_to(ms, &self.board),
            Body::Image(image) => image.tell_board(&self.board),
        }
    }

    /// Tells the recorder what its board has done. The board has lived up to the present.
    pub(super) fn bus_advanced(&mut self) {
        if let Body::Image(image) = &self.body {
            self.board.lock().publish(|offset, byte| image.memory.write_geni(offset, byte));
        }
    }

    /// The rules of its board that the recorder broke since this was last asked.
    pub(super) fn take_violations(&mut self) -> Vec<Violation> {
        let violations = self.board.lock().take_new_violations();
        match self.body {
            Body::BuiltIn(_) => violations,
            Body::Image(_) => as_seen_from_afar(violations),
        }
    }

    /// Cuts the power of both. The board starts anew with its recorder.
    pub(super) fn power_off(self) {
        restart(&self.board);
        match self.body {
            Body::BuiltIn(built_in) => *built_in.off = Some(built_in.native.node.power_off()),
            Body::Image(image) => image.emulator.switch_off(),
        }
    }
}

impl BuiltIn<'_> {
    fn advance_to(&mut self, ms: u64, board: &SharedBoard) {
        // This comes before the node records what happened after the interrupts.
        for at_us in board.lock().take_interrupts() {
            self.native.node.interrupt(&mut self.port, tick_ms(at_us));
        }
        self.native.node.advance_to(ms);
        self.native.node.serve(&mut self.port);
        let held = self.port.reset_held();
        if held != self.in_reset {
            self.in_reset = held;
            let mut board = board.lock();
            if held { board.hold_reset() } else { board.release_reset() }
        }
    }
}

impl Image<'_> {
    fn tell_board(&mut self, board: &SharedBoard) {
        let reset = self.memory.geni_reset();
        if reset != self.reset {
            self.reset = reset;
            // A pulse is never missed, however short it was.
            restart(board);
            if reset & 1 != 0 {
                board.lock().hold_reset();
            }
        }
        board.lock().sync_with(|offset| self.memory.read_geni(offset));
    }
}

fn restart(board: &SharedBoard) {
    let mut board = board.lock();
    board.hold_reset();
    board.release_reset();
}

/// Leaves out violations that may only seem so. We see late when a host in another process lets the
/// reset line go, so the host may seem to begin too early.
pub(super) fn as_seen_from_afar(mut violations: Vec<Violation>) -> Vec<Violation> {
    violations.retain(|violation| violation.kind != ViolationKind::TooEarly);
    violations
}
