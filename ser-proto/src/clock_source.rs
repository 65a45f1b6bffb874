//! Where a recorder's clock has its time from.

use core::fmt;

/// The source of a clock's time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ClockSource {
    /// The clock was never set since power-up, and no battery kept it. Code 0.
    NeverSet,
    /// The battery-backed clock, which was read at power-up. Code 1.
    Battery,
    /// A host set it over RS-232. Code 2.
    HostOverRs232,
    /// A host set it over Genius. Code 3.
    HostOverGenius,
    /// A pulse each second disciplines it. Code 4.
    Pps,
    /// An IRIG-B signal disciplines it. Code 5.
    IrigB,
    /// A source that is not known here, by its code, 6–255.
    Other(u8),
}

impl ClockSource {
    /// The source with wire code `code`.
    #[must_use]
    pub const fn from_code(code: u8) -> ClockSource {
        match code {
            0 => ClockSource::NeverSet,
            1 => ClockSource::Battery,
            2 => ClockSource::HostOverRs232,
            3 => ClockSource::HostOverGenius,
            4 => ClockSource::Pps,
            5 => ClockSource::IrigB,
            other => ClockSource::Other(other),
        }
    }

    /// The wire code.
    #[must_use]
    pub const fn code(self) -> u8 {
        match self {
            ClockSource::NeverSet => 0,
            ClockSource::Battery => 1,
            ClockSource::HostOverRs232 => 2,
            ClockSource::HostOverGenius => 3,
            ClockSource::Pps => 4,
            ClockSource::IrigB => 5,
            ClockSource::Other(code) => code,
        }
    }
}

/// As `set by a host over RS-232`.
impl fmt::Display for ClockSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            ClockSource::NeverSet => "never set",
            ClockSource::Battery => "from the battery-backed clock",
            ClockSource::HostOverRs232 => "set by a host over RS-232",
            ClockSource::HostOverGenius => "set by a host over Genius",
            ClockSource::Pps => "disciplined by PPS",
            ClockSource::IrigB => "disciplined by IRIG-B",
            ClockSource::Other(code) => return write!(f, "from source {code}, not known here"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_is_kept_and_six_have_a_name() {
        for code in 0..=255 {
            let source = ClockSource::from_code(code);
            assert_eq!(source.code(), code);
            assert_eq!(matches!(source, ClockSource::Other(_)), code > 5);
        }
        assert_eq!(ClockSource::from_code(9).to_string(), "from source 9, not known here");
    }
}
