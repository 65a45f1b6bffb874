//! Which bodies are messages of our extension, by the tables of `docs/protocol.md`.
//!
//! Commands have one length or a few, as those of the manual. A reply is read field by field from
//! the front, and the first fault counts: a value that cannot be, or the end of the body. What
//! stands behind the known fields is ignored.

use ser_proto::ParseError;

use super::body_rules::Fault;

/// Whether a body has a command byte of the extension.
pub(super) fn is_ours(body: &[u8]) -> bool {
    body.first().is_some_and(|code| b"ITFD".contains(code))
}

/// Whether a command may have this many bytes.
pub(super) fn command_has_length(code: u8, length: usize) -> bool {
    match code {
        b'I' => length == 1,
        b'T' => [1, 3].contains(&length),
        b'F' => [1, 2, 8].contains(&length),
        b'D' => [1, 2].contains(&length),
        _ => false,
    }
}

/// The first value that a command cannot have. Its length is right.
pub(super) fn command_fault(body: &[u8]) -> Fault {
    let &[b'F', input, _, changes, w1, w0, r1, r0] = body else { return None };
    let (window, rearm) = (u16::from_be_bytes([w1, w0]), u16::from_be_bytes([r1, r0]));
    let seconds_begun = u32::from(window).div_ceil(1000);
    if input > 32 {
        Some((1, input.into()))
    } else if changes == 0 {
        None
    } else if changes > 32 {
        Some((3, changes.into()))
    } else if !(1..=7000).contains(&window) {
        Some((4, window))
    } else if u32::from(changes) <= 4 * seconds_begun {
        Some((3, changes.into()))
    } else {
        (rearm < window).then_some((6, rearm))
    }
}

/// The form in which we send a command.
pub(super) fn canonical_command(body: &[u8]) -> Vec<u8> {
    match *body {
        [b'T'] => vec![b'T', 0, 0],
        [b'F'] | [b'F', 0] => vec![b'F', 1],
        [b'D'] | [b'D', 0] => vec![b'D', 1],
        [b'F', input, debounce, 0, ..] => vec![b'F', input, debounce, 0, 0, 0, 0, 0],
        _ => body.to_vec(),
    }
}

/// Walks through the fields of a reply.
struct Walk<'a> {
    body: &'a [u8],
    at: usize,
}

impl Walk<'_> {
    /// Steps over a field of so many bytes and gives its value, if it fits 16 bits.
    fn field(&mut self, width: usize) -> Result<u16, ParseError> {
        let short = ParseError::TooShort {
            code: self.body[0],
            offset: u16::try_from(self.at).expect("a body is short"),
            length: self.body.len(),
        };
        let bytes = self.body.get(self.at..self.at + width).ok_or(short)?;
        self.at += width;
        Ok(bytes.iter().fold(0, |value, &byte| value << 8 | u16::from(byte)))
    }

    /// As [`field`](Self::field), for values that `may_be`.
    fn checked(&mut self, width: usize, may_be: impl Fn(u16) -> bool) -> Result<u16, ParseError> {
        let offset = self.at;
        let value = self.field(width)?;
        match may_be(value) {
            true => Ok(value),
            false => Err(ParseError::BadValue { code: self.body[0], offset, value }),
        }
    }

    fn fields(&mut self, widths: &[usize]) -> Result<(), ParseError> {
        widths.iter().try_for_each(|&width| self.field(width).map(drop))
    }
}

/// The bytes of a reply up to the end of what is known of it.
///
/// # Errors
/// The first fault.
pub(super) fn known_part(body: &[u8]) -> Result<&[u8], ParseError> {
    let mut walk = Walk { body, at: 1 };
    match body[0] {
        b'I' => {
            walk.checked(1, |level| level > 0)?;
            walk.checked(1, |inputs| inputs == 16 || inputs == 32)?;
            walk.fields(&[1, 1, 1, 4, 12, 4, 4])?;
            walk.checked(2, |size| (1..=2048).contains(&size))?;
            walk.field(1)?;
        }
        b'T' => walk.fields(&[2, 8, 1, 4, 4, 4, 8, 4, 8, 2, 8])?,
        b'F' => {
            let first = walk.checked(1, |first| first > 0)?;
            let count =
                walk.checked(1, |count| count == 0 || (count <= 20 && first + count <= 33))?;
            (0..count).try_for_each(|_| walk.fields(&[1, 1, 2, 2]))?;
        }
        b'D' => {
            let first = walk.checked(1, |first| first > 0)?;
            let next = walk.checked(1, |next| next == 0 || next > first)?;
            let end = if next == 0 { 256 } else { next };
            let count = walk.checked(1, |count| count <= 31 && first + count <= end)?;
            (0..count).try_for_each(|_| walk.field(4).map(drop))?;
        }
        code => panic!("{code:02X}h is none of ours"),
    }
    Ok(&body[..walk.at])
}

/// The form in which we send a reply without a fault.
pub(super) fn canonical_reply(known: &[u8]) -> Vec<u8> {
    const NO_MARK: [u8; 8] = [0x80, 0, 0, 0, 0, 0, 0, 0];
    let mut body = known.to_vec();
    match body[0] {
        b'T' if body[46..] == NO_MARK => body[44..46].fill(0),
        b'F' => {
            let filters = body[3..].chunks_exact_mut(6);
            filters.filter(|filter| filter[1] == 0).for_each(|off| off[2..].fill(0));
        }
        _ => {}
    }
    body
}
