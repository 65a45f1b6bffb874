//! Which bodies are messages, by the tables of `docs/protocol.md`. This is the second opinion on
//! what the parsers say.

use chrono::NaiveDate;
use ser_proto::{FrameEncoder, ParseError};

use super::framing::frame_of;

/// The first field with a value that it cannot have: where the field starts, and the value.
pub(super) type Fault = Option<(usize, u16)>;

/// What a table says about the bodies of one direction.
pub(super) struct Rules {
    /// Whether a body with this command byte may have this many bytes.
    pub(super) has_length: fn(code: u8, length: usize) -> bool,
    /// The first field out of range, in a body whose length is right.
    pub(super) fault: fn(body: &[u8]) -> Fault,
}

impl Rules {
    /// Checks that a body is taken for a message if it is one, and otherwise refused with the right
    /// error.
    pub(super) fn assert_agree<T: std::fmt::Debug>(
        &self,
        body: &[u8],
        parsed: &Result<T, ParseError>,
    ) {
        if let Err(error) = parsed {
            assert!(!error.to_string().is_empty());
        }
        let Some(&code) = body.first() else {
            assert!(matches!(parsed, Err(ParseError::Empty)), "{parsed:?}");
            return;
        };
        let length = body.len();
        if !b"CELMPRSITFD".contains(&code) {
            assert!(
                matches!(parsed, Err(ParseError::UnknownCode { code: found }) if *found == code),
                "{parsed:?}"
            );
        } else if !(self.has_length)(code, length) {
            let expected = ParseError::WrongLength { code, length };
            assert!(
                matches!(parsed, Err(error) if *error == expected),
                "{parsed:?}, not {expected:?}"
            );
        } else if let Some((offset, value)) = (self.fault)(body) {
            let expected = ParseError::BadValue { code, offset, value };
            assert!(
                matches!(parsed, Err(error) if *error == expected),
                "{parsed:?}, not {expected:?}"
            );
        } else if let Some(expected) = entry_size(self, body) {
            assert!(
                matches!(parsed, Err(error) if *error == expected),
                "{parsed:?}, not {expected:?}"
            );
        } else {
            assert!(parsed.is_ok(), "{parsed:?}");
        }
    }
}

/// The error of entries whose size is that of no model. They occur in read replies, the only bodies
/// of `R` that may be longer than a command.
fn entry_size(rules: &Rules, body: &[u8]) -> Option<ParseError> {
    if body[0] != b'R' || !(rules.has_length)(b'R', 9) {
        return None;
    }
    let (count, bytes) = (body[3], body.len() - 8);
    let fits = [12, 16].iter().any(|entry_len| usize::from(count) * entry_len == bytes);
    (!fits).then_some(ParseError::EntrySize { count, bytes })
}

/// A number of two bytes.
pub(super) fn word(body: &[u8], offset: usize) -> u16 {
    u16::from_be_bytes([body[offset], body[offset + 1]])
}

/// The first byte, from `offset` on, that is above its limit.
pub(super) fn above(body: &[u8], offset: usize, limits: &[u8]) -> Fault {
    let mut fields = (offset..).zip(limits);
    fields.find(|&(at, &limit)| body[at] > limit).map(|(at, _)| (at, body[at].into()))
}

/// The first wrong field in the settings of a configuration, in both directions.
pub(super) fn settings_fault(body: &[u8]) -> Fault {
    let size = word(body, 1);
    if size > 2048 { Some((1, size)) } else { above(body, 3, &[7, 3, 31, 1]) }
}

/// The first wrong field in a date and time from `offset` on.
pub(super) fn time_fault(body: &[u8], offset: usize) -> Fault {
    let [year, month, day] = [body[offset], body[offset + 1], body[offset + 2]];
    if year > 99 {
        return Some((offset, year.into()));
    }
    if !(1..=12).contains(&month) {
        return Some((offset + 1, month.into()));
    }
    let full_year = if year < 70 { 2000 } else { 1900 } + i32::from(year);
    if NaiveDate::from_ymd_opt(full_year, month.into(), day.into()).is_none() {
        return Some((offset + 2, day.into()));
    }
    let millisecond = word(body, offset + 6);
    above(body, offset + 3, &[23, 59, 59])
        .or((millisecond > 999).then_some((offset + 6, millisecond)))
}

/// Checks that what is sent is canonical, and that its frame is as the protocol says.
pub(super) fn assert_emitted(emitted: ser_proto::Body, canonical: &[u8]) {
    assert_eq!(*emitted, *canonical);
    assert_eq!(FrameEncoder::new(emitted).collect::<Vec<u8>>(), frame_of(canonical));
}
