//! The parameter bytes of a body, which follow its command byte.

use nom::Parser;

use crate::fields::{Bytes, Fault, FrontFault, Refusal, parse_exactly, parse_front};
use crate::{Code, ParseError};

/// Parses `params`, the bytes after the command byte, of which there must be `expected_len`.
pub(crate) fn parse_params<'a, T>(
    code: Code,
    params: Bytes<'a>,
    expected_len: usize,
    parser: impl Parser<Bytes<'a>, Output = T, Error = Fault>,
) -> Result<T, ParseError> {
    let byte = code.byte();
    parse_exactly(params, expected_len, parser).map_err(|refusal| match refusal {
        Refusal::Length => ParseError::WrongLength { code: byte, length: params.len() + 1 },
        Refusal::Value { offset, value } => {
            ParseError::BadValue { code: byte, offset: offset + 1, value }
        }
    })
}

/// Parses the fields at the front of `params`, the bytes after the command byte of a reply that may
/// have grown: bytes behind the fields that are known here are those of a later recorder, and are
/// ignored.
pub(crate) fn parse_growing<'a, T>(
    code: Code,
    params: Bytes<'a>,
    parser: impl Parser<Bytes<'a>, Output = T, Error = Fault>,
) -> Result<T, ParseError> {
    let (code, length) = (code.byte(), params.len() + 1);
    parse_front(params, parser).map_err(|FrontFault { offset, value }| match value {
        Some(value) => ParseError::BadValue { code, offset: offset + 1, value },
        None => {
            let offset = u16::try_from(offset + 1).unwrap_or(u16::MAX);
            ParseError::TooShort { code, offset, length }
        }
    })
}
