//! From the tables of a file to the resolved site.
//!
//! Points, recorders and groups keep the order of the file, so the index of a table is the index of
//! what it describes. A site is made only of a file without errors; until then everything that can
//! be looked at is looked at.

mod edges;
mod names;
mod pairs;
mod points;
mod recorders;
mod shifts;

use jiff::tz::TimeZone;

use super::diagnostic::Findings;
use super::digest::SiteDigest;
use super::file::{ObservationTable, SiteTable};
use super::model::{HandObservation, Site};
use names::Names;

/// Looks at what the tables say of each other; the site, if all is well.
pub(super) fn resolve(
    table: &SiteTable,
    digest: SiteDigest,
    findings: &mut Findings,
) -> Option<Site> {
    recorders::look(table, findings);
    let mut names = Names::of_recorders(table);
    names.look_for_recorders(findings);
    let groups = points::groups(table, findings);
    let mut points = points::points(table, &mut names, &groups, findings);
    pairs::pair(table, &names, &mut points, findings);
    let expectations = edges::expectations(table, &names, findings);
    let observations = observations(&table.observations, &names, findings);
    let shifts = shifts::shifts(table, &names, findings);
    if findings.has_errors() {
        return None;
    }
    points::look_for_empty_groups(table, &points, findings);
    Some(Site {
        name: table.name.as_ref()?.get_ref().clone(),
        digest: Some(digest),
        time_zone: table.time_zone.clone().unwrap_or(TimeZone::UTC),
        utc_doubt_us: table.utc_doubt_us,
        recorders: recorders::recorders(table),
        points: points.into_iter().flatten().collect(),
        groups: points::resolved_groups(table),
        expectations,
        observations,
        shifts,
        incident: table.incident,
    })
}

fn observations(
    tables: &[ObservationTable],
    names: &Names<'_>,
    findings: &mut Findings,
) -> Vec<HandObservation> {
    let mut observation = |table: &ObservationTable| {
        let recorder = names.recorder(&table.recorder, findings)?;
        let (host_time, unit_time) = (table.host_time?, table.unit_time?);
        Some(HandObservation { recorder, host_time, unit_time, doubt_us: table.doubt_us? })
    };
    tables.iter().filter_map(&mut observation).collect()
}
