//! From the names in a site file to indices.

use std::collections::BTreeMap;

use toml::Spanned;

use crate::site::checks::{
    ambiguous_point, missing_key, no_recorder, unknown_point, unknown_recorder,
};
use crate::site::diagnostic::{Findings, Span};
use crate::site::file::{Owner, PointTable, SiteTable};
use crate::site::model::{PointId, RecorderId};

/// The names of recorders and points.
pub(super) struct Names<'t> {
    table: &'t SiteTable,
    recorders: BTreeMap<&'t str, RecorderId>,
    /// The recorder of each point, where that is known.
    owners: Vec<Option<RecorderId>>,
    /// All points of a name; of equal names in one recorder only the first.
    points: BTreeMap<&'t str, Vec<PointId>>,
}

impl<'t> Names<'t> {
    /// Takes the names of all recorders. Two that are equal have been told.
    pub(super) fn of_recorders(table: &'t SiteTable) -> Names<'t> {
        let mut recorders = BTreeMap::new();
        for (index, recorder) in table.recorders.iter().enumerate() {
            if let Some(name) = &recorder.name {
                recorders.entry(name.get_ref().as_str()).or_insert(RecorderId(index));
            }
        }
        Names { table, recorders, owners: Vec::new(), points: BTreeMap::new() }
    }

    /// Takes a point, in the order of the file.
    pub(super) fn add_point(&mut self, point: &'t PointTable, owner: Option<RecorderId>) {
        let id = PointId(self.owners.len());
        self.owners.push(owner);
        let Some(name) = &point.name else { return };
        let owner_of = |id: &PointId| self.owners.get(id.0).copied().flatten();
        let of_name = self.points.entry(name.get_ref().as_str()).or_default();
        if owner.is_none() || !of_name.iter().any(|other| owner_of(other) == owner) {
            of_name.push(id);
        }
    }

    /// The recorder of a point.
    pub(super) fn owner(&self, point: PointId) -> Option<RecorderId> {
        self.owners.get(point.0).copied().flatten()
    }

    /// The name of a recorder, for people.
    pub(super) fn recorder_name(&self, recorder: RecorderId) -> &'t str {
        let name = self.table.recorders.get(recorder.0).and_then(|table| table.name.as_ref());
        name.map_or("", |name| name.get_ref().as_str())
    }

    /// The recorder that a table belongs to.
    pub(super) fn recorder(&self, owner: &Owner, findings: &mut Findings) -> Option<RecorderId> {
        if let Some(name) = &owner.name {
            let found = self.recorders.get(name.get_ref().as_str()).copied();
            // A file without recorders is told once, with its first point.
            if found.is_none() && !self.recorders.is_empty() {
                let known = self.recorders.keys().copied();
                unknown_recorder::found(findings, (name.span(), name.get_ref()), known);
            }
            return found;
        }
        match self.table.recorders.as_slice() {
            [_] => Some(RecorderId(0)),
            [_, ..] if !owner.is_named => {
                let name = self.recorders.keys().next().copied().unwrap_or("U1-SER1");
                let example = format!("{name:?}");
                let key = ("recorder", example.as_str());
                missing_key::found(findings, owner.head.clone(), owner.what, key);
                None
            }
            _ => None,
        }
    }

    /// Tells, once, that there are tables of recorders and no recorders.
    pub(super) fn look_for_recorders(&self, findings: &mut Findings) {
        let points = self.table.points.iter().map(|point| &point.recorder);
        let observations = self.table.observations.iter().map(|table| &table.recorder);
        let shifts = self.table.shifts.iter().map(|table| &table.recorder);
        let first = points.chain(observations).chain(shifts).next();
        if let (Some(owner), true) = (first, self.table.recorders.is_empty()) {
            no_recorder::found(findings, (owner.head.clone(), owner.what));
        }
    }

    /// The point that a text names: by its name, or as `RECORDER/NAME`.
    pub(super) fn point(&self, span: Span, text: &str, findings: &mut Findings) -> Option<PointId> {
        let found = self.points_called(text);
        match found.as_slice() {
            [only] => Some(*only),
            [] => {
                self.tell_unknown(span, text, findings);
                None
            }
            several => {
                let full: Vec<String> = several.iter().map(|id| self.full_name(*id)).collect();
                let places = several.iter().filter_map(|id| self.place(*id));
                let full = full.iter().map(String::as_str);
                ambiguous_point::found(findings, (span, text), full, places);
                None
            }
        }
    }

    fn points_called(&self, text: &str) -> Vec<PointId> {
        let called = |name: &str| self.points.get(name).into_iter().flatten().copied();
        let of_recorder = text.split_once('/').and_then(|(recorder, name)| {
            let recorder = *self.recorders.get(recorder)?;
            called(name).find(|id| self.owner(*id) == Some(recorder))
        });
        of_recorder.into_iter().chain(called(text)).collect()
    }

    fn tell_unknown(&self, span: Span, text: &str, findings: &mut Findings) {
        let names: Vec<String> = match findings.may_compare(self.owners.len()) {
            true => {
                let ids = (0..self.owners.len()).map(PointId);
                let full = ids.map(|id| self.full_name(id)).filter(|_| text.contains('/'));
                self.points.keys().map(|&name| name.to_owned()).chain(full).collect()
            }
            false => Vec::new(),
        };
        unknown_point::found(findings, (span, text), names.iter().map(String::as_str));
    }

    fn table_of(&self, point: PointId) -> Option<&'t PointTable> {
        self.table.points.get(point.0)
    }

    /// Where a point has its name.
    pub(super) fn place(&self, point: PointId) -> Option<Span> {
        self.table_of(point)?.name.as_ref().map(Spanned::span)
    }

    /// `RECORDER/NAME`.
    pub(super) fn full_name(&self, point: PointId) -> String {
        let name = self.table_of(point).and_then(|table| table.name.as_ref());
        let name = name.map_or("", |name| name.get_ref());
        match self.owner(point) {
            Some(owner) => format!("{}/{name}", self.recorder_name(owner)),
            None => name.to_owned(),
        }
    }
}
