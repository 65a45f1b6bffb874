//! Which events are wanted: of a recorder, of a point, of a group.

use ser_console::Harmless;
use ser_evidence::incident::Points;
use ser_evidence::site::{PointId, Site};
use ser_evidence::timeline::{ChangeId, EventId, Timeline};

use crate::connection::ConnectionArgs;
use crate::error::{Failure, Result};

/// Which points are wanted.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct FilterArgs {
    /// Only changes of this point: its name, or RECORDER/NAME, or the number of an input.
    #[arg(long, value_name = "POINT")]
    point: Option<String>,

    /// Only changes of points of this group.
    #[arg(long, value_name = "GROUP")]
    group: Option<String>,
}

/// Which changes are wanted.
pub(super) struct Filter {
    /// By index in the history.
    recorders: Vec<bool>,
    points: Option<Vec<PointId>>,
    input: Option<u8>,
    of_change: Points,
}

impl Filter {
    /// What the user wants of this timeline. A name that nothing has is a mistake.
    pub(super) fn new(
        args: &FilterArgs,
        connection: &ConnectionArgs,
        timeline: &Timeline<'_>,
    ) -> Result<Filter> {
        let site = timeline.site();
        let input = args.point.as_deref().and_then(|point| point.parse::<u8>().ok());
        let mut points = match args.point.as_deref().filter(|_| input.is_none()) {
            Some(name) => Some(points_named(site, name)?),
            None => None,
        };
        if let Some(group) = &args.group {
            let of_group = points_of_group(site, group)?;
            points = Some(match points {
                Some(points) => {
                    points.into_iter().filter(|point| of_group.contains(point)).collect()
                }
                None => of_group,
            });
        }
        let recorders = recorders(connection.recorder.as_deref(), points.as_deref(), timeline)?;
        Ok(Filter { recorders, points, input, of_change: Points::new(timeline) })
    }

    /// Whether a recorder's losses are wanted.
    pub(super) fn wants_recorder(&self, recorder: u32) -> bool {
        self.recorders.get(recorder as usize) == Some(&true)
    }

    /// Whether a change is wanted.
    pub(super) fn wants(&self, change: ChangeId) -> bool {
        let is_of_points = || match &self.points {
            Some(points) => self.of_change.of(change).is_some_and(|point| points.contains(&point)),
            None => true,
        };
        self.wants_recorder(change.event.recorder)
            && self.input.is_none_or(|input| input == change.input)
            && is_of_points()
    }

    /// Whether any change of an event is wanted.
    pub(super) fn wants_event(&self, timeline: &Timeline<'_>, event: EventId) -> bool {
        let Some(held) = timeline.held(event) else { return false };
        if self.points.is_none() && self.input.is_none() {
            return self.wants_recorder(event.recorder);
        }
        held.entry.changed.numbers().any(|input| self.wants(ChangeId { event, input }))
    }
}

/// Which recorders are wanted: the one that is named, and those of the points.
fn recorders(
    name: Option<&str>,
    points: Option<&[PointId]>,
    timeline: &Timeline<'_>,
) -> Result<Vec<bool>> {
    let site = timeline.site();
    let all = &timeline.history().recorders;
    if let Some(name) = name
        && !all.iter().any(|history| history.recorder.name == name)
    {
        let names: Vec<String> =
            all.iter().map(|history| Harmless(&history.recorder.name).line()).collect();
        let name = Harmless(name).line();
        return Err(Failure::usage(format!("the archive has no recorder {name}"))
            .hint(format!("it has {}", names.join(", "))));
    }
    let has_point = |history: &ser_evidence::history::RecorderHistory| {
        points.is_none_or(|points| {
            let of = points.iter().filter_map(|point| site.points.get(point.0));
            of.into_iter().any(|point| history.site == Some(point.recorder))
        })
    };
    let is_named = |history: &ser_evidence::history::RecorderHistory| {
        name.is_none_or(|name| history.recorder.name == name)
    };
    Ok(all.iter().map(|history| is_named(history) && has_point(history)).collect())
}

/// The points of this name; of one recorder if that is before a slash.
fn points_named(site: &Site, name: &str) -> Result<Vec<PointId>> {
    let points = site.points.iter().enumerate().filter(|(_, point)| {
        let recorder = site.recorders.get(point.recorder.0);
        let full = recorder.map(|recorder| format!("{}/{}", recorder.name, point.name));
        point.name == name || full.as_deref() == Some(name)
    });
    let found: Vec<PointId> = points.map(|(index, _)| PointId(index)).collect();
    match found.is_empty() {
        false => Ok(found),
        true => Err(Failure::usage(format!("the site has no point {}", Harmless(name).line()))
            .hint("ser-cli site show FILE lists the points; give the file with --site")
            .hint("an input without a name has its number, as in --recorder U1 --point 7")),
    }
}

fn points_of_group(site: &Site, name: &str) -> Result<Vec<PointId>> {
    let group = site.groups.iter().position(|group| group.name == name);
    let group = group.ok_or_else(|| {
        let names: Vec<String> =
            site.groups.iter().map(|group| Harmless(&group.name).line()).collect();
        let failure = Failure::usage(format!("the site has no group {}", Harmless(name).line()));
        match names.is_empty() {
            true => failure.hint("groups are in the site file; give it with --site"),
            false => failure.hint(format!("it has {}", names.join(", "))),
        }
    })?;
    let points = site.points.iter().enumerate();
    let of_group = points.filter(|(_, point)| point.group.is_some_and(|of| of.0 == group));
    Ok(of_group.map(|(index, _)| PointId(index)).collect())
}
