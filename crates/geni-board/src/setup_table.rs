//! The setup table (chapter 4): the settings that the board takes from its switches and from the
//! host.

use core::fmt;

use crate::map;
use crate::ram::SharedRam;

/// Bit rate of the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum RateSetting {
    /// 153.6 kbit/s, extended.
    K153_6Extended,
    /// 153.6 kbit/s, standard.
    K153_6Standard,
    /// 76.8 kbit/s.
    K76_8,
    /// 38.4 kbit/s.
    K38_4,
}

/// The DIP switches, as the board read them at power-up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BoardSwitches {
    /// Address of the board on the bus, 0–31.
    pub device_number: u8,
    /// Bit rate of the bus.
    pub rate: RateSetting,
    /// Whether devices get outputs as soon as they log in.
    pub outputs_enabled: bool,
}

impl BoardSwitches {
    /// The switches that the byte in the setup table stands for; an open switch is 1.
    #[must_use]
    pub const fn from_byte(byte: u8) -> BoardSwitches {
        // Bit 5 is switch 6 and bit 6 is switch 7.
        let rate = match byte >> 5 & 0b11 {
            0b00 => RateSetting::K153_6Extended,
            0b01 => RateSetting::K38_4,
            0b10 => RateSetting::K76_8,
            _ => RateSetting::K153_6Standard,
        };
        BoardSwitches { device_number: byte & 0x1F, rate, outputs_enabled: byte & 0x80 != 0 }
    }

    pub(crate) fn read<R: SharedRam>(ram: &R) -> BoardSwitches {
        BoardSwitches::from_byte(ram.read(map::SETUP_DIP_SWITCHES))
    }
}

/// The settings that the host writes into the setup table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Configuration {
    reference: u16,
    broadcast_len: u8,
    directed_len: u8,
    buffer_len: u8,
}

/// A length that the board would refuse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum InvalidConfiguration {
    /// More than 128 bytes of global data.
    BroadcastLen(u8),
    /// More than 128 bytes of directed control data.
    DirectedLen(u8),
    /// A buffer length of 0 or more than 128.
    BufferLen(u8),
}

impl fmt::Display for InvalidConfiguration {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            InvalidConfiguration::BroadcastLen(len) => {
                write!(f, "{len} bytes of global data, at most 128 are possible")
            }
            InvalidConfiguration::DirectedLen(len) => {
                write!(f, "{len} bytes of directed control data, at most 128 are possible")
            }
            InvalidConfiguration::BufferLen(len) => {
                write!(f, "I/O buffers of {len} bytes, 1 to 128 are possible")
            }
        }
    }
}

impl core::error::Error for InvalidConfiguration {}

impl Configuration {
    /// The configuration of a board after reset: no global data, no directed control data, buffers
    /// of 128 bytes.
    pub const DEFAULT: Configuration = Configuration {
        reference: 0xFFFF,
        broadcast_len: 0,
        directed_len: 0,
        buffer_len: map::MAX_TABLE_LEN,
    };

    /// The board passes `reference` on to devices that ask, and does not use it. In every scan it
    /// sends `broadcast_len` bytes of global data and receives `directed_len` bytes of directed
    /// control data. Devices with more than `buffer_len` bytes of inputs or outputs are not logged
    /// in.
    ///
    /// # Errors
    ///
    /// The first length that is out of range. Lengths are 0–128, for the buffers 1–128.
    pub const fn new(
        reference: u16,
        broadcast_len: u8,
        directed_len: u8,
        buffer_len: u8,
    ) -> Result<Configuration, InvalidConfiguration> {
        if broadcast_len > map::MAX_TABLE_LEN {
            return Err(InvalidConfiguration::BroadcastLen(broadcast_len));
        }
        if directed_len > map::MAX_TABLE_LEN {
            return Err(InvalidConfiguration::DirectedLen(directed_len));
        }
        if buffer_len == 0 || buffer_len > map::MAX_TABLE_LEN {
            return Err(InvalidConfiguration::BufferLen(buffer_len));
        }
        Ok(Configuration { reference, broadcast_len, directed_len, buffer_len })
    }

    /// Reference address.
    #[must_use]
    pub const fn reference(self) -> u16 {
        self.reference
    }

    /// Bytes of global data that the board sends in every scan, 0–128.
    #[must_use]
    pub const fn broadcast_len(self) -> u8 {
        self.broadcast_len
    }

    /// Bytes of directed control data that the board receives in every scan, 0–128.
    #[must_use]
    pub const fn directed_len(self) -> u8 {
        self.directed_len
    }

    /// Length of the buffers in the input and output tables, 1–128.
    #[must_use]
    pub const fn buffer_len(self) -> u8 {
        self.buffer_len
    }

    /// Whether the two differ in more than the buffer length. The board then stops sending while it
    /// changes.
    pub(crate) fn silences_the_bus(self, other: Configuration) -> bool {
        Configuration { buffer_len: other.buffer_len, ..self } != other
    }

    pub(crate) fn read<R: SharedRam>(ram: &R) -> Result<Configuration, InvalidConfiguration> {
        Configuration::new(
            ram.read_word(map::SETUP_REFERENCE),
            ram.read(map::SETUP_BROADCAST_LEN),
            ram.read(map::SETUP_DIRECTED_LEN),
            ram.read(map::SETUP_BUFFER_LEN),
        )
    }

    pub(crate) fn write<R: SharedRam>(self, ram: &mut R) {
        ram.write_word(map::SETUP_REFERENCE, self.reference);
        ram.write(map::SETUP_BROADCAST_LEN, self.broadcast_len);
        ram.write(map::SETUP_DIRECTED_LEN, self.directed_len);
        ram.write(map::SETUP_BUFFER_LEN, self.buffer_len);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ArrayRam;

    #[test]
    fn switches_6_and_7_choose_the_bus_rate() {
        let rate = |byte| BoardSwitches::from_byte(byte).rate;
        assert_eq!(rate(0x00), RateSetting::K153_6Extended);
        assert_eq!(rate(0x20), RateSetting::K38_4);
        assert_eq!(rate(0x40), RateSetting::K76_8);
        assert_eq!(rate(0x60), RateSetting::K153_6Standard);
        let as_delivered = BoardSwitches::from_byte(0xFF);
        assert_eq!((as_delivered.device_number, as_delivered.outputs_enabled), (31, true));
        assert!(!BoardSwitches::from_byte(0x7F).outputs_enabled);
    }

    #[test]
    fn lengths_have_limits() {
        assert_eq!(Configuration::new(0, 129, 0, 1), Err(InvalidConfiguration::BroadcastLen(129)));
        assert_eq!(Configuration::new(0, 128, 129, 1), Err(InvalidConfiguration::DirectedLen(129)));
        assert_eq!(Configuration::new(0, 128, 128, 0), Err(InvalidConfiguration::BufferLen(0)));
        assert_eq!(Configuration::new(0, 128, 128, 129), Err(InvalidConfiguration::BufferLen(129)));
        assert!(Configuration::new(0, 128, 128, 128).is_ok());
    }

    #[test]
    fn the_switches_are_not_written() {
        let mut ram = ArrayRam::new();
        ram.write(0x0882, 0xFF);
        let configuration = Configuration::new(0xC123, 4, 7, 16).expect("lengths in range");
        configuration.write(&mut ram);
        let mut table = [0; 7];
        ram.read_bytes(0x0882, &mut table);
        assert_eq!(table, [0xFF, 0x23, 0xC1, 4, 7, 16, 0]);
        assert_eq!(Configuration::read(&ram), Ok(configuration));
    }
}
