//! This computer's clocks, in the form that records have.

use std::time::Duration;

use ser_client::HostTime;
use ser_evidence::record::{Boot, HostReading};
use ser_evidence::time::{Host, Moment};

/// Both clocks now.
pub fn now() -> HostReading {
    reading(HostTime::now())
}

/// Both clocks at a time of the monotonic one, not long ago.
pub fn at(time: Duration) -> HostReading {
    reading(HostTime::now().at(time))
}

/// A time of the monotonic clock.
pub fn moment(time: Duration) -> Moment<Host> {
    Moment::from_us(i64::try_from(time.as_micros()).unwrap_or(i64::MAX))
}

fn reading(time: HostTime) -> HostReading {
    HostReading {
        boot: Boot(time.boot),
        monotonic: moment(time.monotonic),
        utc: Moment::from_us(time.utc_us),
        utc_doubt_us: time
            .utc_doubt
            .map(|doubt| u64::try_from(doubt.as_micros()).unwrap_or(u64::MAX)),
    }
}
