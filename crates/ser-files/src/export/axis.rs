//! One axis of time for all recorders.
//!
//! An entry is drawn when its sample was taken, in UTC, as well as that is known: the middle of its
//! bound where its clock was observed. The list is in the order in which contacts moved. So where
//! recorders have different delays in their input circuits, all are drawn as if they had the
//! shortest, or the drawing would contradict the list.

use ser_evidence::time::Moment;
use ser_evidence::timeline::{EventId, Timeline};

/// Where entries are on the axis, in microseconds of UTC.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis {
    /// From the place in the list to the axis.
    delay_us: i64,
}

impl Axis {
    pub(super) fn of(timeline: &Timeline<'_>) -> Axis {
        let recorders = timeline.history().recorders.iter().zip(0_u32..);
        let delays = recorders.filter_map(|(history, recorder)| {
            let mut lives = history.lives.iter().zip(0_u32..);
            lives.find_map(|(_, life)| {
                let event = EventId { recorder, life, place: 0 };
                Some(timeline.time(event)?.us().saturating_sub(timeline.sort_key(event)?))
            })
        });
        Axis { delay_us: delays.min().unwrap_or(0) }
    }

    /// Where an entry is; `None` if nothing is known of its time.
    pub(super) fn at(self, timeline: &Timeline<'_>, event: EventId) -> Option<i64> {
        Some(self.at_key(timeline.sort_key(event)?))
    }

    /// Where a place in the list is.
    pub(super) const fn at_key(self, key: i64) -> i64 {
        key.saturating_add(self.delay_us)
    }
}

/// How far the truth may be from where an entry is drawn, in microseconds; `None` if nobody knows.
pub(super) fn doubt_us(timeline: &Timeline<'_>, event: EventId, at_us: i64) -> Option<u64> {
    let bound = timeline.moved_utc(event, None);
    let (lo, hi) = (bound.lo().map(Moment::us)?, bound.hi().map(Moment::us)?);
    let doubt = at_us.saturating_sub(lo).max(hi.saturating_sub(at_us)).max(0);
    Some(doubt.unsigned_abs())
}
