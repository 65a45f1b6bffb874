//! Whether what is said of incidents is true.

use std::collections::BTreeMap;

use ser_evidence::site::Point;

use crate::adapter::{EventId, IncidentSaid, Said};
use crate::judge::{Judge, Judged, TOLERANCE_US};
use crate::recorder::TrueEntry;
use crate::true_time::{Ps, US};

impl<'a> Judge<'a> {
    pub(crate) fn incidents_are_true(&mut self) {
        for incident in self.said.incidents() {
            self.nothing_is_hidden(&incident);
            self.first_is_among_the_candidates(&incident);
            self.first_of_a_group_is_among_its_candidates(&incident);
            self.what_is_complete_is(&incident);
        }
    }

    /// Each change of its entries is there, and chatter hides no first change of an input.
    fn nothing_is_hidden(&mut self, incident: &IncidentSaid) {
        let inputs = |judged: &Judged<'a>| judged.row.entry.changed.numbers().count();
        let events: Vec<_> = self.events_of(incident);
        let changes: usize = events.iter().map(inputs).sum();
        if changes != incident.changes.len() {
            let told = incident.changes.len();
            self.fault("nothing hidden", format!("{changes} changes, and {told} rows"));
        }
        let mut first = BTreeMap::new();
        for &(event, input) in &incident.changes {
            first.entry((event.recorder, input)).or_insert((event, input));
        }
        for (shown, hidden) in &incident.folds {
            for change in hidden {
                let is_first = first.values().any(|first| first == change);
                if is_first || incident.first.contains(&change.0) && change.1 != shown.1 {
                    self.fault("nothing hidden", format!("{change:?} is folded into {shown:?}"));
                }
            }
        }
    }

    fn events_of(&self, incident: &IncidentSaid) -> Vec<Judged<'a>> {
        let rows = self.rows.iter().filter(|judged| incident.events.contains(&judged.row.event));
        rows.copied().collect()
    }

    /// What moved first is a candidate: the first entry of its recorder, or what is missing of it.
    fn first_is_among_the_candidates(&mut self, incident: &IncidentSaid) {
        let events = self.events_of(incident);
        let mut firsts: BTreeMap<(usize, usize), Judged<'a>> = BTreeMap::new();
        for judged in events {
            let of_life = firsts.entry((judged.row.recorder, judged.truth.life)).or_insert(judged);
            if judged.truth.total < of_life.truth.total {
                *of_life = judged;
            }
        }
        let Some(first) = firsts.values().map(|judged| judged.truth.moved().0).min() else {
            return;
        };
        for judged in firsts.values() {
            let is_first = judged.truth.moved().0 <= first;
            let is_named = self.is_named(incident, *judged, first + TOLERANCE_US * US);
            if is_first && !is_named {
                self.fault(
                    "first out",
                    format!("{:?} was first: {:?}", judged.row, incident.first),
                );
            }
        }
        self.missing_first_is_a_candidate(incident, first);
        self.no_candidate_was_later(incident);
    }

    /// Nothing is a candidate if something else is proven to have moved before it.
    fn no_candidate_was_later(&mut self, incident: &IncidentSaid) {
        for &first in &incident.first {
            let is_before = |&&other: &&EventId| self.said.order(other, first) == Said::Before;
            if let Some(earlier) = incident.events.iter().find(is_before) {
                self.fault("first out", format!("{earlier:?} was before {first:?}"));
            }
        }
        for change in &incident.first_changes {
            let same = self.said.same_movement(*change);
            if same.is_some_and(|same| incident.first_changes.contains(&same)) {
                self.fault("first out", format!("{change:?} is a candidate twice"));
            }
        }
    }

    /// The same for the inputs of each group.
    fn first_of_a_group_is_among_its_candidates(&mut self, incident: &IncidentSaid) {
        let points = &self.story.world.site.points;
        for (group, candidates) in &incident.groups {
            let is_of_group = |judged: &Judged<'a>, input: u8| {
                let is_it = |point: &&Point| {
                    (point.recorder.0, point.input) == (judged.row.recorder, input)
                };
                let point = points.iter().find(is_it);
                point.and_then(|point| point.group).is_some_and(|of| of.0 == *group)
            };
            let mut firsts: BTreeMap<(usize, usize), (u64, Ps)> = BTreeMap::new();
            for judged in self.events_of(incident) {
                for seen in judged.truth.moves.iter().filter(|s| is_of_group(&judged, s.input)) {
                    let new = (judged.truth.total, seen.at);
                    let key = (judged.row.recorder, judged.truth.life);
                    let known = firsts.entry(key).or_insert(new);
                    *known = new.min(*known);
                }
            }
            let Some(first) = firsts.values().map(|&(_, at)| at).min() else { continue };
            let named =
                |judged: &&Judged<'a>| candidates.iter().any(|change| change.0 == judged.row.event);
            let named = self.rows.iter().filter(named);
            let mut moments = named.flat_map(|judged| &judged.truth.moves).map(|seen| seen.at);
            if !moments.any(|at| at <= first + TOLERANCE_US * US) {
                self.fault("first out", format!("group {group} moved at {first}: {candidates:?}"));
            }
        }
    }

    /// Of what is said to be complete nothing is missing.
    fn what_is_complete_is(&mut self, incident: &IncidentSaid) {
        let find = |event: EventId| self.rows.iter().find(|judged| judged.row.event == event);
        let mut broken = Vec::new();
        for &(from, to) in &incident.unbroken {
            let (Some(from), Some(to)) = (find(from), find(to)) else { continue };
            let is_read = |total: u64| self.is_read(from.row.recorder, from.truth.life, total);
            let mut totals = from.truth.total..=to.truth.total;
            if let Some(total) = totals.find(|&total| !is_read(total)) {
                broken.push(format!("{:?} to {:?} lacks {total}", from.row, to.row));
            }
        }
        let moments = self.events_of(incident).into_iter().map(|judged| judged.truth.moved());
        let (firsts, lasts): (Vec<Ps>, Vec<Ps>) = moments.unzip();
        let (Some(first), Some(last)) = (firsts.iter().min(), lasts.iter().max()) else { return };
        // Where times are not known, entries may be put together that have nothing in common, and
        // others may be left out.
        let is_known = |event: EventId| matches!(self.said.utc(event, None), (Some(lo), Some(hi)) if hi - lo < 2_000_000);
        let are_known = incident.events.iter().all(|&event| is_known(event));
        let is_recorder_known = |recorder: usize| {
            let mut rows = self.rows.iter().filter(|judged| judged.row.recorder == recorder);
            rows.all(|judged| is_known(judged.row.event))
        };
        for &index in incident.complete.iter().filter(|&&i| are_known && is_recorder_known(i)) {
            let recorder = &self.story.world.recorders[index];
            // What was lost with a whole life, nobody can know.
            let mut entries = recorder.entries.iter().filter(|_| recorder.lives.len() == 1);
            let is_missing = |entry: &&TrueEntry| {
                let (moved, _) = entry.moved();
                first < &moved && &moved < last && !self.is_read(index, entry.life, entry.total)
            };
            if let Some(missing) = entries.find(is_missing) {
                let (total, time) = (missing.total, missing.entry.time);
                broken.push(format!("SER{} is complete, but lacks {total} {time}", index + 1));
            }
        }
        for text in broken {
            self.fault("complete incidents", text);
        }
    }

    fn is_read(&self, recorder: usize, life: usize, total: u64) -> bool {
        let mut mine = self.rows.iter().filter(|judged| judged.row.recorder == recorder);
        mine.any(|judged| judged.truth.life == life && judged.truth.total == total)
    }

    /// Whether it is a candidate, or another one is that moved at the same time; an entry may be
    /// there twice, if it was also read by its number.
    fn is_named(&self, incident: &IncidentSaid, judged: Judged<'a>, until: Ps) -> bool {
        let named = self.rows.iter().filter(|other| incident.first.contains(&other.row.event));
        let mut named = named.map(|other| other.truth);
        named.any(|truth| std::ptr::eq(truth, judged.truth) || truth.moved().0 <= until)
    }

    /// An entry that was overwritten and moved before all that is known of may have been first.
    fn missing_first_is_a_candidate(&mut self, incident: &IncidentSaid, first: Ps) {
        let quiet = self.story.world.site.incident.quiet_us * US;
        for (recorder, truth) in self.story.world.recorders.iter().enumerate() {
            let read = |life, total| self.is_read(recorder, life, total);
            let is_missing_first = |entry: &&TrueEntry| {
                let (moved, _) = entry.moved();
                first - quiet < moved && moved < first && !read(entry.life, entry.total)
            };
            // With entries of the life on both sides, the sequence tells that something is missing.
            let is_told = |entry: &&TrueEntry| {
                let mine = self.rows.iter().filter(|j| {
                    j.row.life.is_known()
                        && (j.row.recorder, j.truth.life) == (recorder, entry.life)
                });
                let is_after_one = mine.clone().any(|j| j.truth.total < entry.total);
                let later = mine.filter(|j| j.truth.total > entry.total);
                let next = later.min_by_key(|j| j.truth.total);
                is_after_one && next.is_some_and(|next| incident.events.contains(&next.row.event))
            };
            let missing = truth.entries.iter().filter(is_missing_first).find(is_told);
            if let Some(missing) = missing
                && !incident.first_may_be_missing_of.contains(&recorder)
            {
                let (total, time) = (missing.total, missing.entry.time);
                let events: Vec<_> = self.events_of(incident).into_iter().map(|j| j.row).collect();
                let gaps = &incident.first_may_be_missing_of;
                let text = format!(
                    "SER{} {total} {time} is missing of {events:?}, {gaps:?}",
                    recorder + 1
                );
                self.fault("first out", text);
            }
        }
    }
}
