//! Memory that a node works in and a board provides.
//!
//! A node is made on the stack and moved to where it stays. What is large is kept out of it, so that
//! the stack need not hold it.

use crate::chatter;
use crate::clock::Offset;
use crate::history::SPAN;
use crate::kept::RECORD_LEN;
use crate::sequencer::{Place, WINDOW};

/// Working memory of one node, for a static.
#[derive(Debug)]
pub struct Work {
    /// Changes that wait to be put in order.
    pub(crate) waiting: [Place; WINDOW],
    /// How the clock was set in the latest milliseconds.
    pub(crate) offsets: [Offset; SPAN],
    /// What the chatter filter knows of each input.
    pub(crate) chatter: [chatter::Input; 32],
    /// A stored record on its way.
    pub(crate) record: [u8; RECORD_LEN],
}

impl Work {
    /// As at power-up.
    #[must_use]
    pub const fn new() -> Work {
        Work {
            waiting: [Place::EMPTY; WINDOW],
            offsets: [Offset::NONE; SPAN],
            chatter: [chatter::Input::NEW; 32],
            record: [0; RECORD_LEN],
        }
    }
}

impl Default for Work {
    fn default() -> Self {
        Self::new()
    }
}
