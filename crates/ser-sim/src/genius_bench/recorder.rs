//! A recorder on the bus, under power: the built-in node or the ARM image, each with its GENI
//! board.
//!
//! The built-in node lives in virtual time and reaches its board directly. The image lives in real
//! time; its board's shared RAM is in the emulated board's external memory, and is compared with
//! the board's once per millisecond.

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
    /// Whether the port holds the board's reset line.
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
    /// The built-in node, which goes to `off` when its power is cut.
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

    /// The ARM image, which has been switched on.
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

    /// Its device number.
    pub(super) fn number(&self) -> u8 {
        self.number
    }

    /// The built-in node: its time can run ahead of real time.
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

    /// The same, to be changed.
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

    /// Counts time as the bus does, from now on.
    pub(super) fn keep_pace(&mut self, pace: Pace) {
        match &mut self.body {
            Body::BuiltIn(built_in) => built_in.native.pace = pace,
            Body::Image(image) => image.emulator.keep_pace(pace),
        }
    }

    /// Whether it answers by now; to be asked again and again.
    pub(super) fn is_up(&mut self) -> Result<bool, SimError> {
        match &mut self.body {
            Body::BuiltIn(_) => Ok(true),
            Body::Image(image) => image.emulator.is_up(),
        }
    }

    /// Waits a moment for what lives in real time.
    pub(super) fn pause(&self) {
        if let Body::Image(image) = &self.body {
            image.emulator.pause();
        }
    }

    /// Does what has to be done now and then, however little time has passed.
    pub(super) fn look_after(&mut self) -> Result<(), SimError> {
        match &mut self.body {
            Body::BuiltIn(_) => Ok(()),
            Body::Image(image) => image.emulator.advance(),
        }
    }

    /// Lets the recorder live up to millisecond `ms`, and the board know what it has done.
    pub(super) fn advance_to(&mut self, ms: u64) {
        match &mut self.body {
            Body::BuiltIn(built_in) => built_in.advance_to(ms, &self.board),
            Body::Image(image) => image.tell_board(&self.board),
        }
    }

    /// The board has lived up to the present: lets the recorder know what it has done.
    pub(super) fn bus_advanced(&mut self) {
        if let Body::Image(image) = &self.body {
            self.board.lock().publish(|offset, byte| image.memory.write_geni(offset, byte));
        }
    }

    /// Rules that it broke at its board, since this was last asked.
    pub(super) fn take_violations(&mut self) -> Vec<Violation> {
        let violations = self.board.lock().take_new_violations();
        match self.body {
            Body::BuiltIn(_) => violations,
            Body::Image(_) => as_seen_from_afar(violations),
        }
    }

    /// Cuts the power of both; the board starts anew with its recorder.
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
        // Before the node records what came after them.
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
            // However short it was, it is never missed.
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

/// Without what only seems wrong: when a host in another process lets the reset line go is seen
/// late here, so that it may seem to begin too early.
pub(super) fn as_seen_from_afar(mut violations: Vec<Violation>) -> Vec<Violation> {
    violations.retain(|violation| violation.kind != ViolationKind::TooEarly);
    violations
}
