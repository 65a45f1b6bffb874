//! Expected steps in the picture: when each was to happen, and when it did.

use maud::{Markup, html};

use super::axis::Axis;
use super::frame::{FULL_PX, LANE_PX, LEFT_PX, NAMES_PX, px, shortened};
use super::scale::Scale;
use crate::names;
use crate::report::{Document, outcome};
use ser_evidence::incident::Verdict;

/// One expected step, in microseconds after the first change.
#[derive(Debug)]
pub(super) struct StepLane {
    name: String,
    result: &'static str,
    verdict: Verdict,
    pub(super) after_us: i64,
    /// The window in which it was to happen.
    within_us: (i64, i64),
    pub(super) then_us: Option<i64>,
}

/// The steps that began at a known time.
pub(super) fn lanes(document: &Document<'_>) -> Vec<StepLane> {
    let timeline = document.timeline;
    let Some(axis) = Axis::new(document) else { return Vec::new() };
    let lane = |step: &ser_evidence::incident::StepResult| {
        let expectation = timeline.site().expectations.get(step.expectation)?;
        let after_us = axis.of(step.after)?;
        let (from, to) = expectation.within_us;
        Some(StepLane {
            name: names::harmless(&expectation.name),
            result: outcome::result(step.verdict),
            verdict: step.verdict,
            after_us,
            within_us: (after_us.saturating_add(from), after_us.saturating_add(to)),
            then_us: step.then.and_then(|then| axis.of(then)),
        })
    };
    document.report.steps.iter().filter_map(lane).collect()
}

/// What is known of the time that a step took.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Took {
    InTime,
    NotInTime,
    NotDecidable,
}

impl Took {
    pub(super) const fn class(self) -> &'static str {
        match self {
            Took::InTime => "took good",
            Took::NotInTime => "took bad",
            Took::NotDecidable => "took open",
        }
    }
}

impl StepLane {
    pub(super) const fn took(&self) -> Took {
        match self.verdict {
            Verdict::InTime => Took::InTime,
            Verdict::NotDecidable(_) => Took::NotDecidable,
            _ => Took::NotInTime,
        }
    }

    pub(super) fn draw(&self, y: f64, scale: &Scale) -> Markup {
        let (from, to) = self.within_us;
        let (x, width) = scale.stretch(from, to).unwrap_or((LEFT_PX, 0.0));
        let took = self.then_us.map(|then| (self.after_us.min(then), self.after_us.max(then)));
        let class = self.took().class();
        html! {
            g.step {
                rect.back x="0" y=(y) width=(FULL_PX) height=(LANE_PX) {}
                text.name x=(NAMES_PX) y=(y + 15.0) {
                    title { (self.name) } (shortened(&self.name, 28))
                }
                text.recorder x=(NAMES_PX) y=(y + 27.0) { "expected: " (self.result) }
                rect.window data-a=(from) data-b=(to) x=(px(x)) y=(px(y + 7.0)) width=(px(width))
                    height="18" {}
                @if let Some((begin, end)) = took {
                    @let (x, width) = scale.stretch(begin, end).unwrap_or((LEFT_PX, 0.0));
                    rect class=(class) data-a=(begin) data-b=(end) x=(px(x)) y=(px(y + 14.0))
                        width=(px(width)) height="4" { title { (self.name) ": " (self.result) } }
                }
            }
        }
    }
}
