//! The one axis of time that all lanes share.

use ser_evidence::time::Moment;
use ser_evidence::timeline::{ChangeId, EventId, Timeline};

use crate::report::{Document, elsewhere};

/// Where changes are on the axis: at Δ to the first one, as the table has it. That is the time
/// between the contacts; the samples that saw them may be further apart.
pub(super) struct Axis<'a> {
    timeline: &'a Timeline<'a>,
    first: ChangeId,
    /// When the first one was, in UTC.
    pub(super) origin_us: i64,
}

impl<'a> Axis<'a> {
    pub(super) fn new(document: &Document<'a>) -> Option<Axis<'a>> {
        let Document { timeline, report, .. } = *document;
        let first = report.rows.iter().find(|row| time_us(timeline, row.change.event).is_some())?;
        let origin_us = time_us(timeline, first.change.event)?;
        Some(Axis { timeline, first: first.change, origin_us })
    }

    pub(super) fn of(&self, change: ChangeId) -> Option<i64> {
        let listed = self.of_entry(change.event)?;
        let delta = self.timeline.delta(self.first, change).middle_us();
        Some(delta.unwrap_or(listed))
    }

    /// An entry whose own changes are not asked for.
    pub(super) fn of_entry(&self, event: EventId) -> Option<i64> {
        Some(time_us(self.timeline, event)?.saturating_sub(self.origin_us))
    }
}

fn time_us(timeline: &Timeline<'_>, event: EventId) -> Option<i64> {
    timeline.time(event).filter(|_| !elsewhere::is_timeless(timeline, event)).map(Moment::us)
}
