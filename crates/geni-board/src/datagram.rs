//! Datagrams to and from the bus (chapter 10).

use core::fmt;

use heapless::Vec;

use crate::map;

/// Most data bytes of a datagram: 128, plus up to six that tell where they belong.
pub const MAX_DATA_LEN: usize = map::READ_BUFFER.len as usize;

/// Highest bus address.
pub const MAX_DEVICE_NUMBER: u8 = map::DEVICE_COUNT - 1;

/// Highest function code that the board sends.
pub const MAX_FUNCTION_CODE: u8 = 112;

/// Destination of a broadcast.
const BROADCAST: u8 = 255;

/// Data bytes of a datagram.
pub type Data = Vec<u8, MAX_DATA_LEN>;

/// Where a datagram goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Destination {
    /// One device, by its bus address, 0–31.
    Device(u8),
    /// All devices. The board also receives its own broadcasts; the driver drops them.
    Broadcast,
}

impl Destination {
    pub(crate) const fn to_byte(self) -> u8 {
        match self {
            Destination::Device(number) => number,
            Destination::Broadcast => BROADCAST,
        }
    }
}

/// How urgent a datagram is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum TransmitPriority {
    /// Sent in a bus scan in which no other device has sent one.
    #[default]
    Normal,
    /// Sent on the board's next turn, which lengthens that scan.
    High,
}

/// What the driver is to find out about a datagram that it sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Completion {
    /// Whether the board has taken it. Whether it arrived stays unknown.
    Taken,
    /// Whether it was acknowledged.
    Acknowledged,
    /// The reply. The board carries out no other command until the reply comes, up to 10 s.
    Reply {
        /// Subfunction code of the reply.
        subfunction: u8,
    },
}

/// A datagram to send.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Transmission {
    /// Where it goes.
    pub destination: Destination,
    /// Function code, up to 112.
    pub function: u8,
    /// Subfunction code.
    pub subfunction: u8,
    /// How urgent it is.
    pub priority: TransmitPriority,
    /// What the driver is to find out about it.
    pub completion: Completion,
    /// The data.
    pub data: Data,
}

impl Transmission {
    /// Refuses what the board would refuse.
    pub(crate) fn check(&self) -> Result<(), TransmitError> {
        match (self.destination, self.completion) {
            (Destination::Device(number), _) if number > MAX_DEVICE_NUMBER => {
                return Err(TransmitError::NoSuchDevice(number));
            }
            (Destination::Broadcast, Completion::Reply { .. }) => {
                return Err(TransmitError::ReplyToBroadcast);
            }
            _ => {}
        }
        if self.function > MAX_FUNCTION_CODE {
            return Err(TransmitError::FunctionCode(self.function));
        }
        Ok(())
    }
}

/// Why a datagram was not accepted for sending.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum TransmitError {
    /// The board is starting up, is off the bus or has failed.
    NotReady,
    /// The last datagram is still in progress.
    Busy,
    /// Bus addresses are 0–31.
    NoSuchDevice(u8),
    /// Function codes are 0–112.
    FunctionCode(u8),
    /// Every device would reply.
    ReplyToBroadcast,
}

impl fmt::Display for TransmitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            TransmitError::NotReady => f.write_str("the GENI board is not ready"),
            TransmitError::Busy => f.write_str("the last datagram is still on its way"),
            TransmitError::NoSuchDevice(number) => {
                write!(f, "bus address {number} is above {MAX_DEVICE_NUMBER}")
            }
            TransmitError::FunctionCode(code) => {
                write!(f, "function code {code} is above {MAX_FUNCTION_CODE}")
            }
            TransmitError::ReplyToBroadcast => f.write_str("a broadcast has no reply"),
        }
    }
}

impl core::error::Error for TransmitError {}

/// A datagram that has arrived.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ReceivedDatagram {
    /// Bus address of the sender, 0–31.
    pub source: u8,
    /// Function code.
    pub function: u8,
    /// Subfunction code.
    pub subfunction: u8,
    /// Whether it was a broadcast.
    pub broadcast: bool,
    /// The tick at which it was seen to arrive, by the count of
    /// [`Driver::poll`](crate::Driver::poll); when it was read does not matter. `poll` also
    /// explains the case of two arrivals between two polls. `None` for a reply, and for a datagram
    /// whose arrival was not seen.
    pub arrived_ms: Option<u32>,
    /// The data.
    pub data: Data,
}
