//! Which incident, or which time, the user wants.

use ser_evidence::incident::Which;
use ser_evidence::site::Site;

use super::{GivenMoment, parse_moment};
use crate::error::{Failure, Result};

/// Which incident, or which time.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct ChoiceArgs {
    /// The last incident, whether something tripped or not.
    #[arg(long, conflicts_with_all = ["around", "since", "until"])]
    last: bool,

    /// The incident at this time, or nearest to it; of several in the minute, or on the day, that is
    /// given, the last one in which something tripped.
    #[arg(
        long,
        value_name = "TIME",
        value_parser = parse_moment,
        conflicts_with_all = ["since", "until"]
    )]
    around: Option<GivenMoment>,

    /// Everything from this time on.
    #[arg(long, value_name = "TIME", value_parser = parse_moment)]
    since: Option<GivenMoment>,

    /// Everything until this time.
    #[arg(long, value_name = "TIME", value_parser = parse_moment)]
    until: Option<GivenMoment>,
}

impl ChoiceArgs {
    /// What is wanted, if the user says anything. Times without an offset are in the zone of the
    /// site.
    pub(crate) fn which(&self, site: &Site) -> Result<Option<Which>> {
        let in_zone = |given: Option<GivenMoment>| {
            given.map(|given| given.in_zone(&site.time_zone)).transpose()
        };
        let (since, until) = (in_zone(self.since)?, in_zone(self.until)?);
        let around = self.around.map(|given| given.span_in_zone(&site.time_zone)).transpose()?;
        if let (Some(since), Some(until)) = (since, until)
            && until < since
        {
            return Err(Failure::usage("--until is before --since")
                .hint("exchange the two, or leave one out: it is then open at that end"));
        }
        Ok(match around {
            Some((from, until)) => Some(Which::Around(from, until)),
            None if since.is_some() || until.is_some() => Some(Which::Between(since, until)),
            None => self.last.then_some(Which::Last),
        })
    }
}
