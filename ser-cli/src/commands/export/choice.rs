//! Which part of the timeline is wanted.

use ser_evidence::incident::{Incident, Which};
use ser_evidence::site::Site;
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
    /// What is wanted, if the user says anything.
    pub(super) fn which(&self, site: &Site) -> Result<Option<Which>> {
        Ok(self.choice.which(site)?.or(self.last_trip.then_some(Which::LastTrip)))
    }

    /// The part of this timeline.
    pub(super) fn selection(&self, timeline: &Timeline<'_>) -> Result<Selection> {
        let Some(which) = self.which(timeline.site())? else { return Ok(Selection::everything()) };
        let incident = Incident::pick(timeline, which).ok_or_else(|| {
            Failure::new("there is no entry with a time in this part")
                .hint("without a choice of time everything is exported")
        })?;
        Ok(Selection::of(timeline, &incident))
    }
}
