//! Contacts that are wired to two recorders.

use toml::Spanned;

use super::names::Names;
use crate::site::checks::same_as;
use crate::site::diagnostic::{Findings, Span};
use crate::site::file::{PointTable, SiteTable};
use crate::site::model::{Point, PointId};

/// Pairs the points that name each other; it is enough if one of them does.
pub(super) fn pair(
    table: &SiteTable,
    names: &Names<'_>,
    points: &mut [Option<Point>],
    findings: &mut Findings,
) {
    let mut partners: Vec<Option<(PointId, Span)>> = vec![None; table.points.len()];
    for (index, point) in table.points.iter().enumerate() {
        let Some(text) = &point.same_as else { continue };
        let this = PointId(index);
        let Some(other) = partner(this, text, names, findings) else { continue };
        let free = |point: PointId, partner: PointId| match partners.get(point.0) {
            Some(Some((known, there))) if *known != partner => Err((point, there.clone())),
            _ => Ok(()),
        };
        match free(this, other).and_then(|()| free(other, this)) {
            Err((taken, there)) => {
                same_as::taken(findings, text.span(), &names.full_name(taken), there);
            }
            Ok(()) => {
                for (point, partner) in [(this, other), (other, this)] {
                    if let Some(place) = partners.get_mut(point.0) {
                        *place = Some((partner, text.span()));
                    }
                }
            }
        }
    }
    for (index, point) in points.iter_mut().enumerate() {
        let partner = partners.get(index).cloned().flatten().map(|(partner, _)| partner);
        let inverted = is_inverted(table, PointId(index), partner, findings);
        if let Some(point) = point {
            (point.same_as, point.inverted) = (partner, inverted);
        }
    }
}

fn partner(
    this: PointId,
    text: &Spanned<String>,
    names: &Names<'_>,
    findings: &mut Findings,
) -> Option<PointId> {
    let other = names.point(text.span(), text.get_ref(), findings)?;
    if other == this {
        same_as::itself(findings, text.span());
        return None;
    }
    if names.owner(this).is_some() && names.owner(this) == names.owner(other) {
        same_as::own_recorder(findings, text.span(), names.place(other).unwrap_or_default());
        return None;
    }
    Some(other)
}

/// Whether a pair is inverted: either side may say so.
fn is_inverted(
    table: &SiteTable,
    this: PointId,
    partner: Option<PointId>,
    findings: &mut Findings,
) -> bool {
    let said = |id: PointId| {
        let point: Option<&PointTable> = table.points.get(id.0);
        point.and_then(|point| point.inverted.as_ref())
    };
    let here = said(this);
    let Some(partner) = partner else {
        // A `same_as` that leads nowhere has been told.
        let is_alone = table.points.get(this.0).is_some_and(|point| point.same_as.is_none());
        if let Some(here) = here.filter(|here| is_alone && *here.get_ref()) {
            same_as::inverted_alone(findings, here.span());
        }
        return false;
    };
    match (here, said(partner)) {
        (Some(here), Some(there)) if here.get_ref() != there.get_ref() => {
            // Told once, at the second of them.
            if there.span().start < here.span().start {
                same_as::inverted_here_only(findings, here.span(), there.span());
            }
            false
        }
        (here, there) => here.or(there).is_some_and(|inverted| *inverted.get_ref()),
    }
}
