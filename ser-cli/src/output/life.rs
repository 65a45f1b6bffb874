//! Names for the lives of logs.
//!
//! A log lives from power-up or erase to the next. The recorder has no name for its lives, so a
//! program that remembers from run to run draws one at random. Together with the sequence, the name
//! distinguishes an event from all others.

use std::io;

pub use ser_evidence::record::Life;

/// A new name, for a life that becomes known now.
///
/// # Errors
/// When the system provides no random numbers.
pub(crate) fn new_life() -> io::Result<Life> {
    loop {
        let life = Life::from_bits(getrandom::u64()?);
        if life.is_known() {
            return Ok(life);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_lives_have_the_same_name() {
        assert_ne!(new_life().unwrap(), new_life().unwrap());
    }
}
