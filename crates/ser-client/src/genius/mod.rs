//! A host on a Genius bus, through the window that it shares with its GENI board.
//!
//! `host` owns the driver of the board and knows who is on the bus; `link` carries the messages of
//! one session in datagrams. A window may be a file that was named by mistake, so `put_back`
//! restores what was written to it unless a board answers there.

#[cfg(unix)]
mod answers;
#[cfg(unix)]
pub(crate) mod host;
#[cfg(unix)]
mod inboxes;
#[cfg(unix)]
pub(crate) mod link;
#[cfg(unix)]
mod put_back;
#[cfg(unix)]
pub(crate) mod recognition;
#[cfg(unix)]
mod window;
