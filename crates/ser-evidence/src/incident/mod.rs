//! The answer for one incident: what moved first, what operated, what is wrong, what is missing.
//!
//! `pick` finds the incident in the timeline; the other files each answer one question about it;
//! [`Report`] has all answers. Nothing here draws: texts and pages are made elsewhere from these
//! plain structs.

mod breakers;
mod chatter;
mod completeness;
mod contact_pairs;
mod digest;
mod expected;
mod first_out;
mod pick;
mod points;
mod returns;
mod suppressed;

pub use breakers::{Bounce, Operation};
pub use chatter::Fold;
pub use completeness::{ClockState, Completeness, StretchEnd};
pub use contact_pairs::Disagreement;
pub use expected::{Doubt, StepResult, Verdict};
pub use first_out::FirstOut;
pub use pick::{Incident, Which};
pub use points::Points;
pub use returns::Abnormal;
pub use suppressed::LeftOut;

use crate::site::{GroupId, PointId};
use crate::timeline::{ChangeId, Timeline};

/// One change in the incident.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Row {
    /// The change.
    pub change: ChangeId,
    /// Its point, if the site names it.
    pub point: Option<PointId>,
    /// Whether it went on; `None` if its source shows that it changed and not to what.
    pub on: Option<bool>,
    /// How many more changes of the same input follow as chatter: those rows are folded into this
    /// one by whoever shows it.
    pub chatter: Option<usize>,
}

/// All answers about one incident.
#[derive(Debug)]
pub struct Report {
    /// What belongs to the incident.
    pub incident: Incident,
    /// Its changes, in the order of the timeline. None is left out.
    pub rows: Vec<Row>,
    /// What moved first of all.
    pub first_out: FirstOut,
    /// What moved first in each group that wants to know, if anything in it moved.
    pub groups: Vec<(GroupId, FirstOut)>,
    /// Chatter, by its first change.
    pub chatter: Vec<Fold>,
    /// What was expected to follow.
    pub steps: Vec<StepResult>,
    /// What breakers did.
    pub operations: Vec<Operation>,
    /// Contact pairs that disagreed.
    pub disagreements: Vec<Disagreement>,
    /// Points that are not in their normal state at the end.
    pub abnormal: Vec<Abnormal>,
    /// What is complete and what is missing, for each recorder.
    pub completeness: Vec<Completeness>,
    /// SHA-256 of the entries of the incident, in their order.
    pub digest: [u8; 32],
}

impl Report {
    /// Answers everything about an incident.
    #[must_use]
    pub fn new(timeline: &Timeline<'_>, incident: Incident) -> Report {
        let points = Points::new(timeline);
        let mut rows = rows(timeline, &points, &incident);
        let chatter = chatter::folds(timeline, &rows);
        let mut folds = chatter.iter().peekable();
        for row in &mut rows {
            // Both are in the order of the timeline.
            let fold = folds.next_if(|fold| fold.first == row.change);
            row.chatter = fold.map(|fold| fold.changes.len());
        }
        Report {
            first_out: first_out::of_all(timeline, &incident),
            groups: first_out::of_groups(timeline, &points, &incident),
            steps: expected::results(timeline, &points, &incident, &rows),
            operations: breakers::operations(timeline, &rows),
            disagreements: contact_pairs::disagreements(timeline, &points, &incident, &rows),
            abnormal: returns::abnormal(timeline, &points, &incident, &rows),
            completeness: completeness::of_all(timeline, &incident),
            digest: digest::of(timeline, &incident),
            chatter,
            rows,
            incident,
        }
    }

    /// Whether something is missing in the incident, or may be.
    #[must_use]
    pub fn is_incomplete(&self) -> bool {
        self.completeness.iter().any(|recorder| !recorder.is_complete())
    }
}

fn rows(timeline: &Timeline<'_>, points: &Points, incident: &Incident) -> Vec<Row> {
    let mut rows = Vec::new();
    for &event in &incident.events {
        let Some(held) = timeline.held(event) else { continue };
        for input in held.entry.changed.numbers() {
            let change = ChangeId { event, input };
            let (point, on) = (points.of(change), held.state_of(input));
            rows.push(Row { change, point, on, chatter: None });
        }
    }
    rows
}
