//! The device table (chapter 7): who is on the bus.

use crate::map;
use crate::ram::SharedRam;

/// Direction of a block's data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum BlockKind {
    /// The board does not tell.
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
    /// Whether outputs to it are disabled.
    pub outputs_disabled: bool,
    /// Reference address; its meaning is up to the device.
    pub reference: u16,
    /// Bytes of inputs or global data that it sends in every scan; not more than a buffer holds.
    pub input_len: u8,
    /// Bytes of outputs or directed control data that it receives in every scan; not more than a
    /// buffer holds.
    pub output_len: u8,
    /// Direction of its data.
    pub kind: BlockKind,
}

/// The content of a device table entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Record {
    Absent,
    Present(Device),
    /// A device with more data than the buffers hold; the board logs no such device in.
    Impossible,
}

/// Offset of a byte in a device's entry.
fn record_byte(device_number: u8, byte: u16) -> u16 {
    map::DEVICE_TABLE.at(u16::from(device_number) * map::DEVICE_LEN + byte)
}

/// The entry of the device at bus address 0–31.
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

/// Enables or disables outputs to the device at bus address 0–31.
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
