//! Whether it is told that an observation is wrong, where that can be known.

use ser_evidence::record::{Record, Reference};

use crate::judge::Judge;
use crate::known::Known;
use crate::observing::Observed;

/// For what rounding adds up to.
const SLACK_US: i64 = 10;

impl Judge<'_> {
    /// One observation was made wrong. If another one of the same run, by the same host, rules it
    /// out, something has to be told.
    pub(crate) fn wrong_observation_is_told(&mut self) {
        let Some(told) = &self.story.planted else { return };
        let Record::Clock(wrong) = told.record else { return };
        let is_it = |observed: &&Observed| {
            let right = observed.observation;
            let reading = |at: Reference| match at {
                Reference::Host { reading, .. } => Some(reading),
                Reference::Utc(_) => None,
            };
            (right.how, right.shown, right.place) == (wrong.how, wrong.shown, wrong.place)
                && reading(right.at) == reading(wrong.at)
        };
        let Some(right) = self.story.observed.iter().find(is_it) else { return };
        let known = Known::of(self);
        // What it was before is not told.
        let mut others = known.observed_in_run_of_another(right);
        others.retain(|other| !std::ptr::eq(*other, right));
        let drift = i64::from(self.story.world.site.recorders[right.recorder].drift_ppb);
        let rules_out = |other: &&Observed| {
            let us = other.shown.shown_ms.abs_diff(right.shown.shown_ms) * 1000;
            let us = i64::try_from(us).expect("a time of the world");
            let growth = i64::try_from(i128::from(us) * i128::from(drift) / 1_000_000_000);
            let growth = growth.expect("less than the time") + SLACK_US;
            let Reference::Host { bound, reading } = other.observation.at else { return false };
            let Reference::Host { bound: wrong_bound, reading: wrong_reading } = wrong.at else {
                return false;
            };
            let from_shown = wrong.shown.us() - other.observation.shown.us();
            let moved = bound.shifted(from_shown - growth, from_shown + growth);
            let is_one_host = reading.boot == wrong_reading.boot;
            is_one_host && (moved.is_before(wrong_bound) || wrong_bound.is_before(moved))
        };
        if let Some(other) = others.into_iter().find(rules_out)
            && self.said.contradictions().is_empty()
            && !self.said.not_placed_us().contains(&wrong.shown.us())
        {
            self.fault("wrong observation", format!("{wrong:?} is ruled out by {other:?}"));
        }
    }
}
