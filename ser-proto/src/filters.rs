//! The filters of the inputs, command `F` of our extension.
//!
//! ```text
//! | 46 | first input |                 1 or 2 bytes, a question; without an input or with 0: from 1
//! | 46 | input | filter (6) |          8 bytes, a setting; input 0: all
//! | 46 | first input | count | count filters (6) … |    the reply to both: what is in force
//! ```
//! A reply carries as many inputs as a datagram has room for, on either port. A host asks on behind
//! them until it has all inputs of the model.

use core::num::NonZeroU8;

use heapless::Vec;
use nom::Parser;

use crate::fields::{Bytes, Fault, below, byte};
use crate::genius::MAX_SER_DATA;
use crate::input_filter::InputFilter;
use crate::params::{parse_growing, parse_params};
use crate::{Body, Code, Command, Model, ParseError};

/// Bytes before the filters, the command byte included.
const HEADER_LEN: usize = 3;

/// The most inputs whose filters one reply carries.
pub const MAX_FILTERS: usize = (MAX_SER_DATA - HEADER_LEN) / InputFilter::LEN;

/// The last input that a recorder can have.
const LAST_INPUT: u8 = Model::Ser320.inputs();

/// The reply to `F`: the filters in force at some inputs that follow one another.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Filters {
    /// The first input; without filters, the one that was asked for.
    pub first: NonZeroU8,
    /// The filters of this input and of those behind it, which end with input 32 at the latest.
    pub filters: Vec<InputFilter, MAX_FILTERS, u8>,
}

impl Filters {
    /// The inputs and their filters.
    pub fn inputs(&self) -> impl Iterator<Item = (u8, &InputFilter)> {
        (self.first.get()..=u8::MAX).zip(&self.filters)
    }

    pub(crate) fn parse(params: Bytes<'_>) -> Result<Filters, ParseError> {
        parse_growing(Code::Filters, params, fields)
    }

    pub(crate) fn to_body(&self) -> Body {
        let mut body = Body::new(Code::Filters);
        body.put(&[self.first.get(), u8::try_from(self.filters.len()).unwrap_or(u8::MAX)]);
        for filter in &self.filters {
            filter.put_on(&mut body);
        }
        body
    }
}

fn fields(params: Bytes<'_>) -> nom::IResult<Bytes<'_>, Filters, Fault> {
    let (params, first) = byte(NonZeroU8::new).parse(params)?;
    // A reply without filters answers a question behind the last input.
    let fits = |count: u8| {
        count == 0
            || usize::from(count) <= MAX_FILTERS
                && first.get().saturating_add(count - 1) <= LAST_INPUT
    };
    let (mut rest, count) = byte(|count| fits(count).then_some(count)).parse(params)?;
    let mut filters = Vec::new();
    for _ in 0..count {
        let (behind, filter) = InputFilter::parser().parse(rest)?;
        rest = behind;
        // The count was checked, so there is room.
        let _ = filters.push(filter);
    }
    Ok((rest, Filters { first, filters }))
}

/// An `F` of a host.
pub(crate) fn parse_command(params: Bytes<'_>) -> Result<Command, ParseError> {
    if let [] | [_] = params {
        let first = params.first().copied().and_then(NonZeroU8::new).unwrap_or(NonZeroU8::MIN);
        return Ok(Command::QueryFilters { first });
    }
    let fields = (byte(below(LAST_INPUT + 1)), InputFilter::parser());
    let (input, filter) = parse_params(Code::Filters, params, 1 + InputFilter::LEN, fields)?;
    filter.check().map_err(|invalid| ParseError::BadValue {
        code: Code::Filters.byte(),
        offset: 2 + invalid.offset(),
        value: invalid.value(),
    })?;
    Ok(Command::SetFilter { input: NonZeroU8::new(input), filter })
}
