//! Changes that chatter filters leave out.

use ser_client::{RequestError, Unit};
use ser_evidence::record::Suppressed;

use crate::host_reading;

/// What the recorder has left out so far, input by input; `None` where it cannot be asked.
///
/// # Errors
/// If the recorder does not answer, or the line fails.
pub fn left_out(unit: &mut Unit) -> Result<Option<Suppressed>, RequestError> {
    let Some(clock) = unit.clock_look()? else { return Ok(None) };
    let Some(counts) = unit.suppressed_changes()? else { return Ok(None) };
    Ok(Some(Suppressed {
        from: host_reading::at(clock.between.0),
        to: host_reading::now(),
        on_for_us: clock.reading.tick_us,
        left_out: counts.into_iter().filter(|(_, count)| *count > 0).collect(),
    }))
}
