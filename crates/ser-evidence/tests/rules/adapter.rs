//! What the crate says of a story, in the judge's own words. Nothing else here calls the crate.

use std::fmt;

use ser_evidence::clock::{Finding, Home};
use ser_evidence::history::{Collector, History};
use ser_evidence::incident::{Completeness, FirstOut, Fold, Incident, Report, Which};
use ser_evidence::record::{Boot, Life, Told};
use ser_evidence::site::{GroupId, Site};
use ser_evidence::time::{Moment, Utc};
use ser_evidence::timeline::{ChangeId, ContactTrouble, Order, Timeline};
use ser_proto::{Entry, Inputs};

pub(crate) use ser_evidence::time::Bound;
pub(crate) use ser_evidence::timeline::EventId;

/// Puts all records of these sources together.
pub(crate) fn history(site: &Site, sources: &[Vec<Told>]) -> History {
    let mut collector = Collector::new();
    for source in sources {
        collector.begin_source();
        for told in source {
            collector.add(&told.recorder, &told.record);
        }
    }
    collector.finish(site)
}

/// Both ends of what is said, in microseconds.
pub(crate) type Ends = (Option<i64>, Option<i64>);

/// A row of the list.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) struct Row {
    pub(crate) event: EventId,
    /// Index of the recorder in the site.
    pub(crate) recorder: usize,
    pub(crate) life: Life,
    pub(crate) sequence: u64,
    /// Whether it was read by its number, so that the sequence says nothing.
    pub(crate) is_by_number: bool,
    pub(crate) entry: Entry,
    /// The inputs whose state is known.
    pub(crate) known: Inputs,
}

/// As `SER2 9f3c5a7e21b04d68 17 2026-11-22T10:00:00.250`.
impl fmt::Debug for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Row { recorder, life, sequence, entry, .. } = self;
        write!(f, "SER{} {life} {sequence} {}", recorder + 1, entry.time)
    }
}

/// What is said of the order of two entries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Said {
    Before,
    After,
    Same,
    Unknown,
}

/// All that the crate says.
pub(crate) struct Sayings<'a> {
    timeline: Timeline<'a>,
    pub(crate) rows: Vec<Row>,
}

impl<'a> Sayings<'a> {
    pub(crate) fn of(site: &'a Site, history: &'a History) -> Sayings<'a> {
        let timeline = Timeline::new(site, history);
        let rows = timeline.entries().map(|event| row(&timeline, event)).collect();
        Sayings { timeline, rows }
    }

    /// When the contact moved, in UTC.
    pub(crate) fn utc(&self, event: EventId, input: Option<u8>) -> Ends {
        let bound: Bound<Utc> = self.timeline.moved_utc(event, input);
        (bound.lo().map(Moment::us), bound.hi().map(Moment::us))
    }

    /// When the contact moved, by the monotonic clocks of hosts.
    pub(crate) fn on_hosts(&self, event: EventId, input: Option<u8>) -> Vec<(Boot, Ends)> {
        let all = self.timeline.moved_on(event, input).into_iter();
        let on_host = |(home, ends)| match home {
            Home::Boot(boot) => Some((boot, ends)),
            Home::Utc => None,
        };
        all.filter_map(on_host).collect()
    }

    pub(crate) fn order(&self, one: EventId, other: EventId) -> Said {
        match self.timeline.order(one, other) {
            Order::Before => Said::Before,
            Order::After => Said::After,
            Order::Same => Said::Same,
            Order::Unknown => Said::Unknown,
        }
    }

    /// From one change to the other.
    pub(crate) fn delta(&self, one: Change, other: Change) -> Ends {
        let change = |(event, input)| ChangeId { event, input };
        let delta = self.timeline.delta(change(one), change(other));
        (delta.lo_us, delta.hi_us)
    }

    /// What says that something is wrong with what was observed.
    pub(crate) fn contradictions(&self) -> Vec<String> {
        let told = |finding: &&Finding| !matches!(finding, Finding::NotPlaced { .. });
        let findings = self.timeline.findings().iter().filter(told);
        let findings = findings.map(|finding| format!("{finding:?}"));
        let pairs = self.timeline.out_of_order().iter().map(|pair| format!("{pair:?}"));
        findings.chain(pairs).collect()
    }

    /// Changes of a contact that another recorder is said not to have seen, or at another time.
    pub(crate) fn lonely_changes(&self) -> Vec<(Change, bool)> {
        let all = self.timeline.contact_findings().iter();
        let is_missing = |trouble| trouble == ContactTrouble::Missing;
        all.map(|f| ((f.change.event, f.change.input), is_missing(f.trouble))).collect()
    }

    /// The change of another recorder that is said to be the same movement.
    pub(crate) fn same_movement(&self, (event, input): Change) -> Option<Change> {
        let same = self.timeline.same_movement(ChangeId { event, input })?;
        Some((same.event, same.input))
    }

    /// What was shown at observations that are told to be of no use.
    pub(crate) fn not_placed_us(&self) -> Vec<i64> {
        let shown_us = |finding: &Finding| match finding {
            Finding::NotPlaced { shown, .. } => Some(*shown),
            _ => None,
        };
        self.timeline.findings().iter().filter_map(shown_us).collect()
    }

    /// All conflicts of a recorder: life, sequence, and both entries.
    pub(crate) fn conflicts(&self) -> Vec<(usize, Life, u64, [Entry; 2])> {
        let recorders = self.timeline.history().recorders.iter();
        let of = recorders.flat_map(|history| {
            let recorder = history.site.map_or(usize::MAX, |site| site.0);
            let all = history.conflicts.iter();
            all.map(move |c| (recorder, c.life, c.sequence, [c.shown, c.other]))
        });
        of.collect()
    }
}

fn row(timeline: &Timeline<'_>, event: EventId) -> Row {
    let recorder = timeline.recorder(event).expect("an event has a recorder");
    let life = timeline.life(event).expect("an event has a life");
    let held = timeline.held(event).expect("an event has an entry");
    Row {
        event,
        recorder: recorder.site.expect("it is in the site").0,
        life: life.name(),
        sequence: held.sequence,
        is_by_number: life.is_by_number,
        entry: held.entry,
        known: held.known,
    }
}

/// One input in one entry.
pub(crate) type Change = (EventId, u8);

/// What is said of one incident.
pub(crate) struct IncidentSaid {
    pub(crate) events: Vec<EventId>,
    /// All changes, in order.
    pub(crate) changes: Vec<Change>,
    /// What may have moved first of all: entries, and recorders of which something is missing.
    pub(crate) first: Vec<EventId>,
    pub(crate) first_changes: Vec<Change>,
    pub(crate) first_may_be_missing_of: Vec<usize>,
    /// The same for each group, with the group's index.
    pub(crate) groups: Vec<(usize, Vec<Change>)>,
    /// The recorders of which nothing is said to be missing.
    pub(crate) complete: Vec<usize>,
    /// From which entry to which nothing is said to be missing.
    pub(crate) unbroken: Vec<(EventId, EventId)>,
    /// Chatter: the change that is shown, and those that are folded into it.
    pub(crate) folds: Vec<(Change, Vec<Change>)>,
}

impl Sayings<'_> {
    /// What is said of every incident.
    pub(crate) fn incidents(&self) -> Vec<IncidentSaid> {
        let all = Incident::all(&self.timeline);
        let firsts = all.iter().filter_map(|incident| incident.events.first());
        let keys = firsts.filter_map(|&first| self.timeline.sort_key(first));
        let moments = keys.map(Moment::from_us);
        let around = moments.map(|moment| Which::Around(moment, moment));
        let picked = around.filter_map(|which| Incident::pick(&self.timeline, which));
        picked.map(|incident| self.incident(incident)).collect()
    }

    fn incident(&self, incident: Incident) -> IncidentSaid {
        let report = Report::new(&self.timeline, incident);
        let change = |change: ChangeId| (change.event, change.input);
        let recorder = |&(event, _): &(EventId, usize)| {
            let recorder = self.timeline.recorder(event).expect("an event has a recorder");
            recorder.site.expect("it is in the site").0
        };
        let fold = |fold: &Fold| {
            let hidden = fold.changes.iter().filter(|&&one| one != fold.first);
            (change(fold.first), hidden.map(|&one| change(one)).collect())
        };
        let site_index = |completeness: &&Completeness| {
            let histories = &self.timeline.history().recorders;
            let index = usize::try_from(completeness.recorder).expect("an index");
            histories[index].site.expect("it is in the site").0
        };
        let complete = report.completeness.iter().filter(|recorder| recorder.is_complete());
        let unbroken = report.completeness.iter().filter_map(|one| one.unbroken);
        let group = |(group, first): &(GroupId, FirstOut)| {
            (group.0, first.changes.iter().map(|&one| change(one)).collect())
        };
        IncidentSaid {
            groups: report.groups.iter().map(group).collect(),
            complete: complete.map(|recorder| site_index(&recorder)).collect(),
            unbroken: unbroken.map(|(first, last)| (first.event, last.event)).collect(),
            events: report.incident.events,
            changes: report.rows.iter().map(|row| change(row.change)).collect(),
            first_changes: report.first_out.changes.iter().map(|&one| change(one)).collect(),
            first: report.first_out.changes.iter().map(|change| change.event).collect(),
            first_may_be_missing_of: report.first_out.gaps.iter().map(recorder).collect(),
            folds: report.chatter.iter().map(fold).collect(),
        }
    }
}
