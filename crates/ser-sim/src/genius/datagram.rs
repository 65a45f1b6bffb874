//! Datagrams, and the few of them that boards and blocks handle themselves.

use ser_proto::genius::{FUNCTION_GENIUS, HIGHEST_FUNCTION};

/// The function code of the standard datagrams.
pub const STANDARD: u8 = FUNCTION_GENIUS;
/// A GENI refuses to send function codes above this one.
pub const MAX_FUNCTION: u8 = HIGHEST_FUNCTION;
/// The most data a datagram carries: 128 bytes and, for memory accesses, a header.
pub const MAX_DATAGRAM_LEN: usize = 134;
/// The bus address that means all devices.
pub const BROADCAST: u8 = 255;

/// Subfunction codes of standard datagrams.
pub mod subfunction {
    use ser_proto::genius::Subfunction;

    /// Who are you?
    pub const READ_ID: u8 = Subfunction::ReadId.code();
    /// The answer.
    pub const READ_ID_REPLY: u8 = Subfunction::ReadIdReply.code();
    /// Sets or resets bits in a host's memory.
    pub const WRITE_POINT: u8 = Subfunction::WritePoint.code();
    /// Reads a host's memory.
    pub const READ_DEVICE: u8 = Subfunction::ReadDevice.code();
    /// The answer.
    pub const READ_DEVICE_REPLY: u8 = Subfunction::ReadDeviceReply.code();
    /// Writes a host's memory.
    pub const WRITE_DEVICE: u8 = Subfunction::WriteDevice.code();
    /// Says that a device was reconfigured.
    pub const CONFIGURATION_CHANGE: u8 = Subfunction::ConfigurationChange.code();
    /// Which points of a bus interface unit are forced?
    pub const READ_IO_FORCES: u8 = Subfunction::ReadIoForces.code();
    /// The answer.
    pub const READ_IO_FORCES_REPLY: u8 = Subfunction::ReadIoForcesReply.code();
}

/// A message that is sent once, on request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Datagram {
    /// What kind of message.
    pub function: u8,
    /// Which one of the kind.
    pub subfunction: u8,
    /// Its content.
    pub data: Vec<u8>,
}

impl Datagram {
    /// A standard datagram.
    #[must_use]
    pub fn standard(subfunction: u8, data: impl Into<Vec<u8>>) -> Datagram {
        Datagram { function: STANDARD, subfunction, data: data.into() }
    }

    /// Whether it is the standard datagram with this subfunction.
    #[must_use]
    pub fn is(&self, subfunction: u8) -> bool {
        self.function == STANDARD && self.subfunction == subfunction
    }
}

/// Whether a datagram waits until the scan's one place for a datagram is free.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MessagePriority {
    /// One in each scan, shared by all devices.
    Normal,
    /// On the sender's own turn, whatever else was sent in the scan.
    High,
}
