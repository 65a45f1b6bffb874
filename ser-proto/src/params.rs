//! The parameter bytes of a body, parsed with nom behind our own errors.
//!
//! The length is checked before any field, so a body of a wrong length is never mistaken for one with a bad value.

use nom::Parser;
use nom::error::{ErrorKind, FromExternalError, ParseError as NomParseError};

use crate::{Code, ParseError};

pub(crate) type Bytes<'a> = &'a [u8];

/// What nom hands up: how many bytes were left where parsing stopped, and the value that was refused there.
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

/// Parses `params`, the bytes after the command byte, which must be `expected_len` bytes.
pub(crate) fn parse_params<'a, T>(
    code: Code,
    params: Bytes<'a>,
    expected_len: usize,
    parser: impl Parser<Bytes<'a>, Output = T, Error = Fault>,
) -> Result<T, ParseError> {
    let length = params.len() + 1;
    if params.len() != expected_len {
        return Err(ParseError::WrongLength { code: code.byte(), length });
    }
    // `finish()` would do, but it panics on `Incomplete`, which these parsers never return.
    match nom::combinator::all_consuming(parser).parse(params) {
        Ok((_, message)) => Ok(message),
        Err(nom::Err::Error(Fault { remaining, value: Some(value) })) => {
            Err(ParseError::BadValue { code: code.byte(), offset: length - remaining, value })
        }
        Err(_) => Err(ParseError::WrongLength { code: code.byte(), length }),
    }
}

/// A one-byte field that `accept` turns into its meaning, or refuses.
pub(crate) fn byte<'a, T>(
    accept: impl Fn(u8) -> Option<T>,
) -> impl Parser<Bytes<'a>, Output = T, Error = Fault> {
    nom::combinator::map_res(nom::number::complete::be_u8, move |value| accept(value).ok_or(u16::from(value)))
}

/// A two-byte field, high byte first, that `accept` turns into its meaning, or refuses.
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
