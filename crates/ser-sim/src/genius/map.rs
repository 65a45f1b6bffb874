//! Where things are in the shared RAM of a GENI board (manual, chapter 3).

/// Size of the shared RAM: 14 address lines.
pub const RAM_LEN: usize = 0x4000;

/// Buffers of the request queue.
pub(super) const REQUESTS: usize = 16;
/// A request's header and its 128 bytes of data. Exactly 16 of these fill the queue's 2176 bytes.
pub(super) const REQUEST_LEN: usize = 136;

pub(super) const REQUEST_QUEUE: usize = 0x0000;
pub(super) const REQUEST_HEAD: usize = 0x0880;
pub(super) const REQUEST_TAIL: usize = 0x0881;

pub(super) const DIP_SWITCHES: usize = 0x0882;
pub(super) const REFERENCE: usize = 0x0883;
pub(super) const BROADCAST_LENGTH: usize = 0x0885;
pub(super) const DIRECTED_LENGTH: usize = 0x0886;
pub(super) const BUFFER_LENGTH: usize = 0x0887;

pub(super) const STATUS: usize = 0x0892;
pub(super) const STATUS_LEN: usize = 16;
pub(super) const REVISION: usize = 0x0892;
pub(super) const BOARD_OK: usize = 0x0893;
pub(super) const HARDWARE: usize = 0x0894;
pub(super) const ACTIVE: usize = 0x0895;
pub(super) const BUS_ERRORS: usize = 0x0896;
pub(super) const SCAN_TIME: usize = 0x0898;

pub(super) const INTERRUPT_STATUS: usize = 0x08A2;
pub(super) const INTERRUPT_DISABLE: usize = 0x08B2;
/// The summary byte and the seven conditions.
pub(super) const INTERRUPTS: usize = 8;

pub(super) const COMMAND_STATUS: usize = 0x08C2;
pub(super) const COMMAND: usize = 0x08C3;
pub(super) const COMMAND_OPTIONS: usize = 0x08C4;
pub(super) const COMMAND_BLOCK_END: usize = 0x08D2;

pub(super) const TRANSMIT_BUFFER: usize = 0x08D2;
pub(super) const TRANSMIT_BUFFER_LEN: usize = 240;
pub(super) const READ_BUFFER: usize = 0x09C2;
pub(super) const READ_BUFFER_LEN: usize = 134;

pub(super) const LOCKOUT_REQUEST: usize = 0x0A48;
pub(super) const LOCKOUT_STATE: usize = 0x0A49;
pub(super) const RESERVED: usize = 0x0A4A;

pub(super) const DEVICES: usize = 0x1E00;
pub(super) const DEVICE_LEN: usize = 8;
// Offsets within a device table entry:
pub(super) const DEVICE_MODEL: usize = 0;
pub(super) const DEVICE_OUTPUTS: usize = 1;
pub(super) const DEVICE_PRESENT: usize = 2;
pub(super) const DEVICE_REFERENCE: usize = 3;
pub(super) const DEVICE_BROADCAST_LENGTH: usize = 5;
pub(super) const DEVICE_DIRECTED_LENGTH: usize = 6;
pub(super) const DEVICE_BLOCK: usize = 7;

pub(super) const DIRECTED_IN: usize = 0x1F00;
pub(super) const BROADCAST_OUT: usize = 0x1F80;
pub(super) const IO_TABLES: usize = 0x2000;

/// The most bytes a device sends or takes as control data.
pub(super) const MAX_CONTROL_LEN: usize = 128;

/// The entry of a device in the device table.
pub(super) fn device(address: u8) -> usize {
    DEVICES + DEVICE_LEN * usize::from(address)
}

/// A device's input buffer, whatever the length of the buffers.
pub(super) fn input_buffer(address: u8, buffer_len: u8) -> usize {
    IO_TABLES + usize::from(address) * usize::from(buffer_len)
}

/// A device's output buffer: the output table begins where 32 input buffers end.
pub(super) fn output_buffer(address: u8, buffer_len: u8) -> usize {
    IO_TABLES + (32 + usize::from(address)) * usize::from(buffer_len)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_areas_follow_one_another_with_the_sizes_of_the_memory_map() {
        assert_eq!(REQUEST_QUEUE + REQUESTS * REQUEST_LEN, REQUEST_HEAD);
        assert_eq!(DIP_SWITCHES + 16, STATUS);
        assert_eq!(STATUS + STATUS_LEN, INTERRUPT_STATUS);
        assert_eq!(INTERRUPT_STATUS + 16, INTERRUPT_DISABLE);
        assert_eq!(INTERRUPT_DISABLE + 16, COMMAND_STATUS);
        assert_eq!(COMMAND_STATUS + 16, COMMAND_BLOCK_END);
        assert_eq!(TRANSMIT_BUFFER + TRANSMIT_BUFFER_LEN, READ_BUFFER);
        assert_eq!(READ_BUFFER + READ_BUFFER_LEN, LOCKOUT_REQUEST);
        assert_eq!(RESERVED + 5046, DEVICES);
        assert_eq!(device(32), DIRECTED_IN);
        assert_eq!(DIRECTED_IN + MAX_CONTROL_LEN, BROADCAST_OUT);
        assert_eq!(BROADCAST_OUT + MAX_CONTROL_LEN, IO_TABLES);
        assert_eq!(output_buffer(32, 128), RAM_LEN);
    }

    #[test]
    fn the_output_table_moves_with_the_buffer_length() {
        assert_eq!(output_buffer(0, 128), 0x3000);
        assert_eq!(output_buffer(0, 16), 0x2000 + 32 * 16);
        // The manual's example: buffer length 2, device 12.
        assert_eq!(input_buffer(12, 2), 0x2000 + 24);
        assert_eq!(output_buffer(12, 2), output_buffer(0, 2) + 24);
    }
}
