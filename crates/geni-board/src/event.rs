//! What the driver reports.

use core::fmt;

use crate::datagram::ReceivedDatagram;
use crate::device_table::Device;
use crate::request_queue::{MemoryRequest, RequestHeader};
use crate::setup_table::{BoardSwitches, Configuration};
use crate::status_table::Status;

/// Something that happened between two calls of [`Driver::poll`](crate::Driver::poll).
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Event {
    /// The board has answered the configuration.
    Configured(ConfigurationOutcome),
    /// The board is free to join the bus: datagrams are accepted and tables can be locked.
    /// [`Event::StatusChanged`] follows and tells whether it has joined.
    Ready(Identity),
    /// The board has failed. It will be reset, if it has a reset line, and started again. All
    /// devices are gone.
    Failed(Failure),
    /// The board joined or left the bus, or a monitor or excessive errors came or went. Also
    /// reported once after [`Event::Ready`].
    StatusChanged(Status),
    /// A device came, went or changed.
    Device {
        /// Its bus address, 0–31.
        number: u8,
        /// What it did.
        change: DeviceChange,
    },
    /// A datagram has arrived.
    Received(ReceivedDatagram),
    /// The datagram has been sent, or could not be.
    Sent(Result<(), CommandError>),
    /// The reply to the datagram that was sent, or the reason why there is none.
    Replied(Result<ReceivedDatagram, CommandError>),
    /// Another device asks for this host's memory: see
    /// [`Driver::answer_request`](crate::Driver::answer_request).
    Request(MemoryRequest),
    /// A request for this host's memory was refused.
    RequestRefused(RequestHeader),
    /// The tables are locked until the next call of `poll`: see
    /// [`Driver::tables`](crate::Driver::tables).
    TablesLocked,
    /// The board has had its turn on the bus. Only with
    /// [`Interrupts::OUTPUTS_SENT`](crate::Interrupts::OUTPUTS_SENT) enabled.
    OutputsSent,
}

/// The board's answer to a configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ConfigurationOutcome {
    /// It is now in force, and the board is off the bus for 1.5 s.
    Changed,
    /// It was in force already.
    Unchanged,
    /// It is not in force; the enclosed one is.
    Refused(Configuration),
}

/// The board's revision and settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Identity {
    /// Software revision.
    pub revision: u8,
    /// Its switches.
    pub switches: BoardSwitches,
    /// Its configuration.
    pub configuration: Configuration,
}

/// How a board was found to have failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Failure {
    /// Its self-test did not end in time, or ended with these faults.
    SelfTest {
        /// Hardware status byte.
        faults: u8,
    },
    /// It stopped setting its OK flag.
    NoHeartbeat,
    /// It reports hardware faults.
    Hardware {
        /// Hardware status byte.
        faults: u8,
    },
    /// Its setup table has changed: it has restarted by itself.
    Restarted,
    /// It does not finish a command.
    CommandStuck,
    /// It does not answer lockout requests.
    LockoutStuck,
    /// It does not answer its configuration.
    Configuration,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Failure::SelfTest { faults } => {
                write!(f, "the GENI board did not pass its self-test (faults {faults:02X}h)")
            }
            Failure::NoHeartbeat => f.write_str("the GENI board has lost its heartbeat"),
            Failure::Hardware { faults } => {
                write!(f, "the GENI board reports hardware faults {faults:02X}h")
            }
            Failure::Restarted => f.write_str("the GENI board has restarted by itself"),
            Failure::CommandStuck => f.write_str("the GENI board does not finish its commands"),
            Failure::LockoutStuck => f.write_str("the GENI board does not answer lockout requests"),
            Failure::Configuration => f.write_str("the GENI board does not take its configuration"),
        }
    }
}

impl core::error::Error for Failure {}

/// What a device did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum DeviceChange {
    /// It logged in.
    LoggedIn(Device),
    /// It is logged in with other data.
    Changed(Device),
    /// It logged out.
    LoggedOut,
}

/// Why a datagram was not sent, or got no reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CommandError {
    /// The board refused it as wrong.
    Refused,
    /// No acknowledgement came, no reply came within 10 s, or the board had no memory. Another
    /// attempt may help.
    Failed,
    /// The board cleared the command without carrying it out.
    Cleared,
    /// The command ended with an undefined status.
    UnknownStatus(u8),
    /// The reply has an impossible length.
    BadReply,
    /// The board did not finish in time. The datagram may have been sent, or may yet be.
    TimedOut,
    /// The board failed before it had finished. The datagram may have been sent.
    BoardFailed,
}

impl fmt::Display for CommandError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            CommandError::Refused => f.write_str("the GENI board refused the datagram"),
            CommandError::Failed => {
                f.write_str("the datagram did not get through, or was not answered")
            }
            CommandError::Cleared => f.write_str("the GENI board dropped the command"),
            CommandError::UnknownStatus(status) => {
                write!(f, "the GENI board gave the unknown status {status:02X}h")
            }
            CommandError::BadReply => f.write_str("the reply has an impossible length"),
            CommandError::TimedOut => f.write_str("the GENI board did not finish in time"),
            CommandError::BoardFailed => f.write_str("the GENI board failed meanwhile"),
        }
    }
}

impl core::error::Error for CommandError {}
