//! How long things take on a Genius bus.
//!
//! The published tables give what one station adds to a bus scan: a fixed part and a part per data
//! byte. Both are in nanoseconds here because half microseconds occur.

/// The four speeds of a bus. All devices on it must be set to the same one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum BusTiming {
    /// 153.6 kbaud with time for long cables between turns.
    K153Extended,
    /// 153.6 kbaud, the default.
    #[default]
    K153Standard,
    /// 76.8 kbaud.
    K76,
    /// 38.4 kbaud.
    K38,
}

/// The shortest scan. Bus controllers wait for the rest of it.
pub const MIN_SCAN_NS: u64 = 3_000_000;

/// Control characters, addresses and check characters around a datagram's data. The number is not
/// published. It only matters for how long a scan with a datagram takes.
const DATAGRAM_CHARACTERS: u64 = 9;

impl BusTiming {
    /// All four speeds.
    pub const ALL: [BusTiming; 4] =
        [BusTiming::K153Extended, BusTiming::K153Standard, BusTiming::K76, BusTiming::K38];

    /// The rate that bits 5 and 6 of a GENI's DIP switches select.
    #[must_use]
    pub fn from_dip_switches(switches: u8) -> BusTiming {
        match switches >> 5 & 0b11 {
            0b00 => BusTiming::K153Extended,
            0b01 => BusTiming::K38,
            0b10 => BusTiming::K76,
            _ => BusTiming::K153Standard,
        }
    }

    /// The two DIP switch bits of this rate, in place.
    #[must_use]
    pub fn dip_switches(self) -> u8 {
        match self {
            BusTiming::K153Extended => 0b00 << 5,
            BusTiming::K38 => 0b01 << 5,
            BusTiming::K76 => 0b10 << 5,
            BusTiming::K153Standard => 0b11 << 5,
        }
    }

    /// The code in a Read ID reply.
    #[must_use]
    pub fn code(self) -> u8 {
        match self {
            BusTiming::K153Extended => 0,
            BusTiming::K153Standard => 1,
            BusTiming::K76 => 2,
            BusTiming::K38 => 3,
        }
    }

    /// What a device adds to every scan, without its data.
    #[must_use]
    pub fn fixed_ns(self) -> u64 {
        match self {
            BusTiming::K153Extended => 1_015_000,
            BusTiming::K153Standard => 943_000,
            BusTiming::K76 => 1_538_000,
            BusTiming::K38 => 2_583_000,
        }
    }

    /// What a byte of data adds to every scan.
    #[must_use]
    pub fn byte_ns(self) -> u64 {
        match self {
            BusTiming::K153Extended | BusTiming::K153Standard => 71_500,
            BusTiming::K76 => 143_000,
            BusTiming::K38 => 286_000,
        }
    }

    /// How long everyone waits for a bus address that is not in use.
    #[must_use]
    pub fn skip_ns(self) -> u64 {
        match self {
            BusTiming::K153Standard => 6_510,
            // Two bit times, for long cables.
            BusTiming::K153Extended => 2 * 6_510,
            BusTiming::K76 => 13_021,
            BusTiming::K38 => 26_042,
        }
    }

    /// What a device with `bytes` of inputs and outputs together adds to every scan.
    #[must_use]
    pub fn contribution_ns(self, bytes: usize) -> u64 {
        self.fixed_ns() + self.byte_ns() * bytes as u64
    }

    /// What a datagram adds to the scan in which it is sent.
    #[must_use]
    pub fn datagram_ns(self, bytes: usize) -> u64 {
        self.byte_ns() * (DATAGRAM_CHARACTERS + bytes as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_switches_give_the_rate_and_back() {
        for rate in BusTiming::ALL {
            assert_eq!(BusTiming::from_dip_switches(rate.dip_switches() | 0x9F), rate);
        }
        assert_eq!(BusTiming::from_dip_switches(0xFF), BusTiming::default());
    }
}
