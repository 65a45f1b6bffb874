//! A board that is both on the bus and in its recorder.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use geni_board::SharedRam;

use crate::genius::{Board, BusTiming, Device, DeviceFault, Message};

/// A handle of a board; clones are the same board.
#[derive(Clone)]
pub(super) struct SharedBoard(Arc<Mutex<Board>>);

impl SharedBoard {
    pub(super) fn new(board: Board) -> SharedBoard {
        SharedBoard(Arc::new(Mutex::new(board)))
    }

    pub(super) fn lock(&self) -> MutexGuard<'_, Board> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Device for SharedBoard {
    fn address(&self) -> Option<u8> {
        self.lock().address()
    }

    fn rate(&self) -> BusTiming {
        self.lock().rate()
    }

    fn connect(&mut self, now_us: u64) {
        self.lock().connect(now_us);
    }

    fn next_due_us(&self) -> Option<u64> {
        self.lock().next_due_us()
    }

    fn advance_to(&mut self, now_us: u64) {
        self.lock().advance_to(now_us);
    }

    fn take_turn(&mut self, now_us: u64, background_free: bool) -> Vec<Message> {
        self.lock().take_turn(now_us, background_free)
    }

    fn end_turn(&mut self, now_us: u64, messages: &[Message], arrived: &[bool]) {
        self.lock().end_turn(now_us, messages, arrived);
    }

    fn collide(&mut self, now_us: u64) {
        self.lock().collide(now_us);
    }

    fn receive(&mut self, now_us: u64, from: u8, message: &Message) -> bool {
        self.lock().receive(now_us, from, message)
    }

    fn count_bus_error(&mut self, now_us: u64) {
        self.lock().count_bus_error(now_us);
    }

    fn suffer(&mut self, now_us: u64, fault: DeviceFault) {
        self.lock().suffer(now_us, fault);
    }
}

/// The board's shared RAM, as its recorder sees it.
pub(super) struct BoardRam(pub(super) SharedBoard);

impl SharedRam for BoardRam {
    fn read(&self, offset: u16) -> u8 {
        self.0.lock().host_read(offset)
    }

    fn write(&mut self, offset: u16, byte: u8) {
        self.0.lock().host_write(offset, byte);
    }
}
