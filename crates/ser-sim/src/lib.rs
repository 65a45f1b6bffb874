//! The world around a recorder: contacts that move, a serial line, and the node itself in virtual time or as the
//! ARM image in an emulator.
//!
//! - [`Scenario`] says which contact moves at which millisecond; [`Contacts`] says where it comes from.
//! - [`SimNode`] is a node that knows no time but the one it is told: for tests that must give the same
//!   result on every machine.
//! - [`Simulator`] is a node that keeps pace with real time and answers on a pseudo-terminal or a TCP port:
//!   what a host program can be tried against.
//! - [`Lockstep`] is the ARM image in virtual time, held still whenever the world moves: for what has to be exact.
//! - [`genius`] is the other way to a node: a GENI board, the Genius bus it sits on, and other devices there.

mod breaker_trip;
#[cfg(unix)]
mod claim;
mod contacts;
#[cfg(unix)]
mod emulated_board;
#[cfg(unix)]
mod emulator;
#[cfg(unix)]
mod emulator_files;
mod error;
#[cfg(unix)]
mod external_bus;
pub mod genius;
#[cfg(unix)]
mod genius_bench;
mod genius_options;
mod line;
#[cfg(target_os = "linux")]
mod lockstep;
mod machine;
mod native;
mod non_volatile;
mod pace;
mod player;
#[cfg(unix)]
mod pty;
#[cfg(unix)]
mod record_folder;
mod scenario;
mod scenario_lines;
mod service;
mod sim_node;
mod simulator;
mod tcp;
#[cfg(feature = "testing")]
pub mod testing;
mod wire;

pub use contacts::Contacts;
#[cfg(unix)]
pub use emulated_board::{EmulatedBoard, ForcedFault};
pub use error::{FolderFault, NoRecords, SimError};
pub use genius_options::{GeniusOptions, MAX_NODES};
pub use line::Port;
#[cfg(target_os = "linux")]
pub use lockstep::{INSTRUCTIONS_PER_MS, Lockstep, LockstepOptions};
pub use non_volatile::{MemoryStorage, NonVolatile, SimRtc};
pub use player::{Played, STREAM_LEAD_MS};
pub use scenario::{MAX_STEPS, Scenario, ScenarioError, ScenarioFault, Step};
#[cfg(unix)]
pub use ser_board::last_words::ResetCause;
#[cfg(unix)]
pub use ser_board::leds::Lamps;
pub use sim_node::{LineRate, PoweredOff, Ram, SimNode, SimNodeOptions};
pub use simulator::{Backend, EmulatorOptions, Notice, SimOptions, Simulator, run};
