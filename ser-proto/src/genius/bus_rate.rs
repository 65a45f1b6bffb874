//! The four rates of a Genius bus.

use core::fmt;

/// How fast a bus runs. Every device on it has the same setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum BusRate {
    /// 153.6 kbit/s with a longer gap between turns, for long cables.
    K153_6Extended = 0,
    /// 153.6 kbit/s.
    K153_6Standard = 1,
    /// 76.8 kbit/s.
    K76_8 = 2,
    /// 38.4 kbit/s.
    K38_4 = 3,
}

impl BusRate {
    /// All four, in the order of their codes.
    pub const ALL: [BusRate; 4] =
        [BusRate::K153_6Extended, BusRate::K153_6Standard, BusRate::K76_8, BusRate::K38_4];

    /// The rate with code `code`, 0–3, as in a Read ID reply.
    #[must_use]
    pub fn from_code(code: u8) -> Option<BusRate> {
        BusRate::ALL.into_iter().find(|rate| rate.code() == code)
    }

    /// The code, 0–3, as in a Read ID reply. The DIP switches use another code.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The rate in bits per second.
    #[must_use]
    pub const fn bits_per_second(self) -> u32 {
        match self {
            BusRate::K153_6Extended | BusRate::K153_6Standard => 153_600,
            BusRate::K76_8 => 76_800,
            BusRate::K38_4 => 38_400,
        }
    }

    /// The name that the manuals use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            BusRate::K153_6Extended => "153.6K extended",
            BusRate::K153_6Standard => "153.6K standard",
            BusRate::K76_8 => "76.8K",
            BusRate::K38_4 => "38.4K",
        }
    }
}

/// As `153.6K standard`.
impl fmt::Display for BusRate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}
