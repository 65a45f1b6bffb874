//! The two models of the recorder.

use crate::READ_REPLY_HEADER_LEN;

/// The recorder's model, which decides the number of inputs and the width of an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Model {
    /// HE660SER160: 16 inputs, 12-byte entries.
    Ser160,
    /// HE660SER320: 32 inputs, 16-byte entries.
    Ser320,
}

impl Model {
    /// How many inputs it watches: 16 or 32.
    #[must_use]
    pub const fn inputs(self) -> u8 {
        match self {
            Model::Ser160 => 16,
            Model::Ser320 => 32,
        }
    }

    /// A one for each input that the model has, input 1 in bit 0.
    #[must_use]
    pub const fn mask(self) -> u32 {
        match self {
            Model::Ser160 => 0xFFFF,
            Model::Ser320 => 0xFFFF_FFFF,
        }
    }

    /// Bytes of one entry in a read reply: two maps and eight bytes of time.
    #[must_use]
    pub const fn entry_len(self) -> usize {
        match self {
            Model::Ser160 => 12,
            Model::Ser320 => 16,
        }
    }

    /// Bytes of a read reply with `entries` entries.
    #[must_use]
    pub const fn read_reply_len(self, entries: usize) -> usize {
        READ_REPLY_HEADER_LEN + entries * self.entry_len()
    }
}
