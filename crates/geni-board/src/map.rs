//! The layout of the shared RAM (chapter 3, memory map).
//!
//! The [`Region`]s are the tables of the memory map, in its order. Below them are the bytes inside
//! each table, named after the tables of the chapters. Words have their low byte first. The
//! manual's *bit 1* is the least significant one.

/// A run of bytes in the shared RAM.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    /// Offset of the first byte.
    pub start: u16,
    /// Number of bytes.
    pub len: u16,
}

impl Region {
    const fn new(start: u16, len: u16) -> Region {
        Region { start, len }
    }

    /// Offset of the byte at `index`, counted from 0; the last byte when `index` is too large.
    #[must_use]
    pub const fn at(self, index: u16) -> u16 {
        self.start + if index < self.len { index } else { self.len - 1 }
    }

    /// Offset of the first byte after the region.
    #[must_use]
    pub const fn end(self) -> u16 {
        self.start + self.len
    }

    /// Whether an offset is in the region.
    #[must_use]
    pub const fn contains(self, offset: u16) -> bool {
        offset >= self.start && offset < self.end()
    }
}

/// Memory access datagrams from other devices: 16 buffers of 136 bytes (chapter 13).
pub const REQUEST_QUEUE: Region = Region::new(0x0000, 2176);
/// The buffer that the host reads next. Writing it interrupts the board (chapter 13).
pub const REQUEST_HEAD: u16 = 0x0880;
/// The buffer that the board fills next. The host never writes it (chapter 13).
pub const REQUEST_TAIL: u16 = 0x0881;
/// Settings of the board (chapter 4).
pub const SETUP_TABLE: Region = Region::new(0x0882, 16);
/// Health of board and bus (chapter 5).
pub const STATUS_TABLE: Region = Region::new(0x0892, 16);
/// Conditions that have occurred (chapter 6).
pub const INTERRUPT_STATUS: Region = Region::new(0x08A2, 16);
/// Conditions that must not interrupt the host (chapter 6).
pub const INTERRUPT_DISABLE: Region = Region::new(0x08B2, 16);
/// Commands to the board. Writing its first byte interrupts the board (chapter 10).
pub const COMMAND_BLOCK: Region = Region::new(0x08C2, 16);
/// Data of a datagram to send (chapter 10).
pub const TRANSMIT_BUFFER: Region = Region::new(0x08D2, 240);
/// Data of a datagram received, or of a reply (chapter 10).
pub const READ_BUFFER: Region = Region::new(0x09C2, 134);
/// Written by the host only. Writing it interrupts the board (chapter 9).
pub const LOCKOUT_REQUEST: u16 = 0x0A48;
/// Written by the board only (chapter 9).
pub const LOCKOUT_STATE: u16 = 0x0A49;
/// The host neither reads nor writes this region. The memory map gives it 5045 bytes and leaves out
/// the first one, which the example structure of chapter 3 names without a meaning.
pub const RESERVED: Region = Region::new(0x0A4A, 5046);
/// The devices on the bus: 32 entries of 8 bytes (chapter 7).
pub const DEVICE_TABLE: Region = Region::new(0x1E00, 256);
/// Directed control data for this host (chapter 12).
pub const DIRECTED_INPUT: Region = Region::new(0x1F00, 128);
/// Global data of this host (chapter 11).
pub const BROADCAST_OUTPUT: Region = Region::new(0x1F80, 128);
/// 32 input buffers, then 32 output buffers, all of the same configured length (chapter 8).
pub const IO_TABLE: Region = Region::new(0x2000, 8192);

/// Number of request queue buffers (chapter 13).
pub const REQUEST_COUNT: u8 = 16;
/// Bytes of a request queue buffer: header and data.
pub const REQUEST_LEN: u16 = 136;
/// In a request queue buffer: what is asked for.
pub const REQUEST_COMMAND: u16 = 0;
/// In a request queue buffer: the host's answer.
pub const REQUEST_STATUS: u16 = 1;
/// In a request queue buffer: number of data bytes.
pub const REQUEST_DATA_LEN: u16 = 2;
/// In a request queue buffer: address in the host's memory, three bytes, low byte first.
pub const REQUEST_ADDRESS: u16 = 3;
/// In a request queue buffer: bus address of the requester.
pub const REQUEST_SOURCE: u16 = 6;
/// In a request queue buffer: auxiliary source address.
pub const REQUEST_AUXILIARY_SOURCE: u16 = 7;
/// In a request queue buffer: the data.
pub const REQUEST_DATA: u16 = 8;

/// DIP switches; the host must not write them (chapter 4).
pub const SETUP_DIP_SWITCHES: u16 = SETUP_TABLE.at(0);
/// Reference address, a word.
pub const SETUP_REFERENCE: u16 = SETUP_TABLE.at(1);
/// Broadcast control data (global data) length.
pub const SETUP_BROADCAST_LEN: u16 = SETUP_TABLE.at(3);
/// Directed control data length.
pub const SETUP_DIRECTED_LEN: u16 = SETUP_TABLE.at(4);
/// Length of the buffers in the input and output tables.
pub const SETUP_BUFFER_LEN: u16 = SETUP_TABLE.at(5);

/// Software revision (chapter 5).
pub const STATUS_REVISION: u16 = STATUS_TABLE.at(0);
/// OK flag, the only byte of this table that the host writes.
pub const STATUS_OK: u16 = STATUS_TABLE.at(1);
/// Hardware faults.
pub const STATUS_FAULTS: u16 = STATUS_TABLE.at(2);
/// Hand-held monitor present, excessive bus errors.
pub const STATUS_ACTIVE: u16 = STATUS_TABLE.at(3);
/// Serial bus error count, a word.
pub const STATUS_BUS_ERRORS: u16 = STATUS_TABLE.at(4);
/// I/O scan time in milliseconds, a word.
pub const STATUS_SCAN_TIME: u16 = STATUS_TABLE.at(6);

/// In both interrupt tables: the summary (chapter 6).
pub const INTERRUPT_SUMMARY: u16 = 0;
/// In both interrupt tables: the first of the seven conditions, in the order of
/// [`Interrupts`](crate::Interrupts).
pub const INTERRUPT_FIRST: u16 = 1;
/// Number of conditions.
pub const INTERRUPT_COUNT: u16 = 7;

/// Status of the command (chapter 10, Command Block).
pub const COMMAND_STATUS: u16 = COMMAND_BLOCK.at(0);
/// The command.
pub const COMMAND_CODE: u16 = COMMAND_BLOCK.at(1);
/// First byte of the command's options.
pub const COMMAND_OPTIONS: u16 = COMMAND_BLOCK.at(2);
/// Read Datagram: device that sent the datagram.
pub const READ_SOURCE: u16 = COMMAND_BLOCK.at(2);
/// Read Datagram: function code.
pub const READ_FUNCTION: u16 = COMMAND_BLOCK.at(3);
/// Read Datagram: subfunction code.
pub const READ_SUBFUNCTION: u16 = COMMAND_BLOCK.at(4);
/// Read Datagram: directed or broadcast.
pub const READ_DIRECTED: u16 = COMMAND_BLOCK.at(5);
/// Read Datagram: length.
pub const READ_LEN: u16 = COMMAND_BLOCK.at(6);
/// Transmit Datagram, with or without reply: destination.
pub const TRANSMIT_DESTINATION: u16 = COMMAND_BLOCK.at(2);
/// Transmit Datagram, with or without reply: function code.
pub const TRANSMIT_FUNCTION: u16 = COMMAND_BLOCK.at(3);
/// Transmit Datagram, with or without reply: subfunction code.
pub const TRANSMIT_SUBFUNCTION: u16 = COMMAND_BLOCK.at(4);
/// Transmit Datagram: priority.
pub const TRANSMIT_PRIORITY: u16 = COMMAND_BLOCK.at(5);
/// Transmit Datagram: length.
pub const TRANSMIT_LEN: u16 = COMMAND_BLOCK.at(6);
/// Transmit Datagram with Reply: subfunction code of the reply.
pub const REPLY_SUBFUNCTION: u16 = COMMAND_BLOCK.at(5);
/// Transmit Datagram with Reply: priority.
pub const REPLY_PRIORITY: u16 = COMMAND_BLOCK.at(6);
/// Transmit Datagram with Reply: length of what is sent.
pub const REPLY_TRANSMIT_LEN: u16 = COMMAND_BLOCK.at(7);
/// Transmit Datagram with Reply: length of the reply, set by the board.
pub const REPLY_LEN: u16 = COMMAND_BLOCK.at(8);

/// Number of device table entries (chapter 7), and of buffers in each I/O table (chapter 8).
pub const DEVICE_COUNT: u8 = 32;
/// Bytes of a device table entry.
pub const DEVICE_LEN: u16 = 8;
/// In a device table entry: model number.
pub const DEVICE_MODEL: u16 = 0;
/// In a device table entry: outputs disabled, the only byte that the host writes.
pub const DEVICE_OUTPUTS_DISABLED: u16 = 1;
/// In a device table entry: present.
pub const DEVICE_PRESENT: u16 = 2;
/// In a device table entry: reference address, a word.
pub const DEVICE_REFERENCE: u16 = 3;
/// In a device table entry: broadcast control data (inputs, global data) length.
pub const DEVICE_BROADCAST_LEN: u16 = 5;
/// In a device table entry: directed control data (outputs) length.
pub const DEVICE_DIRECTED_LEN: u16 = 6;
/// In a device table entry: block configuration.
pub const DEVICE_BLOCK: u16 = 7;

/// Largest length in the setup table, and largest buffer in an I/O table.
pub const MAX_TABLE_LEN: u8 = 128;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::RAM_LEN;
    use crate::io_tables::{input_buffer, output_buffer};
    use crate::request_queue::request_buffer;

    /// The memory map of chapter 3: decimal, hexadecimal, content, size.
    const MEMORY_MAP: [(u16, u16, Region, u16); 17] = [
        (0, 0x0000, REQUEST_QUEUE, 2176),
        (2176, 0x0880, Region::new(REQUEST_HEAD, 1), 1),
        (2177, 0x0881, Region::new(REQUEST_TAIL, 1), 1),
        (2178, 0x0882, SETUP_TABLE, 16),
        (2194, 0x0892, STATUS_TABLE, 16),
        (2210, 0x08A2, INTERRUPT_STATUS, 16),
        (2226, 0x08B2, INTERRUPT_DISABLE, 16),
        (2242, 0x08C2, COMMAND_BLOCK, 16),
        (2258, 0x08D2, TRANSMIT_BUFFER, 240),
        (2498, 0x09C2, READ_BUFFER, 134),
        (2632, 0x0A48, Region::new(LOCKOUT_REQUEST, 1), 1),
        (2633, 0x0A49, Region::new(LOCKOUT_STATE, 1), 1),
        (2634, 0x0A4A, RESERVED, 5046),
        (7680, 0x1E00, DEVICE_TABLE, 256),
        (7936, 0x1F00, DIRECTED_INPUT, 128),
        (8064, 0x1F80, BROADCAST_OUTPUT, 128),
        (8192, 0x2000, IO_TABLE, 8192),
    ];

    #[test]
    fn regions_follow_each_other_without_gap_or_overlap() {
        let mut next = 0;
        for (decimal, hexadecimal, region, size) in MEMORY_MAP {
            assert_eq!(decimal, hexadecimal);
            assert_eq!((region.start, region.len), (hexadecimal, size), "{hexadecimal:04X}");
            assert_eq!(region.start, next, "{hexadecimal:04X}");
            next = region.end();
        }
        assert_eq!(usize::from(next), RAM_LEN);
        assert_eq!(IO_TABLE.at(8191), 0x3FFF);
    }

    /// Every byte inside the tables, as chapters 4 to 13 list them.
    #[test]
    fn bytes_are_where_the_tables_say() {
        let pinned = [
            (SETUP_DIP_SWITCHES, 0x0882),
            (SETUP_REFERENCE, 0x0883),
            (SETUP_BROADCAST_LEN, 0x0885),
            (SETUP_DIRECTED_LEN, 0x0886),
            (SETUP_BUFFER_LEN, 0x0887),
            (STATUS_REVISION, 0x0892),
            (STATUS_OK, 0x0893),
            (STATUS_FAULTS, 0x0894),
            (STATUS_ACTIVE, 0x0895),
            (STATUS_BUS_ERRORS, 0x0896),
            (STATUS_SCAN_TIME, 0x0898),
            (INTERRUPT_STATUS.at(INTERRUPT_SUMMARY), 0x08A2),
            (INTERRUPT_STATUS.at(INTERRUPT_FIRST), 0x08A3),
            (INTERRUPT_STATUS.at(INTERRUPT_COUNT), 0x08A9),
            (INTERRUPT_DISABLE.at(INTERRUPT_SUMMARY), 0x08B2),
            (INTERRUPT_DISABLE.at(INTERRUPT_FIRST), 0x08B3),
            (INTERRUPT_DISABLE.at(INTERRUPT_COUNT), 0x08B9),
            (COMMAND_STATUS, 0x08C2),
            (COMMAND_CODE, 0x08C3),
            (COMMAND_OPTIONS, 0x08C4),
            (READ_SOURCE, 0x08C4),
            (READ_FUNCTION, 0x08C5),
            (READ_SUBFUNCTION, 0x08C6),
            (READ_DIRECTED, 0x08C7),
            (READ_LEN, 0x08C8),
            (TRANSMIT_DESTINATION, 0x08C4),
            (TRANSMIT_FUNCTION, 0x08C5),
            (TRANSMIT_SUBFUNCTION, 0x08C6),
            (TRANSMIT_PRIORITY, 0x08C7),
            (TRANSMIT_LEN, 0x08C8),
            (REPLY_SUBFUNCTION, 0x08C7),
            (REPLY_PRIORITY, 0x08C8),
            (REPLY_TRANSMIT_LEN, 0x08C9),
            (REPLY_LEN, 0x08CA),
            (COMMAND_BLOCK.at(15), 0x08D1),
            (request_buffer(0).at(REQUEST_COMMAND), 0),
            (request_buffer(0).at(REQUEST_STATUS), 1),
            (request_buffer(0).at(REQUEST_DATA_LEN), 2),
            (request_buffer(0).at(REQUEST_ADDRESS), 3),
            (request_buffer(0).at(REQUEST_SOURCE), 6),
            (request_buffer(0).at(REQUEST_AUXILIARY_SOURCE), 7),
            (request_buffer(0).at(REQUEST_DATA), 8),
            (request_buffer(1).start, 136),
            (request_buffer(15).end(), 0x0880),
            (DEVICE_TABLE.at(DEVICE_MODEL), 0x1E00),
            (DEVICE_TABLE.at(DEVICE_OUTPUTS_DISABLED), 0x1E01),
            (DEVICE_TABLE.at(DEVICE_PRESENT), 0x1E02),
            (DEVICE_TABLE.at(DEVICE_REFERENCE), 0x1E03),
            (DEVICE_TABLE.at(DEVICE_BROADCAST_LEN), 0x1E05),
            (DEVICE_TABLE.at(DEVICE_DIRECTED_LEN), 0x1E06),
            (DEVICE_TABLE.at(DEVICE_BLOCK), 0x1E07),
            (DEVICE_TABLE.at(31 * DEVICE_LEN), 0x1EF8),
            // The examples of chapter 8: buffer length 2, device 12; output tables of length 128, 1
            // and 16.
            (input_buffer(12, 2).start, 8192 + 24),
            (input_buffer(0, 128).start, 0x2000),
            (output_buffer(0, 128).start, 0x3000),
            (output_buffer(31, 128).end(), 0x4000),
            (output_buffer(12, 2).start, 8192 + 64 + 24),
            (output_buffer(0, 1).start, 8192 + 32),
            (output_buffer(0, 16).start, 8192 + 32 * 16),
        ];
        for (line, (offset, expected)) in pinned.into_iter().enumerate() {
            assert_eq!(offset, expected, "line {line}");
        }
    }

    #[test]
    fn whole_tables_are_made_of_their_parts() {
        assert_eq!(u16::from(REQUEST_COUNT) * REQUEST_LEN, REQUEST_QUEUE.len);
        assert_eq!(REQUEST_DATA + 128, REQUEST_LEN);
        assert_eq!(u16::from(DEVICE_COUNT) * DEVICE_LEN, DEVICE_TABLE.len);
        assert_eq!(2 * u16::from(DEVICE_COUNT) * u16::from(MAX_TABLE_LEN), IO_TABLE.len);
    }
}
