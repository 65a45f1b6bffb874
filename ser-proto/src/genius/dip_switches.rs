//! The eight DIP switches of a recorder (manual, section "DIP Switch Settings").
//!
//! ```text
//! switch   8      | 7    6                           | 5  4  3  2  1
//! bit      7      | 6    5                           | 4  3  2  1  0
//! meaning  open   | bus rate                         | address, switch 1 counts 1, switch 5 counts 16
//!                 | 0 0 153.6K extended, 0 1 38.4K,  |
//!                 | 1 0 76.8K, 1 1 153.6K standard   |
//! ```
//!
//! An open switch is a 1. The switches of a GENI board mean the same, except that its switch 8
//! disables outputs when closed.

use core::fmt;

use super::{BusAddress, BusRate};

/// Where the switches stand: switch 1 is bit 0, a 1 is open.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DipSwitches(pub u8);

impl DipSwitches {
    /// Whether switch `number`, 1–8, is open.
    #[must_use]
    pub const fn is_open(self, number: u8) -> bool {
        number >= 1 && number <= 8 && self.0 >> (number - 1) & 1 == 1
    }

    /// The address that switches 1–5 give.
    #[must_use]
    pub fn address(self) -> BusAddress {
        // Five bits always make a valid address.
        BusAddress::new(self.0 & 0x1F).unwrap_or(BusAddress::FIRST)
    }

    /// The rate that switches 6 and 7 give.
    #[must_use]
    pub const fn rate(self) -> BusRate {
        match (self.is_open(7), self.is_open(6)) {
            (false, false) => BusRate::K153_6Extended,
            (false, true) => BusRate::K38_4,
            (true, false) => BusRate::K76_8,
            (true, true) => BusRate::K153_6Standard,
        }
    }

    /// The settings of a recorder with these switches.
    ///
    /// # Errors
    /// [`Switch8Closed`]: a recorder has no outputs that switch 8 could disable.
    pub fn settings(self) -> Result<BusSettings, Switch8Closed> {
        match self.is_open(8) {
            true => Ok(BusSettings { address: self.address(), rate: self.rate() }),
            false => Err(Switch8Closed),
        }
    }
}

/// As `1 3 5 6 7 8 open`, or `none open`.
impl fmt::Display for DipSwitches {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            0 => f.write_str("none open"),
            bits => write!(f, "{} open", crate::Inputs(bits.into())),
        }
    }
}

/// What the DIP switches set: the recorder's place on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BusSettings {
    /// Its address.
    pub address: BusAddress,
    /// The rate of the bus.
    pub rate: BusRate,
}

impl BusSettings {
    /// The switches for these settings, with switch 8 open.
    #[must_use]
    pub const fn switches(self) -> DipSwitches {
        let rate = match self.rate {
            BusRate::K153_6Extended => 0b00,
            BusRate::K38_4 => 0b01,
            BusRate::K76_8 => 0b10,
            BusRate::K153_6Standard => 0b11,
        };
        DipSwitches(0x80 | rate << 5 | self.address.number())
    }
}

/// As `address 5, 153.6K standard`.
impl fmt::Display for BusSettings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "address {}, {}", self.address, self.rate)
    }
}

/// Switch 8 of a recorder is closed, which the manual forbids.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Switch8Closed;

impl fmt::Display for Switch8Closed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("DIP switch 8 is closed and must be open")
    }
}

impl core::error::Error for Switch8Closed {}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of the manual's table, switches in the order 1 2 3 4 5, 1 is open.
    const ADDRESSES: [&str; 32] = [
        "00000", "10000", "01000", "11000", "00100", "10100", "01100", "11100", "00010", "10010",
        "01010", "11010", "00110", "10110", "01110", "11110", "00001", "10001", "01001", "11001",
        "00101", "10101", "01101", "11101", "00011", "10011", "01011", "11011", "00111", "10111",
        "01111", "11111",
    ];

    /// Rows of the manual's table, switches in the order 6 7.
    const RATES: [(&str, BusRate); 4] = [
        ("00", BusRate::K153_6Extended),
        ("10", BusRate::K38_4),
        ("01", BusRate::K76_8),
        ("11", BusRate::K153_6Standard),
    ];

    /// Switches as a row of the manual's tables gives them, switch 1 first.
    fn switches(row: &str) -> DipSwitches {
        DipSwitches(row.bytes().rev().fold(0, |bits, digit| bits << 1 | (digit - b'0')))
    }

    #[test]
    fn the_switches_mean_what_the_manuals_tables_say() {
        for (number, row) in (0..).zip(ADDRESSES) {
            for (rate_row, rate) in RATES {
                let open = switches(&format!("{row}{rate_row}1"));
                let settings = BusSettings { address: BusAddress::new(number).unwrap(), rate };
                assert_eq!(open.settings(), Ok(settings));
                assert_eq!(settings.switches(), open);
                let closed = switches(&format!("{row}{rate_row}0"));
                assert_eq!(closed.settings(), Err(Switch8Closed));
                assert_eq!((closed.address(), closed.rate()), (settings.address, settings.rate));
            }
        }
    }

    #[test]
    fn every_one_of_the_256_settings_is_understood_or_refused() {
        let mut understood = 0;
        for bits in 0..=255 {
            match DipSwitches(bits).settings() {
                Ok(settings) => {
                    assert_eq!(settings.switches(), DipSwitches(bits));
                    understood += 1;
                }
                Err(Switch8Closed) => assert!(bits < 0x80),
            }
        }
        assert_eq!(understood, 32 * 4);
    }

    #[test]
    fn settings_read_well() {
        assert_eq!(DipSwitches(0xE5).settings().unwrap().to_string(), "address 5, 153.6K standard");
        assert_eq!(DipSwitches(0xE5).to_string(), "1 3 6 7 8 open");
        assert_eq!(DipSwitches(0).to_string(), "none open");
        assert!(!DipSwitches(0xFF).is_open(0));
        assert!(!DipSwitches(0xFF).is_open(9));
    }
}
