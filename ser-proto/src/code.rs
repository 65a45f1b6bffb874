//! The command bytes (manual, table "Command bytes").

/// The first byte of every body: which command it is, or which command it answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Code {
    /// `C`: configure the recorder.
    Configure = 0x43,
    /// `E`: erase the event buffer.
    Erase = 0x45,
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
}

impl Code {
    /// All seven, in the order of the manual's table.
    pub const ALL: [Code; 7] = [
        Code::Configure,
        Code::Erase,
        Code::LastBroadcast,
        Code::Mode,
        Code::Print,
        Code::Read,
        Code::SetClock,
    ];

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
            Code::Erase => "erase",
            Code::LastBroadcast => "last broadcast",
            Code::Mode => "mode and status",
            Code::Print => "print entries",
            Code::Read => "read entries",
            Code::SetClock => "set clock",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_has_the_byte_of_the_manuals_table() {
        let table = [
            (Code::Configure, b'C', 0x43),
            (Code::Erase, b'E', 0x45),
            (Code::LastBroadcast, b'L', 0x4C),
            (Code::Mode, b'M', 0x4D),
            (Code::Print, b'P', 0x50),
            (Code::Read, b'R', 0x52),
            (Code::SetClock, b'S', 0x53),
        ];
        for (code, letter, byte) in table {
            assert_eq!(code.byte(), byte);
            assert_eq!(code.byte(), letter);
            assert_eq!(Code::from_byte(byte), Some(code));
        }
        assert_eq!((0..=255).filter_map(Code::from_byte).count(), table.len());
    }
}
