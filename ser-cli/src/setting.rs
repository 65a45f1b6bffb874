//! What setting a recorder's clock, or a broadcast, says of that clock.

use std::time::Duration;

use ser_evidence::record::{ClockObservation, ClockStep, How, Place, Record, Reference};
use ser_evidence::time::{Bound, Moment, Shown};

use crate::host_reading;

/// A clock begins to show its millisecond up to one millisecond before a command is carried out, or
/// after: recorders count whole ones, and at which place of one a command comes is not known.
const MILLISECOND: Duration = Duration::from_millis(1);

/// The clock showed `shown` when a command was carried out, between two times of this computer's
/// monotonic clock.
pub(crate) fn observation(
    how: How,
    shown: Moment<Shown>,
    (from, to): (Duration, Duration),
    place: Place,
) -> ClockObservation {
    let (from, to) = (from.saturating_sub(MILLISECOND), to.saturating_add(MILLISECOND));
    let bound = Bound::new(Some(host_reading::moment(from)), Some(host_reading::moment(to)));
    let at = Reference::Host { bound, reading: host_reading::at(to) };
    ClockObservation { how, shown, at, place }
}

/// The clock may have been set just now.
pub(crate) fn step(place: Place) -> Record {
    Record::Step(ClockStep { place, reading: host_reading::now() })
}

/// Half of what is not known, in whole milliseconds; `None` if it has no end.
pub(crate) fn doubt_ms(observation: &ClockObservation) -> Option<i64> {
    let Reference::Host { bound, .. } = observation.at else { return None };
    Some(bound.width_us()?.saturating_add(1999) / 2000)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_millisecond_of_the_recorder_is_in_the_bound() {
        let ms = Duration::from_millis;
        let shown = Moment::from_us(0);
        let how = How::Set { broadcast: None };
        let observation = observation(how, shown, (ms(100), ms(103)), Place::UNKNOWN);
        let Reference::Host { bound, .. } = observation.at else { panic!() };
        assert_eq!(bound, Bound::from_us(99_000, 104_000));
        assert_eq!(doubt_ms(&observation), Some(3), "2.5 ms, and not less");
    }
}
