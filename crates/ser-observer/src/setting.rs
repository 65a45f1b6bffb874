//! Setting a recorder's clock, and what that, or a broadcast, says of the clock.

use std::thread;
use std::time::Duration;

use ser_client::{RequestError, Unit};
use ser_evidence::record::{ClockObservation, ClockStep, How, Place, Record, Reference};
use ser_evidence::time::{Bound, Moment, Shown, shown};
use ser_proto::TimeStamp;

use crate::clock_look;
use crate::host_reading;
use crate::log_look::LogLook;

/// A clock begins to show its millisecond up to one millisecond before a command is carried out, or
/// after: recorders count whole ones, and at which place of one a command comes is not known.
const MILLISECOND: Duration = Duration::from_millis(1);

/// How long after a setting the clock is asked, so that nobody can take it for what was before.
const AFTER_SETTING: Duration = Duration::from_millis(10);

/// Neither a recorder nor a client accepts this as a date.
pub const NO_TIME: TimeStamp =
    TimeStamp { year: 0, month: 0, day: 0, hour: 0, minute: 0, second: 0, millisecond: 0 };

/// What came of setting a clock.
#[derive(Debug)]
pub struct Setting {
    /// The time that was sent; or why it cannot be said that it was taken.
    pub sent: Result<TimeStamp, RequestError>,
    /// What the clock showed when. `None` if the command was sent again and again: then nobody
    /// knows which attempt set it last.
    pub observed: Option<ClockObservation>,
    /// Everything that was seen of the clock, in order, whatever came of it.
    pub records: Vec<Record>,
}

/// Sets the clock to what `time_at` says that it should show that much later. `before` is the log
/// right before. A recorder that has said the number of its `life` is asked for its clock before
/// and after, which takes a second.
pub fn set_clock(
    unit: &mut Unit,
    before: &LogLook,
    life: Option<u32>,
    time_at: &mut dyn FnMut(Duration) -> TimeStamp,
) -> Setting {
    let mut records = Vec::new();
    records.extend(life.and_then(|life| asked(unit, before, life)));
    let sent = match unit.set_clock(time_at) {
        Ok(sent) => sent,
        Err(error) => {
            let is_surely_not_set = matches!(
                error,
                RequestError::InvalidTime(_)
                    | RequestError::NoReply { may_have_been_done: false, .. }
            );
            if !is_surely_not_set {
                records.push(step(before.place(None)));
            }
            return Setting { sent: Err(error), observed: None, records };
        }
    };
    let observed = observed(unit, sent, before);
    records.push(observed.map_or_else(|| step(before.place(None)), Record::Clock));
    if let Some(life) = life {
        thread::sleep(AFTER_SETTING);
        records.extend(asked(unit, before, life));
    }
    Setting { sent: Ok(sent), observed, records }
}

/// What the recorder says of its clock, if it can be asked and its log has a name. A setting is
/// worth more, so no failure is one here.
fn asked(unit: &mut Unit, before: &LogLook, life: u32) -> Option<Record> {
    let looks = clock_look::take(unit).ok()??;
    let place = before.place_before(looks.last_total(life)?)?;
    looks.observation(place).map(Record::Clock)
}

/// What the clock showed when it was set just now.
fn observed(unit: &mut Unit, sent: TimeStamp, before: &LogLook) -> Option<ClockObservation> {
    let exchange = unit.last_exchange().filter(|exchange| exchange.attempts == 1)?;
    let after = unit.log_position().ok().map(|position| position.total);
    let how = How::Set { broadcast: None };
    Some(observation(how, shown(&sent)?, exchange.carried_out(), before.place(after)))
}

/// The clock showed `shown` when a command was carried out, between two times of this computer's
/// monotonic clock.
pub fn observation(
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
pub fn step(place: Place) -> Record {
    Record::Step(ClockStep { place, reading: host_reading::now() })
}

/// Half of what is not known, in whole milliseconds; `None` if it has no end.
pub fn doubt_ms(observation: &ClockObservation) -> Option<i64> {
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
