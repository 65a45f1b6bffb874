//! Read reply, the answer to `R` (manual, table "Read Reply").
//!
//! ```text
//! | 52 | start (2) | count | total (2) | next slot (2) | count entries … |
//! ```

use heapless::Vec;
use nom::number::complete::{be_u8, be_u16};

use crate::fields::{Bytes, below, byte, word};
use crate::params::parse_params;
use crate::{Body, Code, Entry, MAX_SIZE, Model, ParseError};

/// The most entries that one reply carries.
pub const MAX_ENTRIES: usize = 10;

/// Bytes before the entries, the command byte included.
pub const READ_REPLY_HEADER_LEN: usize = 8;

/// Entries of the log, and where the log stands.
///
/// Entry `n` is slot `n - 1` of the ring. From `total` and `next_slot` a host works out what it has
/// not yet read, even after the ring or the 16-bit total has wrapped.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ReadReply {
    /// Number of the first entry, 1–2048; without entries, the number that was asked for.
    pub start: u16,
    /// Events since the last erase, modulo 65536.
    pub total: u16,
    /// The slot that the next event will get, 0–2047.
    pub next_slot: u16,
    /// The model, as the entry size shows it; `None` without entries.
    pub model: Option<Model>,
    /// The entries, in slot order.
    pub entries: Vec<Entry, MAX_ENTRIES>,
}

impl ReadReply {
    pub(crate) fn parse(params: Bytes<'_>) -> Result<ReadReply, ParseError> {
        let (header, entries) = params
            .split_at_checked(READ_REPLY_HEADER_LEN - 1)
            .ok_or(ParseError::WrongLength { code: Code::Read.byte(), length: params.len() + 1 })?;
        let count = byte(|count| (usize::from(count) <= MAX_ENTRIES).then_some(count));
        let (start, count, total, next_slot) = parse_params(
            Code::Read,
            header,
            READ_REPLY_HEADER_LEN - 1,
            (be_u16, count, be_u16, word(below(MAX_SIZE))),
        )?;
        let model = model_of(count, entries.len())?;
        let entries = match model {
            Some(model) => parse_entries(model, count, entries)?,
            None => Vec::new(),
        };
        Ok(ReadReply { start, total, next_slot, model, entries })
    }

    pub(crate) fn to_body(&self) -> Body {
        let mut body = Body::new(Code::Read);
        // Without a model the width of an entry is unknown; a reply with entries always has a
        // model.
        let entries = self.model.map_or(&[][..], |_| &self.entries[..]);
        body.put_u16(self.start);
        body.put(&[u8::try_from(entries.len()).unwrap_or(u8::MAX)]);
        body.put_u16(self.total);
        body.put_u16(self.next_slot);
        for (entry, model) in entries.iter().zip(core::iter::repeat(self.model).flatten()) {
            entry.put_on(&mut body, model);
        }
        body
    }
}

fn model_of(count: u8, bytes: usize) -> Result<Option<Model>, ParseError> {
    let expected = |model: Model| usize::from(count) * model.entry_len();
    if count == 0 && bytes == 0 {
        return Ok(None);
    }
    [Model::Ser160, Model::Ser320]
        .into_iter()
        .find(|&model| count > 0 && expected(model) == bytes)
        .map(Some)
        .ok_or(ParseError::EntrySize { count, bytes })
}

fn parse_entries(
    model: Model,
    count: u8,
    bytes: Bytes<'_>,
) -> Result<Vec<Entry, MAX_ENTRIES>, ParseError> {
    let mut entries = Vec::new();
    for entry in bytes.chunks_exact(model.entry_len()) {
        let entry = parse_params(Code::Read, entry, model.entry_len(), Entry::parser(model))?;
        entries.push(entry).map_err(|_| ParseError::EntrySize { count, bytes: bytes.len() })?;
    }
    Ok(entries)
}

/// The start and count of an `R` command as they came, not checked against any log.
pub(crate) fn parse_request(params: Bytes<'_>) -> Result<(u16, u8), ParseError> {
    parse_params(Code::Read, params, 3, (be_u16, be_u8))
}
