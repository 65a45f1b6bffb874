//! The recorder itself. It owns no pin, no register and no clock.
//!
//! One contact change goes through these files, in this order:
//!
//! 1. [`capture`]: the 1 kHz interrupt reads all inputs, filters them ([`debounce`]) and queues
//!    what changed;
//! 2. [`sequencer`]: the main loop puts changes in the order in which they began;
//! 3. [`clock`]: ticks since power-up become date and time;
//! 4. [`event_log`]: the ring of up to 2048 events;
//! 5. `recorder`: owns all of that, serves the commands and decides what to send;
//! 6. `serial_port`: the bytes of the RS-232 line; [`genius_port`]: the datagrams of the Genius
//!    bus, for boards that have one.
//!
//! A port does not know the recorder. It turns what came in into an `arrival`, and what is to go
//! out into bytes. [`Node`] carries data from one to the other.
//!
//! Time and bytes are passed in; bytes come out. A board or the simulator calls [`Capture::sample`]
//! every millisecond and [`Node::poll`] as often as it can. Nothing here blocks, allocates or
//! panics, whatever arrives from outside.
#![cfg_attr(not(test), no_std)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

mod arrival;
pub mod calendar;
pub mod capture;
mod changes;
mod chatter;
pub mod clock;
mod counters;
pub mod debounce;
pub mod diagnostics;
pub mod event_log;
pub mod genius_port;
mod history;
mod keeper;
mod kept;
pub mod liveness;
pub mod node;
mod owed;
mod print_line;
mod printer;
mod recorder;
pub mod ring;
pub mod sequencer;
mod serial_port;
pub mod settings;
mod tick_counter;
mod tick_stamp;
pub mod ticks;
mod version;
mod waiting;
mod work;

pub use capture::{Capture, CaptureChannel, CaptureReader, DebounceTimes};
pub use clock::{NoRtc, Rtc};
pub use debounce::Debounce;
pub use diagnostics::Diagnostics;
pub use event_log::{Event, EventLog};
pub use genius_port::{GeniusDiagnostics, GeniusOptions, GeniusPort};
pub use kept::RECORD_LEN;
pub use liveness::Liveness;
pub use node::Node;
pub use recorder::NodeParts;
pub use sequencer::HELD_BACK_MS;
pub use settings::{CopyNumber, Storage};
pub use tick_counter::TickCounter;
pub use tick_stamp::TickStamp;
pub use version::VERSION;
pub use work::Work;
