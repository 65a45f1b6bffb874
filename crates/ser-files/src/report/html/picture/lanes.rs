//! The lanes of a picture: for each point that moved, which state it had when, and how surely.

use std::collections::{BTreeMap, BTreeSet, HashSet};

use ser_evidence::incident::{Incident, Row};
use ser_evidence::record::Why;
use ser_evidence::site::PointId;
use ser_evidence::timeline::{ChangeId, EventId, Timeline};
use ser_proto::Inputs;

use super::axis::Axis;
use crate::names;
use crate::report::marks::Marks;
use crate::report::{Clock, Document, sequence};

/// One point over the time of the incident.
#[derive(Debug)]
pub(in crate::report::html) struct Lane {
    pub(in crate::report::html) recorder: String,
    pub(in crate::report::html) point: String,
    /// What is said of it if it moved first, or may have.
    pub(super) first: Option<&'static str>,
    pub(super) stretches: Vec<Stretch>,
    pub(super) edges: Vec<Edge>,
}

/// A state over a time, in microseconds after the first change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Stretch {
    pub(super) from_us: i64,
    pub(super) to_us: i64,
    pub(super) state: State,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    Off {
        is_abnormal: bool,
    },
    On {
        is_abnormal: bool,
    },
    /// Something is missing there.
    Unknown,
}

/// A change, in microseconds after the first one, and how far it may be off.
#[derive(Clone, Debug)]
pub(super) struct Edge {
    pub(super) at_us: i64,
    /// Either way; `None` if nobody knows.
    pub(super) doubt_us: Option<i64>,
    /// What it is: point, state, time and doubt.
    pub(super) text: String,
}

/// All lanes, in the order in which their points moved first.
#[derive(Debug)]
pub(in crate::report::html) struct Lanes {
    pub(in crate::report::html) lanes: Vec<Lane>,
    by_input: BTreeMap<(u32, u8), usize>,
    /// When the first change was, in UTC.
    pub(super) origin_us: i64,
    /// From the earliest change to the latest one, after the first in the list.
    pub(super) least_us: i64,
    pub(super) most_us: i64,
    /// How many changes have no time, and are in no lane.
    pub(super) timeless: usize,
}

impl Lanes {
    /// The lanes of an incident; `None` if no change has a time.
    pub(in crate::report::html) fn new(document: &Document<'_>, clock: &Clock) -> Option<Lanes> {
        let Document { timeline, report, .. } = *document;
        let axis = Axis::new(document)?;
        let placed: Vec<(&Row, i64)> =
            report.rows.iter().filter_map(|row| Some((row, axis.of(row.change)?))).collect();
        let times = || placed.iter().map(|(_, at)| *at);
        let (least_us, most_us) = (times().min()?, times().max()?);
        let mut lanes = Lanes {
            lanes: Vec::new(),
            by_input: BTreeMap::new(),
            origin_us: axis.origin_us,
            least_us,
            most_us,
            timeless: report.rows.len() - placed.len(),
        };
        let mut points = BTreeMap::new();
        let marks = Marks::new(document);
        for (row, at_us) in placed {
            points.entry(key(row.change)).or_insert(row.point);
            lanes.add_edge(&marks, timeline, row, at_us, clock);
        }
        let margin = lanes.margin_us();
        let window = (least_us.saturating_sub(margin), most_us.saturating_add(margin));
        let (logs, nothing) = (Log::all(&report.incident), Log::default());
        for (&(recorder, input), &place) in &lanes.by_input {
            let point = points.get(&(recorder, input)).copied().flatten();
            let log = logs.get(&recorder).unwrap_or(&nothing);
            let of = Track { timeline, log, axis: &axis, input, point };
            if let Some(lane) = lanes.lanes.get_mut(place) {
                lane.stretches = of.stretches(window);
            }
        }
        Some(lanes)
    }

    /// What is shown before the first change and after the last one.
    pub(super) fn margin_us(&self) -> i64 {
        (self.most_us.saturating_sub(self.least_us) / 40).max(5_000)
    }

    /// The lane of a change.
    pub(in crate::report::html) fn of(&self, change: ChangeId) -> Option<usize> {
        self.by_input.get(&key(change)).copied()
    }

    fn add_edge(
        &mut self,
        marks: &Marks<'_>,
        timeline: &Timeline<'_>,
        row: &Row,
        at_us: i64,
        clock: &Clock,
    ) {
        let place = *self.by_input.entry(key(row.change)).or_insert_with(|| {
            self.lanes.push(Lane {
                recorder: names::recorder(timeline, row.change.event),
                point: names::point(timeline, row.point, row.change.input),
                first: None,
                stretches: Vec::new(),
                edges: Vec::new(),
            });
            self.lanes.len() - 1
        });
        let Some(lane) = self.lanes.get_mut(place) else { return };
        let doubt_us = sequence::doubt_us(timeline, row.change);
        let state = names::state(timeline, row.point, row.on);
        let doubt = doubt_us
            .map_or("doubt not known".to_owned(), |us| format!("± {}", crate::span::doubt(us)));
        let time = timeline.time(row.change.event).map(|at| clock.time(at.us()));
        let time = time.unwrap_or_else(|| "time not known".to_owned());
        let text = format!("{} {state}, {time} {doubt}", lane.point);
        if let Some(first) = marks.first(row.change) {
            lane.first = Some(first);
        }
        lane.edges.push(Edge { at_us, doubt_us, text });
    }
}

fn key(change: ChangeId) -> (u32, u8) {
    (change.event.recorder, change.input)
}

/// What an incident has of one recorder.
#[derive(Debug, Default)]
struct Log {
    events: Vec<EventId>,
    gaps: Vec<(EventId, usize)>,
    /// Gaps after all entries.
    last_gaps: Vec<(EventId, usize)>,
}

impl Log {
    /// Of all recorders, by their indices.
    fn all(incident: &Incident) -> BTreeMap<u32, Log> {
        let mut logs: BTreeMap<u32, Log> = BTreeMap::new();
        for &event in &incident.events {
            logs.entry(event.recorder).or_default().events.push(event);
        }
        let events: HashSet<EventId> = incident.events.iter().copied().collect();
        for &gap in &incident.gaps {
            let log = logs.entry(gap.0.recorder).or_default();
            match events.contains(&gap.0) {
                true => log.gaps.push(gap),
                false => log.last_gaps.push(gap),
            }
        }
        logs
    }
}

/// One input in the log of its recorder.
struct Track<'a> {
    timeline: &'a Timeline<'a>,
    log: &'a Log,
    axis: &'a Axis<'a>,
    input: u8,
    point: Option<PointId>,
}

impl Track<'_> {
    /// Its states over the window, one after the other.
    fn stretches(&self, (from_us, to_us): (i64, i64)) -> Vec<Stretch> {
        let mut stretches: Vec<Stretch> = Vec::new();
        let mut add = |from_us: i64, to_us: i64, state: State| {
            match stretches.last_mut() {
                Some(last) if last.state == state && last.to_us >= from_us => {
                    last.to_us = last.to_us.max(to_us);
                }
                _ if from_us < to_us => stretches.push(Stretch { from_us, to_us, state }),
                _ => {}
            };
        };
        let gaps: BTreeSet<EventId> = self
            .log
            .gaps
            .iter()
            .filter(|gap| self.concerns(gap))
            .map(|(event, _)| *event)
            .collect();
        let mut at_us = from_us;
        let mut state = None;
        let mut life = None;
        for &event in &self.log.events {
            let Some(next_us) = self.place(event) else { continue };
            let is_broken = gaps.contains(&event) || life.is_some_and(|life| life != event.life);
            let before = if is_broken { None } else { state.or_else(|| self.before(event)) };
            add(at_us, next_us, self.state(before));
            (at_us, life) = (next_us.max(at_us), Some(event.life));
            state = self.after(event).or(if is_broken { None } else { state });
        }
        let ends_in_gap = self.log.last_gaps.iter().any(|gap| self.concerns(gap));
        add(at_us, to_us, self.state(state.filter(|_| !ends_in_gap)));
        stretches
    }

    /// Whether what is missing may be about this input.
    fn concerns(&self, (event, index): &(EventId, usize)) -> bool {
        let gap = self.timeline.life(*event).and_then(|life| life.gaps.get(*index));
        gap.is_some_and(|gap| match gap.why {
            Why::NotRecorded(inputs) => Inputs(inputs).contains(self.input),
            _ => true,
        })
    }

    /// Where an entry is; where this input moved, if it did.
    fn place(&self, event: EventId) -> Option<i64> {
        let changed = self.timeline.held(event)?.entry.changed.contains(self.input);
        match changed {
            true => self.axis.of(ChangeId { event, input: self.input }),
            false => self.axis.of_entry(event),
        }
    }

    /// The state that an entry shows.
    fn after(&self, event: EventId) -> Option<bool> {
        self.timeline.held(event)?.state_of(self.input)
    }

    /// The state right before an entry.
    fn before(&self, event: EventId) -> Option<bool> {
        let changed = self.timeline.held(event)?.entry.changed.contains(self.input);
        self.after(event).map(|on| on != changed)
    }

    fn state(&self, on: Option<bool>) -> State {
        let is_abnormal = |on| names::is_abnormal(self.timeline, self.point, on) == Some(true);
        match on {
            None => State::Unknown,
            Some(true) => State::On { is_abnormal: is_abnormal(true) },
            Some(false) => State::Off { is_abnormal: is_abnormal(false) },
        }
    }
}
