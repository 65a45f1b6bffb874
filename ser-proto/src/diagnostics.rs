//! The counters of a recorder, command `D` of our extension.
//!
//! ```text
//! | 44 | first id |                                      1 or 2 bytes; without an id or with 0: from 1
//! | 44 | first id | next id | count | count values (4) … |    the reply
//! ```
//! The values are those of the first counter and of the ids that follow it without a gap. The next
//! id is where to ask on: behind the page, or behind ids that the recorder does not have; 0 at the
//! end. Nothing resets a counter but a power-up. A host subtracts what it has seen before.

use core::num::NonZeroU8;

use heapless::Vec;
use nom::Parser;
use nom::number::complete::be_u32;

use crate::counter::Counter;
use crate::fields::{Bytes, Fault, byte};
use crate::genius::MAX_SER_DATA;
use crate::params::parse_growing;
use crate::{Body, Code, Command, ParseError};

/// Bytes before the values, the command byte included.
const HEADER_LEN: usize = 4;

/// The most counters that one reply carries.
pub const MAX_COUNTERS: usize = (MAX_SER_DATA - HEADER_LEN) / 4;

/// The reply to `D`: counters whose ids follow one another.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Counters {
    /// The first counter: the one that was asked for, or the first one behind it that there is.
    /// Without values, the one that was asked for.
    pub first: Counter,
    /// The counter to ask for next, behind those that are here; `None` at the end.
    pub next: Option<Counter>,
    /// The values of the first counter and of those behind it.
    pub values: Vec<u32, MAX_COUNTERS>,
}

impl Counters {
    /// The counters and their values.
    pub fn counters(&self) -> impl Iterator<Item = (Counter, u32)> {
        (self.first.id().get()..=u8::MAX)
            .filter_map(NonZeroU8::new)
            .map(Counter::from_id)
            .zip(self.values.iter().copied())
    }

    pub(crate) fn parse(params: Bytes<'_>) -> Result<Counters, ParseError> {
        parse_growing(Code::Diagnostics, params, fields)
    }

    pub(crate) fn to_body(&self) -> Body {
        let mut body = Body::new(Code::Diagnostics);
        body.put(&[
            self.first.id().get(),
            self.next.map_or(0, |next| next.id().get()),
            u8::try_from(self.values.len()).unwrap_or(u8::MAX),
        ]);
        for &value in &self.values {
            body.put_u32(value);
        }
        body
    }
}

fn fields(params: Bytes<'_>) -> nom::IResult<Bytes<'_>, Counters, Fault> {
    let (params, first) = byte(NonZeroU8::new).parse(params)?;
    // A host that asks on comes to an end, because the next id is always higher.
    let is_behind = |next: u8| next == 0 || next > first.get();
    let (params, next) = byte(|next| is_behind(next).then_some(next)).parse(params)?;
    // The highest id here is below the next one, and no higher than ids go.
    let room =
        if next == 0 { 256 - usize::from(first.get()) } else { usize::from(next - first.get()) };
    let fits = |count: u8| usize::from(count) <= MAX_COUNTERS.min(room);
    let (mut rest, count) = byte(|count| fits(count).then_some(count)).parse(params)?;
    let mut values = Vec::new();
    for _ in 0..count {
        let (behind, value) = be_u32(rest)?;
        rest = behind;
        // The count was checked, so there is room.
        let _ = values.push(value);
    }
    let (first, next) = (Counter::from_id(first), NonZeroU8::new(next).map(Counter::from_id));
    Ok((rest, Counters { first, next, values }))
}

/// A `D` of a host.
pub(crate) fn parse_question(params: Bytes<'_>) -> Result<Command, ParseError> {
    match *params {
        [] => Ok(Command::Diagnostics { first: Counter::FIRST }),
        [id] => Ok(Command::Diagnostics {
            first: NonZeroU8::new(id).map_or(Counter::FIRST, Counter::from_id),
        }),
        _ => Err(ParseError::WrongLength {
            code: Code::Diagnostics.byte(),
            length: params.len() + 1,
        }),
    }
}
