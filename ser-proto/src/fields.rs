//! Fields of a message, parsed with nom behind our own errors.
//!
//! A layout of the manual has one length. It is checked before any field, so a message of a wrong
//! length is never mistaken for one with a bad value. A reply of our extension may be longer than
//! what is known of it; its fields are taken from the front, and the first fault found there counts.

use nom::Parser;
use nom::error::{ErrorKind, FromExternalError, ParseError as NomParseError};

pub(crate) type Bytes<'a> = &'a [u8];

/// What nom passes up: how many bytes were left where parsing stopped, and the value refused there.
#[derive(Debug)]
pub(crate) struct Fault {
    remaining: usize,
    value: Option<u16>,
}

impl NomParseError<Bytes<'_>> for Fault {
    fn from_error_kind(input: Bytes<'_>, _: ErrorKind) -> Fault {
        Fault { remaining: input.len(), value: None }
    }

    fn append(_: Bytes<'_>, _: ErrorKind, other: Fault) -> Fault {
        other
    }
}

impl FromExternalError<Bytes<'_>, u16> for Fault {
    fn from_external_error(input: Bytes<'_>, _: ErrorKind, value: u16) -> Fault {
        Fault { remaining: input.len(), value: Some(value) }
    }
}

/// Why bytes do not fit their layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Refusal {
    /// The layout never has this many bytes.
    Length,
    /// A field holds a value that is not allowed.
    Value {
        /// Where the field starts.
        offset: usize,
        /// What it holds.
        value: u16,
    },
}

/// Parses `bytes`, which must be `expected_len` bytes.
pub(crate) fn parse_exactly<'a, T>(
    bytes: Bytes<'a>,
    expected_len: usize,
    parser: impl Parser<Bytes<'a>, Output = T, Error = Fault>,
) -> Result<T, Refusal> {
    if bytes.len() != expected_len {
        return Err(Refusal::Length);
    }
    // `finish()` would be shorter, but it panics on `Incomplete`, which these parsers never return.
    match nom::combinator::all_consuming(parser).parse(bytes) {
        Ok((_, fields)) => Ok(fields),
        Err(nom::Err::Error(Fault { remaining, value: Some(value) })) => {
            Err(Refusal::Value { offset: bytes.len() - remaining, value })
        }
        Err(_) => Err(Refusal::Length),
    }
}

/// The first fault among the fields at the front of some bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FrontFault {
    /// Where the field starts.
    pub(crate) offset: usize,
    /// What it holds and may not hold; `None` when the bytes end before the field does.
    pub(crate) value: Option<u16>,
}

/// Parses the fields at the front of `bytes`, whatever stands behind them.
pub(crate) fn parse_front<'a, T>(
    bytes: Bytes<'a>,
    mut parser: impl Parser<Bytes<'a>, Output = T, Error = Fault>,
) -> Result<T, FrontFault> {
    match parser.parse(bytes) {
        Ok((_, fields)) => Ok(fields),
        Err(nom::Err::Error(Fault { remaining, value })) => {
            Err(FrontFault { offset: bytes.len().saturating_sub(remaining), value })
        }
        // These parsers return neither.
        Err(nom::Err::Failure(_) | nom::Err::Incomplete(_)) => {
            Err(FrontFault { offset: bytes.len(), value: None })
        }
    }
}

/// A one-byte field; `accept` turns it into its meaning or refuses it.
pub(crate) fn byte<'a, T>(
    accept: impl Fn(u8) -> Option<T>,
) -> impl Parser<Bytes<'a>, Output = T, Error = Fault> {
    nom::combinator::map_res(nom::number::complete::be_u8, move |value| {
        accept(value).ok_or(u16::from(value))
    })
}

/// A two-byte field, high byte first; `accept` turns it into its meaning or refuses it.
pub(crate) fn word<'a, T>(
    accept: impl Fn(u16) -> Option<T>,
) -> impl Parser<Bytes<'a>, Output = T, Error = Fault> {
    nom::combinator::map_res(nom::number::complete::be_u16, move |value| accept(value).ok_or(value))
}

/// A flag byte: 0 or 1.
pub(crate) fn flag(value: u8) -> Option<bool> {
    match value {
        0 => Some(false),
        1 => Some(true),
        _ => None,
    }
}

/// Accepts `value` when it is below `limit`.
pub(crate) fn below<T: PartialOrd>(limit: T) -> impl Fn(T) -> Option<T> {
    move |value| (value < limit).then_some(value)
}
