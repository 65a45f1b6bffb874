//! What the arrival of deliveries says.

use std::time::Duration;

use ser_client::Lost as Missing;
use ser_evidence::record::{
    ClockObservation, EntryRecord, Gap, How, Life, Lost, Place, Reference, Why,
};
use ser_evidence::time::{Bound, Host, Moment, shown};

use crate::host_reading;

/// How long before it is in the log a change may have happened, in microseconds. A recorder holds a
/// change back for up to 320 ms, debounce included, so that changes get into order. The rest is for
/// original recorders, of which this is not known.
pub const HOLD_BACK_US: i64 = 1_000_000;

/// What the recorder's clock showed at an entry that was not in the log at `complete_at` and had
/// arrived at `at`, both by this computer's monotonic clock: its stamp, in between. `None` if the
/// stamp is no time, or the sequence is not known.
#[must_use]
pub fn seen_at(
    record: &EntryRecord,
    complete_at: Moment<Host>,
    at: Duration,
) -> Option<ClockObservation> {
    let EntryRecord { life, sequence, entry, .. } = *record;
    let bound = Bound::new(Some(complete_at.after(-HOLD_BACK_US)), Some(host_reading::moment(at)));
    Some(ClockObservation {
        how: How::Event,
        shown: shown(&entry.time)?,
        at: Reference::Host { bound, reading: host_reading::at(at) },
        place: Place {
            life,
            after: Some(sequence?),
            before: sequence,
            newest: Some(entry),
            fellow: None,
        },
    })
}

/// What a reading found to be missing, as a record of the life that it is missing in.
#[must_use]
pub fn gap(life: Life, after: Option<u64>, lost: Missing) -> Gap {
    let (lost, why) = match lost {
        Missing::Overwritten { count } => (Lost::Exactly(count), Why::Overwritten),
        Missing::OverwrittenAtLeast { count } => (Lost::AtLeast(count), Why::Overwritten),
        Missing::LogRestarted => (Lost::Unknown, Why::LogBeganAnew),
        Missing::Unrecorded { inputs } => (Lost::Unknown, Why::not_recorded(inputs)),
    };
    Gap { life, after, lost, why }
}
