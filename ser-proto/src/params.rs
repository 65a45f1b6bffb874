//! The parameter bytes of a body, which follow its command byte.

use nom::Parser;

use crate::fields::{Bytes, Fault, Refusal, parse_exactly};
use crate::{Code, ParseError};

/// Parses `params`, the bytes after the command byte, of which there must be `expected_len`.
pub(crate) fn parse_params<'a, T>(
    code: Code,
    params: Bytes<'a>,
    expected_len: usize,
    parser: impl Parser<Bytes<'a>, Output = T, Error = Fault>,
) -> Result<T, ParseError> {
    parse_exactly(params, expected_len, parser).map_err(|refusal| match refusal {
        Refusal::Length => ParseError::WrongLength { code: code.byte(), length: params.len() + 1 },
        Refusal::Value { offset, value } => {
            ParseError::BadValue { code: code.byte(), offset: offset + 1, value }
        }
    })
}
