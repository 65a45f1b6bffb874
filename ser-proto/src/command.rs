//! What a host says to a recorder.

use core::num::NonZeroU8;

use nom::Parser;
use nom::number::complete::{be_u8, be_u16};

use crate::fields::{byte, flag};
use crate::params::parse_params;
use crate::read_reply::parse_request;
use crate::{
    Body, Code, Configure, Counter, InputFilter, ParseError, TimeStamp, clock_reading, diagnostics,
    filters,
};

/// A message to the recorder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Command {
    /// `C` alone: asks for the configuration in force. An extension of this project; original
    /// recorders do not answer it.
    QueryConfiguration,
    /// `C`: change the configuration.
    Configure(Configure),
    /// `E`: erase the event buffer.
    Erase,
    /// `L`: asks for the last broadcast.
    LastBroadcast,
    /// `M` alone: asks whether the recorder is recording. An extension of this project; original
    /// recorders do not answer it.
    QueryMode,
    /// `M`: start or stop recording.
    SetMode {
        /// Whether to record.
        recording: bool,
    },
    /// `P`: print entries as text lines on RS-232.
    Print {
        /// Number of the first entry, from 1.
        start: u16,
        /// How many entries.
        count: u16,
    },
    /// `R`: read entries. With count 0 the reply is the header alone.
    Read {
        /// Number of the first entry, from 1.
        start: u16,
        /// How many entries, 1–10.
        count: u8,
    },
    /// `S`: set the clock. The time is that of the arrival of the message's last byte.
    SetClock(TimeStamp),
    /// `I`: asks what the recorder is and can do. This and all that follow are our extension.
    Identify,
    /// `T`: asks what the clock shows. As a broadcast it is a mark, which is not answered.
    Time {
        /// Comes back with the reply, or stays with the mark.
        token: u16,
    },
    /// `F`: asks for the filters of the inputs.
    QueryFilters {
        /// The first input, from 1.
        first: NonZeroU8,
    },
    /// `F`: set the filter of an input. The reply gives the filters in force from this input on.
    SetFilter {
        /// The input, 1–32; `None` for all.
        input: Option<NonZeroU8>,
        /// Its filter.
        filter: InputFilter,
    },
    /// `D`: asks for the counters.
    Diagnostics {
        /// The first counter.
        first: Counter,
    },
}

impl Command {
    /// Parses a body that came from a host.
    ///
    /// # Errors
    /// See [`ParseError`]. Start and count of `R` and `P` are never refused here: a recorder
    /// answers with what exists. A date that does not exist is refused, and so is a filter that
    /// cannot be set.
    pub fn parse(body: &[u8]) -> Result<Command, ParseError> {
        let (&byte, params) = body.split_first().ok_or(ParseError::Empty)?;
        let code = Code::from_byte(byte).ok_or(ParseError::UnknownCode { code: byte })?;
        match (code, params.len()) {
            (Code::Configure, 0) => Ok(Command::QueryConfiguration),
            (Code::Configure, _) => Configure::parse(params).map(Command::Configure),
            (Code::Erase, 0) => Ok(Command::Erase),
            (Code::LastBroadcast, 0) => Ok(Command::LastBroadcast),
            (Code::Mode, 0) => Ok(Command::QueryMode),
            (Code::Mode, _) => parse_set_mode(params),
            (Code::Print, _) => parse_print(params),
            (Code::Read, _) => {
                parse_request(params).map(|(start, count)| Command::Read { start, count })
            }
            (Code::SetClock, _) => parse_set_clock(params),
            (Code::Identify, 0) => Ok(Command::Identify),
            (Code::Time, _) => clock_reading::parse_question(params),
            (Code::Filters, _) => filters::parse_command(params),
            (Code::Diagnostics, _) => diagnostics::parse_question(params),
            (Code::Erase | Code::LastBroadcast | Code::Identify, _) => {
                Err(ParseError::WrongLength { code: byte, length: body.len() })
            }
        }
    }

    /// The bytes of the message.
    #[must_use]
    pub fn to_body(&self) -> Body {
        let mut body = Body::new(self.code());
        match *self {
            Command::QueryConfiguration
            | Command::QueryMode
            | Command::Erase
            | Command::LastBroadcast
            | Command::Identify => {}
            Command::Configure(configure) => return configure.to_body(),
            // The version byte has no meaning in this direction; the manual's example sends one.
            Command::SetMode { recording } => body.put(&[u8::from(recording), 0]),
            // The manual has only the short form; the long form reaches entries above 255.
            Command::Print { start, count } => match (u8::try_from(start), u8::try_from(count)) {
                (Ok(start), Ok(count)) => body.put(&[start, count]),
                _ => {
                    body.put_u16(start);
                    body.put_u16(count);
                }
            },
            Command::Read { start, count } => {
                body.put_u16(start);
                body.put(&[count]);
            }
            Command::SetClock(time) => time.put_on(&mut body),
            Command::Time { token } => body.put_u16(token),
            Command::QueryFilters { first } => body.put(&[first.get()]),
            Command::SetFilter { input, filter } => {
                body.put(&[input.map_or(0, NonZeroU8::get)]);
                filter.put_on(&mut body);
            }
            Command::Diagnostics { first } => body.put(&[first.id().get()]),
        }
        body
    }

    /// The command byte.
    #[must_use]
    pub const fn code(&self) -> Code {
        match self {
            Command::QueryConfiguration | Command::Configure(_) => Code::Configure,
            Command::Erase => Code::Erase,
            Command::LastBroadcast => Code::LastBroadcast,
            Command::QueryMode | Command::SetMode { .. } => Code::Mode,
            Command::Print { .. } => Code::Print,
            Command::Read { .. } => Code::Read,
            Command::SetClock(_) => Code::SetClock,
            Command::Identify => Code::Identify,
            Command::Time { .. } => Code::Time,
            Command::QueryFilters { .. } | Command::SetFilter { .. } => Code::Filters,
            Command::Diagnostics { .. } => Code::Diagnostics,
        }
    }
}

fn parse_set_mode(params: &[u8]) -> Result<Command, ParseError> {
    // A host's version byte means nothing and may be missing.
    let params = match params {
        [mode, _version] => core::slice::from_ref(mode),
        other => other,
    };
    parse_params(Code::Mode, params, 1, byte(flag)).map(|recording| Command::SetMode { recording })
}

fn parse_print(params: &[u8]) -> Result<Command, ParseError> {
    let (start, count) = match params.len() {
        2 => parse_params(Code::Print, params, 2, (be_u8.map(u16::from), be_u8.map(u16::from)))?,
        _ => parse_params(Code::Print, params, 4, (be_u16, be_u16))?,
    };
    Ok(Command::Print { start, count })
}

fn parse_set_clock(params: &[u8]) -> Result<Command, ParseError> {
    let time = parse_params(Code::SetClock, params, TimeStamp::LEN, TimeStamp::parser())?;
    time.check().map_err(|invalid| ParseError::BadValue {
        code: Code::SetClock.byte(),
        offset: 1 + invalid.offset,
        value: invalid.value,
    })?;
    Ok(Command::SetClock(time))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_version_byte_of_mode_is_ignored_and_may_be_absent() {
        for body in [&[0x4D, 1, 0x7D][..], &[0x4D, 1, 0], &[0x4D, 1]] {
            assert_eq!(Command::parse(body), Ok(Command::SetMode { recording: true }));
        }
        assert_eq!(Command::parse(&[0x4D]), Ok(Command::QueryMode));
        assert_eq!(
            Command::parse(&[0x4D, 2, 0]),
            Err(ParseError::BadValue { code: 0x4D, offset: 1, value: 2 })
        );
    }

    #[test]
    fn print_is_short_up_to_255_and_long_above() {
        assert_eq!(*Command::Print { start: 50, count: 100 }.to_body(), [0x50, 0x32, 0x64]);
        assert_eq!(*Command::Print { start: 1, count: 2048 }.to_body(), [0x50, 0, 1, 8, 0]);
        assert_eq!(Command::parse(&[0x50, 0, 1, 0, 2]), Ok(Command::Print { start: 1, count: 2 }));
    }

    #[test]
    fn every_wrong_length_of_every_command_is_refused() {
        let allowed: [(Code, &[usize]); 11] = [
            (Code::Configure, &[1, 7]),
            (Code::Erase, &[1]),
            (Code::LastBroadcast, &[1]),
            (Code::Mode, &[1, 2, 3]),
            (Code::Print, &[3, 5]),
            (Code::Read, &[4]),
            (Code::SetClock, &[9]),
            (Code::Identify, &[1]),
            (Code::Time, &[1, 3]),
            (Code::Filters, &[1, 2, 8]),
            (Code::Diagnostics, &[1, 2]),
        ];
        for (code, lengths) in allowed {
            // The lengths are tried with values that are right and with values that no field can
            // have.
            for (length, filling) in (1..=255).flat_map(|length| [(length, 0), (length, 0xFF)]) {
                let mut body = vec![filling; length];
                body[0] = code.byte();
                let refused = Command::parse(&body)
                    == Err(ParseError::WrongLength { code: code.byte(), length });
                assert_eq!(
                    refused,
                    !lengths.contains(&length),
                    "{code:?} with {length} bytes {filling:02X}h"
                );
            }
        }
    }

    #[test]
    fn an_unknown_code_is_named() {
        assert_eq!(Command::parse(&[]), Err(ParseError::Empty));
        assert_eq!(Command::parse(&[0x58, 1]), Err(ParseError::UnknownCode { code: 0x58 }));
    }

    #[test]
    fn an_impossible_date_is_refused_at_its_offset() {
        let leap_day_of_2025 = [0x53, 25, 2, 29, 0, 0, 0, 0, 0];
        assert_eq!(
            Command::parse(&leap_day_of_2025),
            Err(ParseError::BadValue { code: 0x53, offset: 3, value: 29 })
        );
    }
}
