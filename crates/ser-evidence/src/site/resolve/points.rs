//! Points and their groups.

use std::collections::BTreeMap;

use toml::Spanned;

use super::names::Names;
use crate::site::checks::{
    duplicate_input, duplicate_name, empty_group, input_beyond_model, unknown_group,
};
use crate::site::diagnostic::{Findings, Span};
use crate::site::file::{GroupTable, PointTable, SiteTable};
use crate::site::model::{Group, GroupId, Point, RecorderId};

/// The groups by their names. Two that are equal are told.
pub(super) fn groups<'t>(
    table: &'t SiteTable,
    findings: &mut Findings,
) -> BTreeMap<&'t str, GroupId> {
    let mut groups = BTreeMap::new();
    let mut places = Vec::<Span>::new();
    for (index, GroupTable { name, .. }) in table.groups.iter().enumerate() {
        places.push(name.as_ref().map(Spanned::span).unwrap_or_default());
        let Some(name) = name else { continue };
        match groups.get(name.get_ref().as_str()) {
            Some(GroupId(first)) => {
                let first = places.get(*first).cloned().unwrap_or_default();
                let twice = (name.span(), name.get_ref().as_str());
                duplicate_name::found(findings, twice, "groups", first);
            }
            None => drop(groups.insert(name.get_ref().as_str(), GroupId(index))),
        }
    }
    groups
}

/// All groups of a file without errors.
pub(super) fn resolved_groups(table: &SiteTable) -> Vec<Group> {
    let resolved = |group: &GroupTable| {
        let name = group.name.as_ref()?.get_ref().clone();
        Some(Group { name, first_out: group.first_out })
    };
    table.groups.iter().filter_map(resolved).collect()
}

/// Warns of groups to which no point belongs.
pub(super) fn look_for_empty_groups(
    table: &SiteTable,
    points: &[Option<Point>],
    findings: &mut Findings,
) {
    let mut used = vec![false; table.groups.len()];
    for GroupId(index) in points.iter().flatten().filter_map(|point| point.group) {
        if let Some(used) = used.get_mut(index) {
            *used = true;
        }
    }
    for (group, used) in table.groups.iter().zip(used) {
        if let (Some(name), false) = (&group.name, used) {
            empty_group::found(findings, (name.span(), name.get_ref()));
        }
    }
}

/// All points, without their partners; `None` for those that have errors.
pub(super) fn points<'t>(
    table: &'t SiteTable,
    names: &mut Names<'t>,
    groups: &BTreeMap<&str, GroupId>,
    findings: &mut Findings,
) -> Vec<Option<Point>> {
    let mut taken = Taken::default();
    let mut points = Vec::new();
    for table_of_point in &table.points {
        let owner = names.recorder(&table_of_point.recorder, findings);
        names.add_point(table_of_point, owner);
        if let Some(owner) = owner {
            taken.look(table, table_of_point, (owner, names.recorder_name(owner)), findings);
        }
        let group = table_of_point.group.as_ref();
        let group = group.and_then(|group| group_of(group, groups, findings));
        points.push(resolved(table_of_point, owner, group));
    }
    points
}

/// Names and inputs that points have already.
#[derive(Default)]
struct Taken<'t> {
    names: BTreeMap<(RecorderId, &'t str), Span>,
    inputs: BTreeMap<(RecorderId, u8), Span>,
}

impl<'t> Taken<'t> {
    fn look(
        &mut self,
        table: &'t SiteTable,
        point: &'t PointTable,
        (owner, recorder): (RecorderId, &str),
        findings: &mut Findings,
    ) {
        if let Some(name) = &point.name {
            let (text, span) = (name.get_ref().as_str(), name.span());
            match self.names.get(&(owner, text)) {
                Some(first) => {
                    let what = "points of one recorder";
                    duplicate_name::found(findings, (span, text), what, first.clone());
                }
                None => drop(self.names.insert((owner, text), span)),
            }
        }
        let Some(input) = &point.input else { return };
        let (number, span) = (*input.get_ref(), input.span());
        match self.inputs.get(&(owner, number)) {
            Some(first) => {
                duplicate_input::found(findings, span.clone(), (number, recorder), first.clone());
            }
            None => drop(self.inputs.insert((owner, number), span.clone())),
        }
        let model = table.recorders.get(owner.0).and_then(|table| table.model.as_ref());
        if let Some(model) = model.filter(|model| number > model.get_ref().inputs()) {
            let inputs = model.get_ref().inputs();
            input_beyond_model::found(findings, (span, number), (recorder, inputs), model.span());
        }
    }
}

fn group_of(
    group: &Spanned<String>,
    groups: &BTreeMap<&str, GroupId>,
    findings: &mut Findings,
) -> Option<GroupId> {
    let found = groups.get(group.get_ref().as_str()).copied();
    if found.is_none() {
        let known = groups.keys().copied();
        unknown_group::found(findings, (group.span(), group.get_ref()), known);
    }
    found
}

fn resolved(
    table: &PointTable,
    recorder: Option<RecorderId>,
    group: Option<GroupId>,
) -> Option<Point> {
    Some(Point {
        recorder: recorder?,
        input: *table.input.as_ref()?.get_ref(),
        name: table.name.as_ref()?.get_ref().clone(),
        role: table.role,
        equipment: table.equipment.clone(),
        group,
        on: table.on.clone().unwrap_or_else(|| "ON".to_owned()),
        off: table.off.clone().unwrap_or_else(|| "OFF".to_owned()),
        normal: table.normal,
        same_as: None,
        inverted: false,
    })
}
