//! The command bytes: seven of the manual (table "Command bytes"), and those of our extension.

/// The first byte of every body: which command it is, or which command it answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Code {
    /// `C`: configure the recorder.
    Configure = 0x43,
    /// `E`: erase the event buffer.
    Erase = 0x45,
    /// `D`, of our extension: ask for the counters.
    Diagnostics = 0x44,
    /// `F`, of our extension: ask for the filters of the inputs, or set them.
    Filters = 0x46,
    /// `I`, of our extension: ask what the recorder is and can do.
    Identify = 0x49,
    /// `L`: ask for the last command that was received as a broadcast.
    LastBroadcast = 0x4C,
    /// `M`: start or stop recording; the reply tells mode and firmware version.
    Mode = 0x4D,
    /// `P`: print entries as text on RS-232.
    Print = 0x50,
    /// `R`: read entries.
    Read = 0x52,
    /// `S`: set the clock.
    SetClock = 0x53,
    /// `T`, of our extension: ask what the clock shows.
    Time = 0x54,
}

impl Code {
    /// All: those of the manual in the order of its table, then ours.
    pub const ALL: [Code; 11] = [
        Code::Configure,
        Code::Erase,
        Code::LastBroadcast,
        Code::Mode,
        Code::Print,
        Code::Read,
        Code::SetClock,
        Code::Identify,
        Code::Time,
        Code::Filters,
        Code::Diagnostics,
    ];

    /// Whether the command is one of our extension, which the manual does not have.
    #[must_use]
    pub const fn is_of_extension(self) -> bool {
        match self {
            Code::Identify | Code::Time | Code::Filters | Code::Diagnostics => true,
            Code::Configure
            | Code::Erase
            | Code::LastBroadcast
            | Code::Mode
            | Code::Print
            | Code::Read
            | Code::SetClock => false,
        }
    }

    /// The code that `byte` stands for, if any.
    #[must_use]
    pub fn from_byte(byte: u8) -> Option<Code> {
        Code::ALL.into_iter().find(|code| code.byte() == byte)
    }

    /// The byte on the wire.
    #[must_use]
    pub const fn byte(self) -> u8 {
        self as u8
    }

    /// The command's name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Code::Configure => "configure",
            Code::Diagnostics => "diagnostics",
            Code::Erase => "erase",
            Code::Filters => "filters",
            Code::Identify => "identify",
            Code::LastBroadcast => "last broadcast",
            Code::Mode => "mode and status",
            Code::Print => "print entries",
            Code::Read => "read entries",
            Code::SetClock => "set clock",
            Code::Time => "time",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_has_the_byte_of_its_table() {
        let manual = [
            (Code::Configure, b'C', 0x43),
            (Code::Erase, b'E', 0x45),
            (Code::LastBroadcast, b'L', 0x4C),
            (Code::Mode, b'M', 0x4D),
            (Code::Print, b'P', 0x50),
            (Code::Read, b'R', 0x52),
            (Code::SetClock, b'S', 0x53),
        ];
        let ours = [
            (Code::Identify, b'I', 0x49),
            (Code::Time, b'T', 0x54),
            (Code::Filters, b'F', 0x46),
            (Code::Diagnostics, b'D', 0x44),
        ];
        for (table, is_ours) in [(&manual[..], false), (&ours, true)] {
            for &(code, letter, byte) in table {
                assert_eq!(code.byte(), byte);
                assert_eq!(code.byte(), letter);
                assert_eq!(Code::from_byte(byte), Some(code));
                assert_eq!(code.is_of_extension(), is_ours);
            }
        }
        assert_eq!((0..=255).filter_map(Code::from_byte).count(), manual.len() + ours.len());
    }
}
