//! What a report says of single changes and entries, found without a search through all of it.

use std::collections::{HashMap, HashSet};

use ser_evidence::incident::Fold;
use ser_evidence::timeline::{ChangeId, EventId, Timeline};

use super::Document;

/// Indices into a report.
#[derive(Debug)]
pub(super) struct Marks<'d> {
    timeline: &'d Timeline<'d>,
    first_out: HashSet<ChangeId>,
    is_first_known: bool,
    folds: HashMap<ChangeId, &'d Fold>,
    /// Gaps by the entry that comes next, each by its index in the life.
    gaps: HashMap<EventId, Vec<usize>>,
    clock_sets: HashSet<EventId>,
}

impl<'d> Marks<'d> {
    pub(super) fn new(document: &Document<'d>) -> Marks<'d> {
        let Document { timeline, report, .. } = *document;
        let mut gaps: HashMap<EventId, Vec<usize>> = HashMap::new();
        for &(event, index) in &report.incident.gaps {
            gaps.entry(event).or_default().push(index);
        }
        Marks {
            timeline,
            first_out: match report.first_out.earlier {
                0 => report.first_out.changes.iter().copied().collect(),
                // What is before what is shown was first.
                _ => HashSet::new(),
            },
            is_first_known: report.first_out.known().is_some(),
            folds: report.chatter.iter().map(|fold| (fold.first, fold)).collect(),
            gaps,
            clock_sets: report.incident.clock_sets.iter().copied().collect(),
        }
    }

    /// Whether this change may have been first, or is one movement with one that may.
    pub(super) fn is_first(&self, change: ChangeId) -> bool {
        let is_here = |change: &ChangeId| self.first_out.contains(change);
        is_here(&change) || self.timeline.same_movement(change).as_ref().is_some_and(is_here)
    }

    /// What is said of a change that was first, or may have been.
    pub(super) fn first(&self, change: ChangeId) -> Option<&'static str> {
        let said = if self.is_first_known { "first-out" } else { "maybe first-out" };
        self.is_first(change).then_some(said)
    }

    /// The chatter that begins with this change.
    pub(super) fn fold(&self, first: ChangeId) -> Option<&'d Fold> {
        self.folds.get(&first).copied()
    }

    /// What is missing right ahead of an entry.
    pub(super) fn gaps_ahead_of(&self, event: EventId) -> &[usize] {
        self.gaps.get(&event).map_or(&[], Vec::as_slice)
    }

    /// Whether the clock was set ahead of an entry, or may have been.
    pub(super) fn is_set_ahead_of(&self, event: EventId) -> bool {
        self.clock_sets.contains(&event)
    }
}
