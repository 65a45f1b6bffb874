//! A host on a Genius bus, through the window that it shares with its GENI board.

mod answers;
mod error;
#[cfg(unix)]
mod host;
#[cfg(unix)]
mod inboxes;
#[cfg(unix)]
mod link;
#[cfg(unix)]
mod put_back;
#[cfg(unix)]
mod recognition;
#[cfg(unix)]
mod window;

pub use error::GeniusError;
pub use geni_board::{BlockKind, Device as DeviceRecord, Status as BoardStatus};
#[cfg(unix)]
pub use host::{BusDevice, GeniHost};
#[cfg(unix)]
pub(crate) use link::GeniusLink;
#[cfg(unix)]
pub use recognition::{BusRecorders, Recognition};
