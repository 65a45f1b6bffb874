//! The shared RAM of a board on a bus, in the form that the driver for the board expects.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use geni_board::{RAM_LEN, SharedRam};

use super::board::Board;
use super::bus::{Bus, Handle};

/// The tick, in milliseconds, that an interrupt reads in this microsecond.
///
/// As in the firmware, it is the tick of the latest sample, and not of the next. A sample is taken
/// at the beginning of its millisecond, so all samples with a later tick were taken later.
#[must_use]
pub const fn tick_ms(at_us: u64) -> u64 {
    at_us / 1000
}

/// The host's connector of a [`Board`]: shared RAM, reset line and interrupt line.
#[derive(Clone)]
pub struct BoardWindow {
    bus: Rc<RefCell<Bus>>,
    board: Handle<Board>,
}

impl BoardWindow {
    /// The connector of a board on that bus.
    #[must_use]
    pub fn new(bus: Rc<RefCell<Bus>>, board: Handle<Board>) -> BoardWindow {
        BoardWindow { bus, board }
    }

    /// Looks at the board itself, without being its host.
    pub fn look<T>(&self, look: impl FnOnce(&Board) -> T) -> T {
        look(self.bus.borrow().get(self.board))
    }

    /// Drives the reset line.
    pub fn drive_reset(&self, held: bool) {
        let mut bus = self.bus.borrow_mut();
        let board = bus.get_mut(self.board);
        match (held, board.is_in_reset()) {
            (true, false) => board.hold_reset(),
            (false, true) => board.release_reset(),
            _ => {}
        }
    }

    /// When the board has pulled the interrupt line since this was last asked, in microseconds.
    #[must_use]
    pub fn take_interrupts(&self) -> VecDeque<u64> {
        self.bus.borrow_mut().get_mut(self.board).take_interrupts()
    }
}

impl SharedRam for BoardWindow {
    fn read(&self, offset: u16) -> u8 {
        if usize::from(offset) < RAM_LEN {
            self.bus.borrow_mut().get_mut(self.board).host_read(offset)
        } else {
            0xFF
        }
    }

    fn write(&mut self, offset: u16, byte: u8) {
        if usize::from(offset) < RAM_LEN {
            self.bus.borrow_mut().get_mut(self.board).host_write(offset, byte);
        }
    }
}
