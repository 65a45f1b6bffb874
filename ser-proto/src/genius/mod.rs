//! The Genius bus as a recorder sees it: datagrams, global data, a PLC's `COMM_REQ` blocks and the
//! DIP switches.
//!
//! A [`Datagram`] carries up to 134 bytes from one device to another, or to all. A message of the
//! recorder is a datagram whose data are the body, without frame: [`Datagram::from_command`],
//! [`Datagram::from_reply`] and back. The datagrams of the bus itself are [`Message`]s. The state
//! of all inputs goes out in every bus scan as [`GlobalData`]. A PLC sends and fetches datagrams
//! with the word blocks in [`CommReq`].

mod address;
mod bus_rate;
mod comm_req;
mod comm_req_block;
mod datagram;
mod dequeue_datagram;
mod dip_switches;
mod global_data;
mod io_forces;
mod memory_access;
mod message;
mod message_error;
mod packing;
mod plc_reference;
mod priority;
mod read_id;
mod send_datagram;
mod ser_datagram;
mod subfunction;
mod write_point;

pub use address::{Address, BusAddress};
pub use bus_rate::BusRate;
pub use comm_req::{CommReq, MAX_WORDS, Words};
pub use comm_req_block::CommReqError;
pub use datagram::{Data, Datagram, MAX_DATA, TooMuchData};
pub use dequeue_datagram::DequeueDatagram;
pub use dip_switches::{BusSettings, DipSwitches, Switch8Closed};
pub use global_data::{GlobalData, GlobalDataLength};
pub use io_forces::{ForceTable, IoForces, MAX_FORCE_TABLE};
pub use memory_access::{MAX_MEMORY_DATA, MemoryAddress, MemoryContents, MemoryRange};
pub use message::Message;
pub use message_error::MessageError;
pub use packing::{bytes_of_words, words_of_bytes};
pub use plc_reference::{MemoryType, PlcReference};
pub use priority::Priority;
pub use read_id::{DeviceStatus, Directions, ReadIdReply};
pub use send_datagram::SendDatagram;
pub use ser_datagram::{
    FUNCTION_HORNER, MAX_SER_DATA, SUBFUNCTION_SER, SerDatagramError, max_entries,
};
pub use subfunction::{FUNCTION_GENIUS, HIGHEST_FUNCTION, Subfunction};
pub use write_point::{PointMask, WritePoint};
