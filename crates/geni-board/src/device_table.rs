//! The device table (chapter 7): who is on the bus.

use crate::map;
use crate::ram::SharedRam;

/// Direction of a block's data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum BlockKind {
    /// Not told.
    Unknown,
    /// Inputs only.
    Inputs,
    /// Outputs only.
    Outputs,
    /// Inputs and outputs.
    Combination,
}

/// A device that is logged in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Device {
    /// Model number.
    pub model: u8,
    /// Whether it is kept from getting outputs.
    pub outputs_disabled: bool,
    /// Reference address, whatever it means to the device.
    pub reference: u16,
    /// Bytes of inputs or global data it sends in every scan. Not more than a buffer holds.
    pub input_len: u8,
    /// Bytes of outputs or directed control data it takes in every scan. Not more than a buffer
    /// holds.
    pub output_len: u8,
    /// Direction of its data.
    pub kind: BlockKind,
}

/// What a record says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Record {
    Absent,
    Present(Device),
    /// A device that is longer than the buffers: the board does not log these in.
    Impossible,
}

/// Offset of a byte of a device's record.
fn record_byte(device_number: u8, byte: u16) -> u16 {
    map::DEVICE_TABLE.at(u16::from(device_number) * map::DEVICE_LEN + byte)
}

/// The record of device 0–31.
pub(crate) fn read_record<R: SharedRam>(ram: &R, device_number: u8, buffer_len: u8) -> Record {
    if device_number >= map::DEVICE_COUNT {
        return Record::Absent;
    }
    let byte = |index| ram.read(record_byte(device_number, index));
    if byte(map::DEVICE_PRESENT) & 1 == 0 {
        return Record::Absent;
    }
    let device = Device {
        model: byte(map::DEVICE_MODEL),
        outputs_disabled: byte(map::DEVICE_OUTPUTS_DISABLED) & 1 != 0,
        reference: ram.read_word(record_byte(device_number, map::DEVICE_REFERENCE)),
        input_len: byte(map::DEVICE_BROADCAST_LEN),
        output_len: byte(map::DEVICE_DIRECTED_LEN),
        kind: match byte(map::DEVICE_BLOCK) & 0b11 {
            0b01 => BlockKind::Inputs,
            0b10 => BlockKind::Outputs,
            0b11 => BlockKind::Combination,
            _ => BlockKind::Unknown,
        },
    };
    if device.input_len > buffer_len || device.output_len > buffer_len {
        Record::Impossible
    } else {
        Record::Present(device)
    }
}

/// Lets device 0–31 have outputs, or keeps it from them.
pub(crate) fn write_outputs_disabled<R: SharedRam>(ram: &mut R, device_number: u8, disabled: bool) {
    if device_number < map::DEVICE_COUNT {
        ram.write(record_byte(device_number, map::DEVICE_OUTPUTS_DISABLED), disabled.into());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ArrayRam;

    #[test]
    fn a_record_is_read_as_chapter_7_has_it() {
        let mut ram = ArrayRam::new();
        ram.write_bytes(0x1E00 + 12 * 8, &[64, 1, 1, 0x34, 0x12, 8, 4, 3]);
        let device = Device {
            model: 64,
            outputs_disabled: true,
            reference: 0x1234,
            input_len: 8,
            output_len: 4,
            kind: BlockKind::Combination,
        };
        assert_eq!(read_record(&ram, 12, 128), Record::Present(device));
        assert_eq!(read_record(&ram, 12, 8), Record::Present(device));
        assert_eq!(read_record(&ram, 12, 7), Record::Impossible);
        assert_eq!(read_record(&ram, 13, 128), Record::Absent);
        assert_eq!(read_record(&ram, 32, 128), Record::Absent);
    }

    #[test]
    fn enabling_outputs_touches_one_byte() {
        let mut ram = ArrayRam::new();
        ram.write_bytes(0x1E00, &[9; 24]);
        write_outputs_disabled(&mut ram, 1, true);
        write_outputs_disabled(&mut ram, 2, false);
        write_outputs_disabled(&mut ram, 200, false);
        let mut bytes = [0; 24];
        ram.read_bytes(0x1E00, &mut bytes);
        assert_eq!(bytes, [9, 9, 9, 9, 9, 9, 9, 9, 9, 1, 9, 9, 9, 9, 9, 9, 9, 0, 9, 9, 9, 9, 9, 9]);
    }
}
