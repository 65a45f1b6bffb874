//! The request queue (chapter 13): requests of other devices for this host's memory.

use core::fmt;

use heapless::Vec;

use crate::map::{self, Region};
use crate::ram::SharedRam;

/// Most data bytes of a request.
pub const MAX_REQUEST_DATA_LEN: usize = (map::REQUEST_LEN - map::REQUEST_DATA) as usize;

/// Command of a request that reads memory (the subfunction code of the Read Device datagram).
pub const READ_DEVICE: u8 = 0x1E;

/// Command of a request that writes memory (the subfunction code of the Write Device datagram).
pub const WRITE_DEVICE: u8 = 0x20;

/// Command of a request that changes single bits of memory (the subfunction code of the Write Point
/// datagram). The manual names this datagram without a code. This code is from general knowledge of
/// Genius and unchecked.
pub const WRITE_POINT: u8 = 0x0B;

/// The host's answer to a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum RequestStatus {
    /// The request was carried out.
    Complete,
    /// The host cannot answer now; the board puts the request at the end of the queue.
    Busy,
    /// The request makes no sense to the host.
    Syntax,
    /// The request is damaged.
    Checksum,
}

impl RequestStatus {
    const fn to_byte(self) -> u8 {
        match self {
            RequestStatus::Complete => 1,
            RequestStatus::Busy => 2,
            RequestStatus::Syntax => 4,
            RequestStatus::Checksum => 8,
        }
    }
}

/// What is requested, and by which device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RequestHeader {
    /// [`READ_DEVICE`], [`WRITE_DEVICE`], [`WRITE_POINT`] or another subfunction code.
    pub command: u8,
    /// Number of data bytes, as the requester gave it.
    pub len: u8,
    /// The address in the host's memory, 24 bits.
    pub address: u32,
    /// Bus address of the requester.
    pub source: u8,
    /// Auxiliary source address.
    pub auxiliary_source: u8,
}

/// A request with its data.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MemoryRequest {
    /// What is requested, and by which device.
    pub header: RequestHeader,
    /// The data; meaningless in a request that reads memory.
    pub data: Vec<u8, MAX_REQUEST_DATA_LEN>,
}

/// Answer to a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum RequestAnswer<'a> {
    /// The requested bytes, exactly as many as were asked for.
    Data(&'a [u8]),
    /// The outcome without data.
    Status(RequestStatus),
}

/// Why an answer was not accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum AnswerError {
    /// No request waits. It may have been refused because no answer came in time, or the board has
    /// failed.
    NoRequest,
    /// The request asks for another number of bytes.
    WrongLength {
        /// The number of bytes that the request asks for.
        expected: u8,
    },
}

impl fmt::Display for AnswerError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            AnswerError::NoRequest => f.write_str("no request waits for an answer"),
            AnswerError::WrongLength { expected } => write!(f, "{expected} bytes were asked for"),
        }
    }
}

impl core::error::Error for AnswerError {}

/// One of the 16 buffers.
pub(crate) fn request_buffer(index: u8) -> Region {
    let start = map::REQUEST_QUEUE.at(u16::from(wrapped(index)) * map::REQUEST_LEN);
    Region { start, len: map::REQUEST_LEN }
}

/// An index within the queue, whatever value the RAM holds.
fn wrapped(index: u8) -> u8 {
    index % map::REQUEST_COUNT
}

/// The two pointers of the queue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Pointers {
    /// The buffer that the host reads next, 0–15.
    pub(crate) head: u8,
    /// The buffer that the board fills next, 0–15.
    pub(crate) tail: u8,
}

impl Pointers {
    /// `Err` when the board's pointer is out of range. The host's own pointer is corrected by the
    /// next write.
    pub(crate) fn read<R: SharedRam>(ram: &R) -> Result<Pointers, u8> {
        let tail = ram.read(map::REQUEST_TAIL);
        if tail >= map::REQUEST_COUNT {
            return Err(tail);
        }
        Ok(Pointers { head: wrapped(ram.read(map::REQUEST_HEAD)), tail })
    }

    pub(crate) fn is_empty(self) -> bool {
        self.head == self.tail
    }

    /// The board never lets the tail reach the head: when one buffer is left it drops further
    /// requests.
    pub(crate) fn is_full(self) -> bool {
        wrapped(self.tail + 1) == self.head
    }
}

/// Sets the status of a request and gives its buffer back. The head is written last, in one write,
/// because it interrupts the board.
pub(crate) fn finish<R: SharedRam>(ram: &mut R, index: u8, status: RequestStatus) {
    let index = wrapped(index);
    ram.write(request_buffer(index).at(map::REQUEST_STATUS), status.to_byte());
    ram.write(map::REQUEST_HEAD, wrapped(index + 1));
}

pub(crate) fn read_header<R: SharedRam>(ram: &R, index: u8) -> RequestHeader {
    let buffer = request_buffer(index);
    let byte = |at| ram.read(buffer.at(at));
    RequestHeader {
        command: byte(map::REQUEST_COMMAND),
        len: byte(map::REQUEST_DATA_LEN),
        address: u32::from_le_bytes([
            byte(map::REQUEST_ADDRESS),
            byte(map::REQUEST_ADDRESS + 1),
            byte(map::REQUEST_ADDRESS + 2),
            0,
        ]),
        source: byte(map::REQUEST_SOURCE),
        auxiliary_source: byte(map::REQUEST_AUXILIARY_SOURCE),
    }
}

/// A request with its data; `None` when its length is impossible.
pub(crate) fn read_request<R: SharedRam>(ram: &R, index: u8) -> Option<MemoryRequest> {
    let header = read_header(ram, index);
    let mut data = Vec::new();
    data.resize_default(header.len.into()).ok()?;
    ram.read_bytes(request_buffer(index).at(map::REQUEST_DATA), &mut data);
    Some(MemoryRequest { header, data })
}

/// Puts the requested data into the buffer of the request.
pub(crate) fn write_data<R: SharedRam>(ram: &mut R, index: u8, data: &[u8]) {
    for (byte, &value) in (map::REQUEST_DATA..map::REQUEST_LEN).zip(data) {
        ram.write(request_buffer(index).at(byte), value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ArrayRam;

    #[test]
    fn a_request_is_read_as_chapter_13_has_it() {
        let mut ram = ArrayRam::new();
        ram.write_bytes(15 * 136, &[0x20, 0, 2, 0x56, 0x34, 0x12, 30, 9, 0xAA, 0xBB]);
        let header = RequestHeader {
            command: 0x20,
            len: 2,
            address: 0x12_3456,
            source: 30,
            auxiliary_source: 9,
        };
        let request = read_request(&ram, 15).expect("a request");
        assert_eq!((request.header, &request.data[..]), (header, &[0xAA, 0xBB][..]));
        ram.write(15 * 136 + 2, 129);
        assert_eq!(read_request(&ram, 15), None);
    }

    #[test]
    fn finishing_sets_the_status_and_rolls_the_head_over() {
        let mut ram = ArrayRam::new();
        finish(&mut ram, 15, RequestStatus::Syntax);
        assert_eq!((ram.read(15 * 136 + 1), ram.read(0x0880)), (4, 0));
        finish(&mut ram, 0, RequestStatus::Busy);
        assert_eq!((ram.read(1), ram.read(0x0880)), (2, 1));
        assert_eq!(RequestStatus::Complete.to_byte(), 1);
        assert_eq!(RequestStatus::Checksum.to_byte(), 8);
    }

    #[test]
    fn pointers_out_of_range_lead_nowhere() {
        let mut ram = ArrayRam::new();
        ram.write(0x0881, 16);
        assert_eq!(Pointers::read(&ram), Err(16));
        ram.write_bytes(0x0880, &[0xF3, 3]);
        assert_eq!(Pointers::read(&ram), Ok(Pointers { head: 3, tail: 3 }));
        assert!(Pointers { head: 0, tail: 15 }.is_full());
        assert!(!Pointers { head: 0, tail: 14 }.is_full());
        assert!(Pointers { head: 3, tail: 3 }.is_empty());
    }

    #[test]
    fn an_answer_does_not_leave_its_buffer() {
        let mut ram = ArrayRam::new();
        write_data(&mut ram, 15, &[1; 200]);
        assert_eq!((ram.read(0x087F), ram.read(0x0880)), (1, 0));
    }
}
