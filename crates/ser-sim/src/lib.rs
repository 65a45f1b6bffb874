//! The world around a recorder: contacts that move, a serial line, and the recorder itself, either
//! in virtual time or as the ARM image in an emulator.
//!
//! - [`Scenario`] says which contact moves at which millisecond; [`Contacts`] says where it comes
//!   from.
//! - [`SimNode`] is a recorder that knows no time but the one it is told. It is for tests that must
//!   give the same result on every machine.
//! - [`Simulator`] is a recorder that keeps pace with real time and answers on a pseudo-terminal or
//!   a TCP port. Host programs are tried against it.
//! - [`qemu`] is the ARM image in an emulator, for a bench that drives it directly.
//! - [`genius`] is the other way to reach a recorder: a GENI board, the Genius bus it sits on, and
//!   the other devices there.

#[cfg(unix)]
mod claim;
mod contacts;
mod error;
pub mod genius;
#[cfg(unix)]
mod genius_bench;
mod genius_options;
mod line;
mod machine;
mod options;
#[cfg(unix)]
pub mod qemu;
mod service;
mod simulator;
#[cfg(feature = "testing")]
pub mod testing;

pub use contacts::player::{Played, STREAM_LEAD_MS};
pub use contacts::scenario::Scenario;
pub use contacts::scenario_error::{MAX_STEPS, ScenarioError, ScenarioFault};
pub use contacts::source::Contacts;
pub use contacts::step::Step;
pub use error::SimError;
pub use genius_options::{GeniusOptions, MAX_NODES};
pub use line::port::Port;
pub use machine::non_volatile::{MemoryStorage, NonVolatile, SimRtc};
pub use machine::sim_node::{LineRate, PoweredOff, Ram, SimNode, SimNodeOptions};
pub use options::{Backend, EmulatorOptions, Notice, SimOptions};
#[cfg(unix)]
pub use qemu::emulated_board::{EmulatedBoard, ForcedFault};
#[cfg(unix)]
pub use ser_board::last_words::ResetCause;
#[cfg(unix)]
pub use ser_board::leds::Lamps;
pub use simulator::{Simulator, run};
