//! Configuration, command `C` (manual, section "Configuration Unit").
//!
//! ```text
//! | 43 | size (2) | baud code | auto report | report address | auto print |    7 bytes, both directions
//! ```
//! In a command, size 0 or baud code 0 keeps the value in force. The reply always holds the values
//! now in force.
//! now.

use nom::Parser;

use crate::fields::{Bytes, below, byte, flag, word};
use crate::params::parse_params;
use crate::{Body, Code, ParseError};

/// The largest event buffer, in entries.
pub const MAX_SIZE: u16 = 2048;

/// The highest address on a Genius bus.
pub const MAX_REPORT_ADDRESS: u8 = 31;

/// Rate of the RS-232 port; always 8 data bits, no parity, 1 stop bit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Baud {
    /// 300 bit/s.
    B300 = 1,
    /// 600 bit/s.
    B600 = 2,
    /// 1200 bit/s.
    B1200 = 3,
    /// 2400 bit/s.
    B2400 = 4,
    /// 4800 bit/s.
    B4800 = 5,
    /// 9600 bit/s, as delivered.
    #[default]
    B9600 = 6,
    /// 19200 bit/s.
    B19200 = 7,
}

impl Baud {
    /// All seven rates, slowest first.
    pub const ALL: [Baud; 7] =
        [Baud::B300, Baud::B600, Baud::B1200, Baud::B2400, Baud::B4800, Baud::B9600, Baud::B19200];

    /// The rate with wire code `code`, 1–7.
    #[must_use]
    pub fn from_code(code: u8) -> Option<Baud> {
        Baud::ALL.into_iter().find(|baud| baud.code() == code)
    }

    /// The wire code, 1–7.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The rate in bits per second.
    #[must_use]
    pub const fn bits_per_second(self) -> u32 {
        match self {
            Baud::B300 => 300,
            Baud::B600 => 600,
            Baud::B1200 => 1200,
            Baud::B2400 => 2400,
            Baud::B4800 => 4800,
            Baud::B9600 => 9600,
            Baud::B19200 => 19_200,
        }
    }

    /// The rate of `bits_per_second`, if the recorder has it.
    #[must_use]
    pub fn from_bits_per_second(bits_per_second: u32) -> Option<Baud> {
        Baud::ALL.into_iter().find(|baud| baud.bits_per_second() == bits_per_second)
    }
}

/// Where a read reply goes by itself after every event.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum AutoReport {
    /// Nowhere. Code 0; code 1 means the same.
    #[default]
    Off,
    /// To the report address on the Genius bus. Code 2.
    Genius,
    /// To the RS-232 port. Code 3.
    Rs232,
}

impl AutoReport {
    /// The destination with wire code `code`, 0–3.
    #[must_use]
    pub const fn from_code(code: u8) -> Option<AutoReport> {
        match code {
            0 | 1 => Some(AutoReport::Off),
            2 => Some(AutoReport::Genius),
            3 => Some(AutoReport::Rs232),
            _ => None,
        }
    }

    /// The wire code.
    #[must_use]
    pub const fn code(self) -> u8 {
        match self {
            AutoReport::Off => 0,
            AutoReport::Genius => 2,
            AutoReport::Rs232 => 3,
        }
    }
}

/// The settings in force: the body of a `C` reply, and what a recorder keeps over a power cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Configuration {
    /// Entries that the event buffer holds, 1–2048.
    pub size: u16,
    /// Rate of the RS-232 port.
    pub baud: Baud,
    /// Where events are reported.
    pub auto_report: AutoReport,
    /// Genius address that gets the reports, 0–31.
    pub report_address: u8,
    /// Whether every event is printed as a text line on RS-232.
    pub auto_print: bool,
}

/// The configuration as delivered: 2048 entries, 9600 bit/s, nothing automatic.
impl Default for Configuration {
    fn default() -> Self {
        Configuration {
            size: MAX_SIZE,
            baud: Baud::B9600,
            auto_report: AutoReport::Off,
            report_address: 0,
            auto_print: false,
        }
    }
}

/// The parameters of a `C` command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Configure {
    /// Entries that the event buffer is to hold, 1–2048; `None` keeps the size.
    pub size: Option<u16>,
    /// Rate of the RS-232 port from the reply on; `None` keeps the rate.
    pub baud: Option<Baud>,
    /// Where events are to be reported.
    pub auto_report: AutoReport,
    /// Genius address that is to get the reports, 0–31.
    pub report_address: u8,
    /// Whether every event is to be printed as a text line on RS-232.
    pub auto_print: bool,
}

impl Configure {
    /// The settings after this command on top of `current`.
    #[must_use]
    pub fn apply_to(&self, current: &Configuration) -> Configuration {
        Configuration {
            size: self.size.unwrap_or(current.size),
            baud: self.baud.unwrap_or(current.baud),
            auto_report: self.auto_report,
            report_address: self.report_address,
            auto_print: self.auto_print,
        }
    }

    pub(crate) fn parse(params: Bytes<'_>) -> Result<Configure, ParseError> {
        let size = word(|size| match size {
            0 => Some(None),
            1..=MAX_SIZE => Some(Some(size)),
            _ => None,
        });
        let baud = byte(|code| match code {
            0 => Some(None),
            code => Baud::from_code(code).map(Some),
        });
        let fields =
            (
                size,
                baud,
                byte(AutoReport::from_code),
                byte(below(MAX_REPORT_ADDRESS + 1)),
                byte(flag),
            )
                .map(|(size, baud, auto_report, report_address, auto_print)| {
                    Configure { size, baud, auto_report, report_address, auto_print }
                });
        parse_params(Code::Configure, params, Configuration::BODY_LEN - 1, fields)
    }

    pub(crate) fn to_body(self) -> Body {
        let mut body = Body::new(Code::Configure);
        body.put_u16(self.size.unwrap_or(0));
        body.put(&[
            self.baud.map_or(0, Baud::code),
            self.auto_report.code(),
            self.report_address,
            u8::from(self.auto_print),
        ]);
        body
    }
}

/// The command that puts these settings in force.
impl From<Configuration> for Configure {
    fn from(settings: Configuration) -> Configure {
        Configure {
            size: Some(settings.size),
            baud: Some(settings.baud),
            auto_report: settings.auto_report,
            report_address: settings.report_address,
            auto_print: settings.auto_print,
        }
    }
}

impl Configuration {
    /// Bytes of the body, the command byte included.
    pub const BODY_LEN: usize = 7;

    pub(crate) fn parse(params: Bytes<'_>) -> Result<Configuration, ParseError> {
        let parsed = Configure::parse(params)?;
        let bad = |offset| ParseError::BadValue { code: Code::Configure.byte(), offset, value: 0 };
        Ok(Configuration {
            size: parsed.size.ok_or(bad(1))?,
            baud: parsed.baud.ok_or(bad(3))?,
            auto_report: parsed.auto_report,
            report_address: parsed.report_address,
            auto_print: parsed.auto_print,
        })
    }

    pub(crate) fn to_body(self) -> Body {
        Configure::from(self).to_body()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Command, Reply};

    /// The manual's example: 1024 entries, 9600 bit/s, reports over Genius to address 1, no
    /// printing.
    const EXAMPLE: [u8; 7] = [0x43, 0x04, 0x00, 0x06, 0x02, 0x01, 0x00];

    #[test]
    fn the_manuals_example_means_what_the_manual_says() {
        let meaning = Configuration {
            size: 1024,
            baud: Baud::B9600,
            auto_report: AutoReport::Genius,
            report_address: 1,
            auto_print: false,
        };
        assert_eq!(Reply::parse(&EXAMPLE), Ok(Reply::Configuration(meaning)));
        assert_eq!(Command::parse(&EXAMPLE), Ok(Command::Configure(meaning.into())));
        assert_eq!(*Reply::Configuration(meaning).to_body(), EXAMPLE);
    }

    #[test]
    fn every_code_is_the_one_of_the_manuals_tables() {
        let rates = [300, 600, 1200, 2400, 4800, 9600, 19_200];
        for (code, rate) in (1..).zip(rates) {
            let baud = Baud::from_code(code).unwrap();
            assert_eq!((baud.code(), baud.bits_per_second()), (code, rate));
            assert_eq!(Baud::from_bits_per_second(rate), Some(baud));
        }
        assert_eq!((0..=255).filter_map(Baud::from_code).count(), 7);
        let reports = [AutoReport::Off, AutoReport::Off, AutoReport::Genius, AutoReport::Rs232];
        for (code, meaning) in (0..).zip(reports) {
            assert_eq!(AutoReport::from_code(code), Some(meaning));
        }
        assert_eq!((0..=255).filter_map(AutoReport::from_code).count(), 4);
    }

    #[test]
    fn zero_keeps_size_and_rate_in_a_command_and_is_no_answer() {
        let keep = [0x43, 0, 0, 0, 3, 0, 1];
        let Ok(Command::Configure(command)) = Command::parse(&keep) else {
            panic!("not a command")
        };
        assert_eq!((command.size, command.baud), (None, None));
        let before = Configuration { size: 7, baud: Baud::B300, ..Configuration::default() };
        let after = command.apply_to(&before);
        assert_eq!((after.size, after.baud, after.auto_report), (7, Baud::B300, AutoReport::Rs232));
        assert_eq!(
            Reply::parse(&keep),
            Err(ParseError::BadValue { code: 0x43, offset: 1, value: 0 })
        );
    }

    #[test]
    fn a_bad_field_is_named_by_offset_and_value() {
        let bad = [
            (1, [0x43, 0x08, 0x01, 6, 2, 1, 0], 2049),
            (3, [0x43, 0x04, 0x00, 8, 2, 1, 0], 8),
            (4, [0x43, 0x04, 0x00, 6, 4, 1, 0], 4),
            (5, [0x43, 0x04, 0x00, 6, 2, 32, 0], 32),
            (6, [0x43, 0x04, 0x00, 6, 2, 1, 2], 2),
        ];
        for (offset, body, value) in bad {
            assert_eq!(
                Command::parse(&body),
                Err(ParseError::BadValue { code: 0x43, offset, value })
            );
        }
    }
}
