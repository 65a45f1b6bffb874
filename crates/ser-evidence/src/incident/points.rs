//! Which point an input is.

use std::collections::HashMap;

use crate::site::{PointId, RecorderId};
use crate::timeline::{ChangeId, Timeline};

/// The points of all inputs, and the recorders of all points.
#[derive(Debug)]
pub struct Points {
    /// By the recorder's index in the history, and input.
    by_input: HashMap<(u32, u8), PointId>,
    /// The recorder's index in the history, by its place in the site.
    recorders: HashMap<RecorderId, u32>,
}

impl Points {
    /// Of this timeline's site.
    #[must_use]
    pub fn new(timeline: &Timeline<'_>) -> Points {
        let history = timeline.history().recorders.iter().zip(0_u32..);
        let recorders: HashMap<RecorderId, u32> =
            history.filter_map(|(recorder, index)| Some((recorder.site?, index))).collect();
        let points = timeline.site().points.iter().enumerate();
        let by_input = points
            .filter_map(|(index, point)| {
                let recorder = recorders.get(&point.recorder)?;
                Some(((*recorder, point.input), PointId(index)))
            })
            .collect();
        Points { by_input, recorders }
    }

    /// The point that changed.
    #[must_use]
    pub fn of(&self, change: ChangeId) -> Option<PointId> {
        self.by_input.get(&(change.event.recorder, change.input)).copied()
    }

    /// The index in the history of a recorder of the site.
    #[must_use]
    pub fn recorder(&self, recorder: RecorderId) -> Option<u32> {
        self.recorders.get(&recorder).copied()
    }
}
