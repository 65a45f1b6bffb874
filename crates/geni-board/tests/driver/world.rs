//! A driver, a board and a clock.

use std::cell::{RefCell, RefMut};
use std::rc::Rc;

use geni_board::{Configuration, Driver, Event, Options, Start};

use crate::board::{Board, HostSide};

pub(crate) struct World {
    pub(crate) driver: Driver<HostSide>,
    pub(crate) board: Rc<RefCell<Board>>,
    pub(crate) now_ms: u32,
    /// Milliseconds between two calls of `poll`.
    pub(crate) pace_ms: u32,
}

pub(crate) fn configuration(broadcast_len: u8, directed_len: u8, buffer_len: u8) -> Configuration {
    Configuration::new(0xFFFF, broadcast_len, directed_len, buffer_len).expect("lengths in range")
}

impl World {
    pub(crate) fn new(board: Board, options: Options) -> World {
        let board = Rc::new(RefCell::new(board));
        World {
            driver: Driver::new(HostSide(board.clone()), options),
            board,
            now_ms: 0,
            pace_ms: 1,
        }
    }

    /// A running board with this configuration, with the driver attached.
    pub(crate) fn ready(configuration: Configuration) -> World {
        World::ready_with(Options { start: Start::Running, ..Options::new(configuration) })
    }

    pub(crate) fn ready_with(options: Options) -> World {
        let mut world = World::new(Board::running(0), options);
        world.until(4_000, |event| matches!(event, Event::Ready(_)));
        world.run(20);
        world
    }

    pub(crate) fn board(&self) -> RefMut<'_, Board> {
        self.board.borrow_mut()
    }

    /// A byte of the RAM, unchecked.
    pub(crate) fn peek(&self, offset: usize) -> u8 {
        self.board().ram[offset]
    }

    /// Lets `pace_ms` milliseconds pass on the board, then polls the driver once.
    pub(crate) fn step(&mut self) -> Option<Event> {
        for _ in 0..self.pace_ms {
            self.now_ms = self.now_ms.wrapping_add(1);
            self.board.borrow_mut().step(self.now_ms, self.driver.reset_held());
        }
        self.driver.poll(self.now_ms)
    }

    /// All events of the next `ms` milliseconds.
    pub(crate) fn run(&mut self, ms: u32) -> Vec<Event> {
        (0..ms.div_ceil(self.pace_ms)).filter_map(|_| self.step()).collect()
    }

    /// Runs until an event fits; returns the time and all events before it.
    pub(crate) fn until(
        &mut self,
        within_ms: u32,
        fits: impl Fn(&Event) -> bool,
    ) -> (u32, Vec<Event>) {
        let mut events = Vec::new();
        let began_ms = self.now_ms;
        while self.now_ms.wrapping_sub(began_ms) < within_ms {
            if let Some(event) = self.step() {
                events.push(event);
                if events.last().is_some_and(&fits) {
                    return (self.now_ms.wrapping_sub(began_ms), events);
                }
            }
        }
        panic!("not within {within_ms} ms; there were {events:?}");
    }
}
