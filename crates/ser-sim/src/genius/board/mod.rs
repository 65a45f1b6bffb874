//! A GENI board, as a host sees it through the shared RAM and other devices see it on the bus.
//!
//! Chapters and tables named here are those of the GENI board's manual. Where the manual is
//! unclear, the module that acts on the passage says in a comment how it reads it.

mod bus_side;
mod commands;
mod host_side;
mod interrupts;
mod io_tables;
mod live;
mod lockout;
mod log_in;
mod options;
mod presence;
mod ram;
mod reason;
mod receive_queue;
mod request_queue;
mod setup;
mod start_up;
mod status;
mod violations;

pub use options::{BoardOptions, Timing};
pub use receive_queue::Read;
pub use start_up::{Led, Leds};
pub use violations::{Violation, ViolationKind};

use self::interrupts::InterruptPin;
use self::live::Live;
use self::presence::Power;
use self::ram::Ram;
use self::violations::Violations;
use super::map::RAM_LEN;

/// A GENI board.
///
/// A host reaches the RAM with [`host_read`](Board::host_read) and
/// [`host_write`](Board::host_write) at any time, or with [`sync_from_host`](Board::sync_from_host)
/// and [`publish`](Board::publish) when host and board share a file. It also has the
/// [`interrupt`](Board::take_interrupt) pin, the reset pin, the [lamps](Board::leds) and the
/// switches. [`violations`](Board::violations) tells what the host did that the manual forbids.
pub struct Board {
    options: BoardOptions,
    now_us: u64,
    /// The switches as they stand. They are read at reset; in a conflict the bus address is read at
    /// once.
    switches: u8,
    monitor_plugged: bool,
    power: Power,
    ram: Ram,
    /// The shared RAM as the host knows it, when the host is another process with a file in
    /// between.
    host_image: Box<[u8; RAM_LEN]>,
    interrupts: InterruptPin,
    violations: Violations,
    faults: BoardFaults,
    /// Datagrams that the host has read.
    reads: u64,
    /// Everything that a reset forgets.
    live: Live,
}

/// What is wrong with a board.
#[derive(Clone, Copy, Debug, Default)]
struct BoardFaults {
    late_by_us: u64,
    next_start: u8,
    out_of_memory: u32,
}

impl Board {
    /// A board without power. It behaves as if held in reset.
    #[must_use]
    pub fn new(options: BoardOptions) -> Board {
        let mut board = Board {
            options,
            now_us: 0,
            switches: options.switches,
            monitor_plugged: false,
            power: Power::InReset,
            ram: Ram::new(),
            host_image: Box::new([0; RAM_LEN]),
            interrupts: InterruptPin::default(),
            violations: Violations::default(),
            faults: BoardFaults::default(),
            reads: 0,
            live: Live::new(options.switches),
        };
        board.hold_reset();
        board
    }

    /// A board whose reset is released at once: at time zero, or when it is connected to a bus.
    #[must_use]
    pub fn powered(options: BoardOptions) -> Board {
        let mut board = Board::new(options);
        board.release_reset();
        board
    }

    /// Turns the switches. That takes effect at the next reset. In a conflict a new bus address
    /// takes effect at once and ends the conflict.
    pub fn set_switches(&mut self, switches: u8) {
        self.switches = switches;
        self.leave_conflict();
    }

    /// Plugs a hand-held monitor into the host's connector, or pulls it out.
    pub fn plug_monitor(&mut self, plugged: bool) {
        self.monitor_plugged = plugged;
        self.show_active();
    }

    /// The bus address in force.
    #[must_use]
    pub fn number(&self) -> u8 {
        self.live.setup.number()
    }
}
