//! What a run came to.

use std::fmt;

use super::account::Tally;
use super::conversation::Talk;
use super::ledger::Edges;

/// How much time passed, and how.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Hours {
    /// Virtual time in all.
    pub total_ms: u64,
    /// Of these, with a Genius bus, every bus scan lived through.
    pub bus_ms: u64,
    /// Steps of the simulation: where nothing happens, one of them is many milliseconds.
    pub steps: u64,
}

impl Hours {
    /// So much time has passed in one step.
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
    /// Of every byte, message and operation with its time.
    pub digest: u64,
    /// Operations and faults.
    pub operations: u64,
    /// The time.
    pub hours: Hours,
    /// What became of the edges, per recorder.
    pub edges: Vec<Edges>,
    /// How many events there were, per recorder.
    pub recorded: Vec<u64>,
    /// What became of the events, per reader.
    pub tallies: Vec<(&'static str, Tally)>,
    /// What was talked about on the line.
    pub line: Talk,
    /// What was talked about on the bus, per recorder.
    pub bus: Vec<Talk>,
    /// Events that the first recorder has printed, each one an event of the ledger; and events and edges that it has printed
    /// not to be printed.
    pub printed: (u64, u64),
    /// Damaged frames that an eight-bit checksum would have let through, stopped by the simulation.
    pub forged: u64,
}

#[expect(clippy::cast_precision_loss, reason = "for people")]
fn hours(ms: u64) -> f64 {
    ms as f64 / 3_600_000.0
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Hours { total_ms, bus_ms, steps } = self.hours;
        writeln!(f, "seed {}: digest {:016x}", self.seed, self.digest)?;
        writeln!(
            f,
            "  {:.2} h of virtual time, of these {:.2} h with a bus; {steps} steps, {} operations and faults",
            hours(total_ms),
            hours(bus_ms),
            self.operations,
        )?;
        for (number, (edges, recorded)) in self.edges.iter().zip(&self.recorded).enumerate() {
            let Edges { applied, recorded: in_events, stopped, filtered, queue_full, cut_off, undecided } =
                edges;
            writeln!(
                f,
                "  recorder {}: {applied} edges = {in_events} recorded (in {recorded} events) + {stopped} while stopped \
                 + {filtered} filtered + {queue_full} beyond the queue + {cut_off} cut off + {undecided} not decided",
                number + 1,
            )?;
        }
        for (name, tally) in &self.tallies {
            let Tally { delivered, overwritten, gone, unwatched, restarts, traceless, wrapped } = tally;
            writeln!(
                f,
                "  {name}: {delivered} events delivered + {overwritten} overwritten + {gone} gone with the log + \
                 {unwatched} not connected; log restarts: {restarts} told, {traceless} traceless; {wrapped} wraps missed",
            )?;
        }
        for (name, talk) in
            [("line", &self.line)].into_iter().chain(self.bus.iter().map(|talk| ("bus", talk)))
        {
            let Talk { answered, unanswered, readings, disturbed, reports, reports_followed, lines } = talk;
            writeln!(
                f,
                "  {name}: {answered} answers, {unanswered} requests unanswered, {readings} readings ({disturbed} \
                 disturbed), {reports} reports ({reports_followed} followed), {lines} lines",
            )?;
        }
        let (printed, missing) = self.printed;
        write!(
            f,
            "  {printed} events printed, {missing} said to be missing; {} damaged frames looked whole",
            self.forged
        )
    }
}
