//! `site check`: what is wrong with a site file.

use std::io::{self, Write};
use std::path::Path;

use ser_evidence::site::Site;

use crate::error::Result;
use crate::site_file::{Inspected, counted};

pub(super) fn run(file: &Path) -> Result<()> {
    let inspected = Inspected::of(file)?;
    inspected.draw();
    let name = inspected.name().to_owned();
    let site = inspected.into_site()?;
    let mut out = io::stdout().lock();
    writeln!(out, "{name}: ok{}", contents(&site))?;
    Ok(out.flush()?)
}

/// As in `, 2 recorders, 34 points`.
fn contents(site: &Site) -> String {
    let Site { recorders, points, groups, expectations, observations, shifts, .. } = site;
    // Recorders and points are counted even if there are none.
    let always = |count, what| counted(count, what).unwrap_or_else(|| format!("no {what}s"));
    let always = [always(recorders.len(), "recorder"), always(points.len(), "point")];
    let sometimes = [
        counted(groups.len(), "group"),
        counted(expectations.len(), "expectation"),
        counted(observations.len(), "observation"),
        counted(shifts.len(), "shift"),
    ];
    always
        .into_iter()
        .chain(sometimes.into_iter().flatten())
        .map(|part| format!(", {part}"))
        .collect()
}
