//! Which part of the timeline is wanted.

use ser_evidence::incident::{Incident, Which};
use ser_evidence::timeline::Timeline;
use ser_files::export::Selection;

use crate::error::{Failure, Result};
use crate::gather::ChoiceArgs;

/// Which part of the timeline is wanted; everything by default.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(super) struct Choice {
    /// The last incident in which something tripped; without such a point, the last one.
    #[arg(long, conflicts_with_all = ["last", "around", "since", "until"])]
    last_trip: bool,

    #[command(flatten)]
    choice: ChoiceArgs,
}

impl Choice {
    /// The part of this timeline.
    pub(super) fn selection(&self, timeline: &Timeline<'_>) -> Result<Selection> {
        let which = self.choice.which(timeline.site())?;
        let which = which.or(self.last_trip.then_some(Which::LastTrip));
        let Some(which) = which else { return Ok(Selection::everything()) };
        let incident = Incident::pick(timeline, which).ok_or_else(|| {
            Failure::new("there is no entry with a time in this part")
                .hint("without a choice of time everything is exported")
        })?;
        Ok(Selection::of(timeline, &incident))
    }
}
