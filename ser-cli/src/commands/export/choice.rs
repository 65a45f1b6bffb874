//! Which part of the timeline is wanted.

use ser_evidence::incident::{Incident, Which};
use ser_evidence::timeline::Timeline;
use ser_files::export::Selection;

use crate::error::{Failure, Result};
use crate::gather::{GivenMoment, parse_moment};

/// Which part of the timeline is wanted; everything by default.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(super) struct Choice {
    /// The last incident in which something tripped; without such a point, the last one.
    #[arg(long, conflicts_with_all = ["last", "around", "since", "until"])]
    last_trip: bool,

    /// The last incident, whether something tripped or not.
    #[arg(long, conflicts_with_all = ["around", "since", "until"])]
    last: bool,

    /// The incident at this time, or nearest to it.
    #[arg(long, value_name = "TIME", value_parser = parse_moment, conflicts_with_all = ["since", "until"])]
    around: Option<GivenMoment>,

    /// Everything from this time on.
    #[arg(long, value_name = "TIME", value_parser = parse_moment)]
    since: Option<GivenMoment>,

    /// Everything until this time.
    #[arg(long, value_name = "TIME", value_parser = parse_moment)]
    until: Option<GivenMoment>,
}

impl Choice {
    /// The part of this timeline.
    pub(super) fn selection(&self, timeline: &Timeline<'_>) -> Result<Selection> {
        let Some(which) = self.which(timeline)? else { return Ok(Selection::everything()) };
        let incident = Incident::pick(timeline, which).ok_or_else(|| {
            Failure::new("there is no entry with a time in this part")
                .hint("without a choice of time everything is exported")
        })?;
        Ok(Selection::of(timeline, &incident))
    }

    fn which(&self, timeline: &Timeline<'_>) -> Result<Option<Which>> {
        let zone = &timeline.site().time_zone;
        let in_zone =
            |given: Option<GivenMoment>| given.map(|given| given.in_zone(zone)).transpose();
        let (around, since, until) =
            (in_zone(self.around)?, in_zone(self.since)?, in_zone(self.until)?);
        if let (Some(since), Some(until)) = (since, until)
            && until < since
        {
            return Err(Failure::usage("--until is before --since")
                .hint("exchange the two, or leave one out: it is then open at that end"));
        }
        Ok(match around {
            Some(around) => Some(Which::Around(around)),
            None if since.is_some() || until.is_some() => Some(Which::Between(since, until)),
            None if self.last => Some(Which::Last),
            None if self.last_trip => Some(Which::LastTrip),
            None => None,
        })
    }
}
