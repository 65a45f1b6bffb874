//! The results of a run.

use std::fmt;

use super::account::Tally;
use super::conversation::Talk;
use super::ledger::Edges;
use super::questions::Answers;
use crate::digits::grouped;

/// How much time passed, and how.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Hours {
    /// Virtual time in all.
    pub total_ms: u64,
    /// Virtual time with a Genius bus, in which every bus scan is simulated.
    pub bus_ms: u64,
    /// Steps of the simulation. Where nothing happens, one step is many milliseconds.
    pub steps: u64,
}

impl Hours {
    /// Counts the time of one step.
    pub fn count(&mut self, ms: u64, on_bus: bool) {
        self.total_ms += ms;
        self.bus_ms += if on_bus { ms } else { 0 };
        self.steps += 1;
    }
}

/// A run that ended well.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Report {
    /// The seed.
    pub seed: u64,
    /// The digest of every byte, message and operation with its time.
    pub digest: u64,
    /// Operations and faults.
    pub operations: u64,
    /// The time.
    pub hours: Hours,
    /// What became of the edges, per recorder.
    pub edges: Vec<Edges>,
    /// How many events there were, per recorder.
    pub recorded: Vec<u64>,
    /// What questions of our extension were answered, per recorder.
    pub answers: Vec<Answers>,
    /// How often filters were set, per recorder.
    pub filters_set: Vec<u64>,
    /// What became of the events, per reader.
    pub tallies: Vec<(&'static str, Tally)>,
    /// What was talked about on the line.
    pub line: Talk,
    /// What was talked about on the bus, per recorder.
    pub bus: Vec<Talk>,
    /// The number of events that the first recorder has printed, each one an event of the ledger,
    /// and the number of events and edges that it reported as not printed.
    pub printed: (u64, u64),
    /// Damaged frames that an eight-bit checksum would have let through. The simulation stopped
    /// them.
    pub forged: u64,
}

#[expect(clippy::cast_precision_loss, reason = "for people")]
fn hours(ms: u64) -> f64 {
    ms as f64 / 3_600_000.0
}

impl Report {
    fn edge_rows(&self) -> Vec<Row> {
        let row = |what, count: fn(&Edges) -> u64| Row::new(what, self.edges.iter().map(count));
        vec![
            row("edges of contacts", |edges| edges.applied),
            row("= recorded", |edges| edges.recorded),
            row("+ while stopped", |edges| edges.stopped),
            row("+ shorter than debounce", |edges| edges.filtered),
            row("+ chatter, left out and counted", |edges| edges.chatter),
            row("+ beyond the queue, counted", |edges| edges.queue_full),
            row("+ cut off by the power", |edges| edges.cut_off),
            row("+ not decided yet", |edges| edges.undecided),
            row("where inputs came to rest, shown", |edges| edges.rests),
        ]
    }

    fn event_rows(&self) -> Vec<Row> {
        let tallies = || self.tallies.iter().map(|(_, tally)| tally);
        let row = |what, count: fn(&Tally) -> u64| Row::new(what, tallies().map(count));
        vec![
            row("events", Tally::accounted),
            row("= delivered, once and in order", |tally| tally.delivered),
            row("+ overwritten, reported", |tally| tally.overwritten),
            row("+ gone with the log, reported", |tally| tally.gone),
            row("+ gone before the first reading", |tally| tally.unreported.first_reading),
            row("+ gone, empty at the last look", |tally| tally.unreported.empty_log),
            row("+ gone, full again at the next look", |tally| tally.unreported.full_again),
            row("+ gone, not read since", |tally| tally.unreported.not_read_since),
            row("+ not connected", |tally| tally.unwatched),
            row("changes not recorded, reported", |tally| tally.unrecorded),
            row("log restarts reported", |tally| tally.restarts),
            row("log restarts without a trace", |tally| tally.traceless),
            row("total wrapped unseen", |tally| tally.wrapped),
        ]
    }

    fn answer_rows(&self) -> Vec<Row> {
        let row = |what, count: fn(&Answers) -> u64| Row::new(what, self.answers.iter().map(count));
        vec![
            row("times told, each true", |answers| answers.times),
            row("  with a mark", |answers| answers.marks),
            row("identities", |answers| answers.identities),
            row("pages of counters", |answers| answers.counters),
            row("pages of filters", |answers| answers.filters),
            Row::new("filters set", self.filters_set.iter().copied()),
        ]
    }

    fn talk_rows(&self) -> Vec<Row> {
        let talks = || [&self.line].into_iter().chain(&self.bus);
        let row = |what, count: fn(&Talk) -> u64| Row::new(what, talks().map(count));
        vec![
            row("requests answered", |talk| talk.answered),
            row("requests given up", |talk| talk.unanswered),
            row("readings to the end", |talk| talk.readings),
            row("readings disturbed", |talk| talk.disturbed),
            row("reports", |talk| talk.reports),
            row("lines of text", |talk| talk.lines),
        ]
    }
}

/// A line of a table: what is counted, and a number for each column.
struct Row {
    what: &'static str,
    counts: Vec<String>,
}

impl Row {
    fn new(what: &'static str, counts: impl Iterator<Item = u64>) -> Row {
        Row { what, counts: counts.map(grouped).collect() }
    }
}

fn table<'a>(
    f: &mut fmt::Formatter<'_>,
    heads: impl Iterator<Item = &'a str>,
    rows: &[Row],
) -> fmt::Result {
    write!(f, "\n  {:36}", "")?;
    heads.into_iter().try_for_each(|head| write!(f, "  {head:>15}"))?;
    for row in rows {
        write!(f, "\n  {:36}", row.what)?;
        row.counts.iter().try_for_each(|count| write!(f, "  {count:>15}"))?;
    }
    writeln!(f)
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Hours { total_ms, bus_ms, steps } = self.hours;
        writeln!(f, "seed {}, digest {:016x}", self.seed, self.digest)?;
        writeln!(
            f,
            "  {:.2} h of virtual time, {:.2} h of them on a bus; {} steps, {} operations and \
             faults",
            hours(total_ms),
            hours(bus_ms),
            grouped(steps),
            grouped(self.operations),
        )?;
        table(f, ["recorder 1", "recorder 2"].into_iter(), &self.edge_rows())?;
        table(f, ["recorder 1", "recorder 2"].into_iter(), &self.answer_rows())?;
        table(f, self.tallies.iter().map(|&(name, _)| name), &self.event_rows())?;
        writeln!(f, "  why some of what is gone leaves no trace: docs/guarantees.md, \"Losses\"")?;
        table(f, self.tallies.iter().map(|&(name, _)| name), &self.talk_rows())?;
        let (printed, missing) = self.printed;
        write!(
            f,
            "\n  printed by recorder 1: {} events, {} said to be missing; {} damaged frames \
             looked whole",
            grouped(printed),
            grouped(missing),
            grouped(self.forged),
        )
    }
}
