//! Datagrams on their way to and from the bus (chapter 10).

use core::fmt;

use heapless::Vec;

use crate::map;

/// Most data bytes of a datagram: 128, and up to six that say where they belong.
pub const MAX_DATA_LEN: usize = map::READ_BUFFER.len as usize;

/// Highest device number.
pub const MAX_DEVICE_NUMBER: u8 = map::DEVICE_COUNT - 1;

/// Highest function code that the board sends.
pub const MAX_FUNCTION_CODE: u8 = 112;

/// Destination of a broadcast.
const BROADCAST: u8 = 255;

/// Data bytes of a datagram.
pub type Data = Vec<u8, MAX_DATA_LEN>;

/// Who is to get a datagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Destination {
    /// One device, 0–31.
    Device(u8),
    /// All of them. The board receives its own broadcasts too; the driver drops them.
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

/// Which datagrams go first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum TransmitPriority {
    /// In a bus scan in which nobody else has sent one.
    #[default]
    Normal,
    /// In the board's next turn. Lengthens that scan.
    High,
}

/// What is to be known about a datagram that was sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Completion {
    /// That the board has taken it. Whether it arrived stays unknown.
    Taken,
    /// That it was acknowledged.
    Acknowledged,
    /// The reply. The board does nothing else meanwhile, up to 10 s.
    Reply {
        /// Subfunction code of the reply.
        subfunction: u8,
    },
}

/// A datagram to send.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Transmission {
    /// Who is to get it.
    pub destination: Destination,
    /// Function code, up to 112.
    pub function: u8,
    /// Subfunction code.
    pub subfunction: u8,
    /// How urgent it is.
    pub priority: TransmitPriority,
    /// What is to be known.
    pub completion: Completion,
    /// The data.
    pub data: Data,
}

impl Transmission {
    /// What the board would refuse is refused here.
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
    /// The board is starting up, off the bus or failed.
    NotReady,
    /// The last datagram has not been dealt with.
    Busy,
    /// Device numbers are 0–31.
    NoSuchDevice(u8),
    /// Function codes are 0–112.
    FunctionCode(u8),
    /// Everybody would reply.
    ReplyToBroadcast,
}

impl fmt::Display for TransmitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            TransmitError::NotReady => f.write_str("the GENI board is not ready"),
            TransmitError::Busy => f.write_str("the last datagram is still on its way"),
            TransmitError::NoSuchDevice(number) => {
                write!(f, "device number {number} is above {MAX_DEVICE_NUMBER}")
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
    /// Device number of the sender, 0–31.
    pub source: u8,
    /// Function code.
    pub function: u8,
    /// Subfunction code.
    pub subfunction: u8,
    /// Whether it went to everybody.
    pub broadcast: bool,
    /// The tick at which it was seen to arrive, by the count of
    /// [`Driver::poll`](crate::Driver::poll), however much later it was read. Where two arrived
    /// between two polls, see there. `None` for a reply, and for a datagram whose arrival nobody
    /// saw.
    pub arrived_ms: Option<u32>,
    /// The data.
    pub data: Data,
}
