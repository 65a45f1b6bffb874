//! Lists of the relays of Schweitzer Engineering Laboratories.
//!
//! A row number is a position in the relay's list, 1 being the newest row. It tells the order of rows
//! whichever way the list is printed, also of rows in one millisecond. It does not identify a row:
//! it changes with every new one.

pub(super) mod compressed;
pub(super) mod report;

use super::list::{Change, Found, To};
use super::notes::Refusal;

/// What a row says: an element and its state, or an event of the relay itself, which has none.
fn changes(found: &mut Found, element: &str, state: Option<&str>) -> Result<Vec<Change>, Refusal> {
    let point = found.point(element)?;
    let to = match state {
        Some(state) => To::Word(found.word(state)?),
        None => To::Event,
    };
    found.count(1)?;
    Ok(vec![Change { point, to }])
}
