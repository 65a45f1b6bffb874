//! Names for the lives of logs.
//!
//! A log lives from power-up or erase to the next. The recorder has no name for its lives, so a
//! program that remembers from run to run draws one at random. A recorder with our extension tells
//! enough for a name that everybody gives it. Together with the sequence, the name
//! distinguishes an event from all others.

use std::io;

use ser_client::{RequestError, Unit};
use ser_evidence::record::Life;
use ser_proto::{Capabilities, Identity};

/// The highest sequence at which totals have not gone round.
const FIRST_WRAP: u64 = 1 << 16;

/// A new name, for a life that becomes known now.
///
/// # Errors
/// When the system provides no random numbers.
pub fn new_life() -> io::Result<Life> {
    loop {
        let life = Life::from_bits(getrandom::u64()?);
        if life.is_known() {
            return Ok(life);
        }
    }
}

/// The name of the life that the log of this recorder is in. `None` where it cannot have one that
/// everybody gives it: the recorder has no number, its counts begin anew with the power, or its
/// entries may be counted differently by who has not seen all of them.
///
/// # Errors
/// If the line fails. A recorder that does not answer has no name now.
pub fn life_of_recorder(
    unit: &mut Unit,
    identity: &Identity,
) -> Result<Option<Life>, RequestError> {
    let Some(id) = identity.id else { return Ok(None) };
    if !identity.capabilities.contains(Capabilities::LASTING_COUNTS) {
        return Ok(None);
    }
    let look = match unit.clock_look() {
        Ok(look) => look,
        Err(RequestError::NoReply { .. }) => None,
        Err(error) => return Err(error),
    };
    let is_countable = |reading: &ser_proto::ClockReading| {
        reading.life == identity.life && reading.next_sequence <= FIRST_WRAP
    };
    let is_known = look.is_some_and(|look| is_countable(&look.reading));
    Ok(is_known.then(|| Life::of_recorder(&id.bytes(), identity.power_ups, identity.life)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_lives_have_the_same_name() {
        assert_ne!(new_life().unwrap(), new_life().unwrap());
    }
}
