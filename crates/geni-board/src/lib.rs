//! A host's view of a GENI board, the daughterboard that connects a computer to a Genius bus.
//!
//! Host and board share 16 KiB of RAM, a reset line and an interrupt line, and nothing else. The
//! RAM holds everything that comes from the bus. The host writes its settings, commands, datagrams
//! and cyclic data there.
//!
//! - [`SharedRam`] is the access to the RAM. [`WindowRam`] is a window in the memory of a
//!   processor, [`ArrayRam`] an array for tests. With feature `std`, on Unix, `FileRam` is a file
//!   and `MappedRam` memory behind one.
//! - [`map`] says where each table is; each table's module says what is in it.
//! - [`Driver`] talks to the board. The host calls [`Driver::poll`] with its millisecond count as
//!   often as it can. After each call it sets the reset line to [`Driver::reset_held`] and handles
//!   the [`Event`] that was returned.
//!
//! ```
//! use geni_board::{ArrayRam, Configuration, Driver, Event, Options};
//!
//! // Two bytes of global data in every bus scan, no directed control data.
//! let configuration = Configuration::new(0xFFFF, 2, 0, 128)?;
//! let mut driver = Driver::new(ArrayRam::new(), Options::new(configuration));
//! driver.set_global_data(&[0x01, 0x80])?;
//! for now_ms in 0..10 {
//!     match driver.poll(now_ms) {
//!         Some(Event::Received(datagram)) => println!("{datagram:?}"),
//!         Some(event) => println!("{event:?}"),
//!         None => {}
//!     }
//!     let _reset_pin_is_low = driver.reset_held();
//! }
//! # Ok::<(), Box<dyn core::error::Error>>(())
//! ```
//!
//! The driver never waits, allocates or panics. One call of `poll` does a bounded amount of work
//! and returns at most one event. The board may write anything into the RAM, so every number is
//! checked before it is used, and [`Counters`] counts what was wrong. A board that has failed is
//! reset as often as necessary.
//!
//! Chapters and tables in the documentation are those of the GENI board user's manual GFK-0073
//! ("the manual").
#![cfg_attr(not(any(test, feature = "std")), no_std)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

mod command_block;
mod counters;
mod datagram;
mod device_table;
mod driver;
mod elapsed;
mod event;
#[cfg(feature = "std")]
mod file_ram;
mod interrupts;
mod io_tables;
mod lockout;
pub mod map;
#[cfg(feature = "std")]
mod mapped_ram;
mod options;
mod ram;
mod request_queue;
mod setup_table;
mod status_table;
pub mod timing;
mod window_ram;

pub use command_block::{CommandCode, CommandStatus};
pub use counters::Counters;
pub use datagram::{
    Completion, Data, Destination, MAX_DATA_LEN, MAX_DEVICE_NUMBER, MAX_FUNCTION_CODE,
    ReceivedDatagram, Transmission, TransmitError, TransmitPriority,
};
pub use device_table::{BlockKind, Device};
pub use driver::Driver;
pub use event::{CommandError, ConfigurationOutcome, DeviceChange, Event, Failure, Identity};
#[cfg(feature = "std")]
pub use file_ram::FileRam;
pub use interrupts::Interrupts;
pub use io_tables::{TableError, Tables};
#[cfg(feature = "std")]
pub use mapped_ram::MappedRam;
pub use options::{Options, Requests, Start};
pub use ram::{ArrayRam, RAM_LEN, SharedRam};
pub use request_queue::{
    AnswerError, MAX_REQUEST_DATA_LEN, MemoryRequest, READ_DEVICE, RequestAnswer, RequestHeader,
    RequestStatus, WRITE_DEVICE, WRITE_POINT,
};
pub use setup_table::{BoardSwitches, Configuration, InvalidConfiguration, RateSetting};
pub use status_table::Status;
pub use window_ram::WindowRam;
