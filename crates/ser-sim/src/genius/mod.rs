//! Genius: a model of the GENI board, of the bus it sits on, and of other devices there, in virtual
//! time.
//!
//! A [`Bus`] knows no time but the one it is told with [`Bus::advance_to`], and says with
//! [`Bus::next_due_us`] when something happens next. The things connected to it implement
//! [`Device`]: [`Board`]s, [`DiscreteBlock`]s and [`BusInterfaceUnit`]s. A host works with its
//! board through the shared RAM alone:
//!
//! ```
//! use ser_sim::genius::{Board, BoardOptions, Bus, BusTiming};
//!
//! let mut bus = Bus::new(BusTiming::default());
//! let board = bus.connect(Board::powered(BoardOptions::at(31)));
//! // The manual: no access for 1.7 seconds, then wait for the OK flag.
//! bus.advance_to(2_000_000);
//! assert_eq!(bus.get_mut(board).host_read(0x0893), 1);
//! ```
//!
//! "The manual" means the GENI board's manual, GFK-0073, throughout. Nothing in here shares code
//! with the driver for the board, so a misreading on one side shows on the other. [`BoardWindow`]
//! lets the driver reach the board's shared RAM.

mod block;
mod board;
mod bus;
mod bus_interface_unit;
mod datagram;
mod device;
mod device_id;
mod faults;
mod identity;
mod map;
mod outbox;
mod scan_time;
mod station;
#[cfg(test)]
mod tests;
mod window;

pub use block::{Circuits, DiscreteBlock};
pub use board::{Board, BoardOptions, Led, Leds, Read, Timing, Violation, ViolationKind};
pub use bus::{ADDRESSES, Bus, Handle, Traffic};
pub use bus_interface_unit::{BusInterfaceUnit, Side, StationData};
pub use datagram::{
    BROADCAST, Datagram, MAX_DATAGRAM_LEN, MAX_FUNCTION, MessagePriority, STANDARD, subfunction,
};
pub use device::{Device, Message};
pub use device_id::DeviceId;
pub use faults::{DeviceFault, Fault, Noise};
pub use identity::{BlockKind, Identity};
pub use map::RAM_LEN;
pub use scan_time::{BusTiming, MIN_SCAN_NS};
pub use window::{BoardWindow, tick_ms};
