//! The cost of single things: a run of the capture interrupt, a command.

use std::collections::BTreeMap;

use ser_node::capture::QUEUE_LEN;
use ser_proto::{AutoReport, Command, Configure, Decoded, FrameDecoder, MAX_BODY_LEN, TimeStamp};

use super::bench::{Bench, Parts, Setup};
use super::genius::Genius;
use super::program::{Handler, Program};
use super::tally::{Masked, Pass, Run, Tally};

/// When everything has started and taken its baseline, in milliseconds.
const STARTED_MS: u64 = 20;

/// The longest possible debounce time, in milliseconds. With it all bits of all counters are in
/// use.
pub const LONGEST_DEBOUNCE_MS: u8 = 255;

/// The shortest debounce time. With it the queue is full before the watchdog acts on the main loop.
pub const SHORTEST_DEBOUNCE_MS: u8 = 1;

/// How many changes the main loop may still take after it was told to hang.
const QUEUED_LATER: usize = 10;

/// How long after the host knows the recorder a GENI board and everybody on its bus are at rest.
const SETTLED_MS: u64 = 1_500;

/// The limit of every wait, in milliseconds of virtual time.
const LIMIT_MS: u64 = 30_000;

/// How long the line is silent when everything is said, in milliseconds.
const SILENT_MS: u64 = 10;

/// How long an idle board is measured, in milliseconds.
const IDLE_MS: u64 = 50;

/// Events in the log that is read.
const LOGGED: u64 = 40;

/// A time to set the clock to.
const TIME: TimeStamp =
    TimeStamp { year: 26, month: 11, day: 22, hour: 10, minute: 0, second: 0, millisecond: 0 };

/// Which contacts change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// None.
    None,
    /// Input 1.
    One,
    /// All 32 at once.
    All,
}

impl Change {
    /// All cases.
    pub const ALL: [Change; 3] = [Change::None, Change::One, Change::All];

    fn mask(self) -> u32 {
        match self {
            Change::None => 0,
            Change::One => 1,
            Change::All => u32::MAX,
        }
    }
}

/// Runs of one handler.
pub fn runs_of<'a>(tally: &'a Tally<'_>, handler: Handler) -> impl Iterator<Item = &'a Run> {
    tally.runs.iter().filter(move |run| run.handler == handler)
}

/// The longest run of the capture interrupt in which a change is accepted. If nothing changes, the
/// longest run of all.
///
/// # Errors
/// When the board does not do what it must.
pub fn capture(
    parts: &Parts,
    program: &Program,
    change: Change,
    debounce_ms: u8,
) -> Result<u64, String> {
    let mut bench = Bench::start(parts, program, Setup { debounce_ms, genius: false })?;
    pass(&mut bench, STARTED_MS)?;
    bench.tell(true);
    // The contacts move there and back.
    for _ in 0..2 {
        bench.toggle(change.mask());
        pass(&mut bench, u64::from(debounce_ms) + 5)?;
    }
    Ok(runs_of(&bench.tally, Handler::Capture).map(|run| run.instructions).max().unwrap_or(0))
}

/// The longest run of the capture interrupt when all inputs change and its queue is full because
/// the main loop hangs.
///
/// # Errors
/// When the board does not do what it must.
pub fn capture_beyond_queue(
    parts: &Parts,
    program: &Program,
    debounce_ms: u8,
) -> Result<u64, String> {
    let mut bench = Bench::start(parts, program, Setup { debounce_ms, genius: false })?;
    pass(&mut bench, STARTED_MS)?;
    bench.hang_main_loop();
    // The changes follow each other as fast as debounce accepts them. The first ones may still be
    // taken.
    for _ in 0..QUEUE_LEN + QUEUED_LATER {
        bench.toggle(u32::MAX);
        pass(&mut bench, u64::from(debounce_ms) + 1)?;
    }
    bench.tell(true);
    bench.toggle(u32::MAX);
    pass(&mut bench, u64::from(debounce_ms) + 2)?;
    Ok(runs_of(&bench.tally, Handler::Capture).map(|run| run.instructions).max().unwrap_or(0))
}

/// How interrupts are masked while the image starts, up to its first sample.
///
/// # Errors
/// When the board does not do what it must.
pub fn masked_at_start(parts: &Parts, program: &Program) -> Result<Masked, String> {
    let mut bench = Bench::start(parts, program, Setup { debounce_ms: 0, genius: false })?;
    bench.tell(true);
    bench.pass_ms()?;
    Ok(bench.tally.longest_masked)
}

/// When each of the counted capture interrupts began, in instructions.
#[must_use]
pub fn beginnings(tally: &Tally<'_>) -> Vec<u64> {
    runs_of(tally, Handler::Capture).map(|run| run.began).collect()
}

fn pass(bench: &mut Bench<'_>, ms: u64) -> Result<(), String> {
    (0..ms).try_for_each(|_| bench.pass_ms())
}

/// How a command reaches the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// RS-232.
    Line,
    /// Genius.
    Bus,
}

/// What a command cost, from its first byte to the last one of its reply, beyond what an idle board
/// does meanwhile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cost {
    /// Instructions of the main loop. A pass that costs less than an idle one counts as zero: with
    /// a full ring in front of the transmitter the loop does not look for what could be sent.
    pub main_loop: u64,
    /// Instructions of the serial interrupts.
    pub handlers: u64,
    /// The longest pass of the main loop.
    pub longest_pass: u64,
}

/// What idle passes of the main loop cost.
struct Idle {
    /// What most of them cost.
    usual: u64,
    /// What all others cost in addition, in sixteenths per millisecond.
    more_per_ms: u64,
}

impl Idle {
    fn of(passes: &[Pass], ms: u64) -> Idle {
        let mut counts = BTreeMap::new();
        for pass in passes {
            *counts.entry(pass.instructions).or_insert(0) += 1_u64;
        }
        let usual = counts
            .iter()
            .max_by_key(|(_, count)| **count)
            .map_or(0, |(instructions, _)| *instructions);
        let idle = Idle { usual, more_per_ms: 0 };
        Idle { more_per_ms: idle.beyond(passes) * 16 / ms.max(1), ..idle }
    }

    /// What passes cost beyond usual ones.
    fn beyond(&self, passes: &[Pass]) -> u64 {
        passes.iter().map(|pass| pass.instructions.saturating_sub(self.usual)).sum()
    }
}

/// A board with some events in its log, whose commands are counted.
pub struct Commands<'p> {
    bench: Bench<'p>,
    way: Way,
    idle: Idle,
    decoder: FrameDecoder<MAX_BODY_LEN>,
}

impl<'p> Commands<'p> {
    /// Switches a board on and waits until it is at rest.
    ///
    /// # Errors
    /// When the board does not do what it must.
    pub fn start(parts: &Parts, program: &'p Program, way: Way) -> Result<Commands<'p>, String> {
        let mut bench =
            Bench::start(parts, program, Setup { debounce_ms: 0, genius: way == Way::Bus })?;
        pass(&mut bench, STARTED_MS)?;
        for _ in 0..LOGGED {
            bench.toggle(u32::MAX);
            bench.pass_ms()?;
        }
        if way == Way::Bus {
            until(&mut bench, "the host knows the recorder", |bench| {
                bench.genius.as_ref().is_some_and(Genius::is_ready).then_some(())
            })?;
            pass(&mut bench, SETTLED_MS)?;
        }
        bench.tell(true);
        pass(&mut bench, 1)?;
        bench.tally.begin_anew();
        pass(&mut bench, IDLE_MS)?;
        let idle = Idle::of(&bench.tally.passes, IDLE_MS);
        Ok(Commands { bench, way, idle, decoder: FrameDecoder::new() })
    }

    /// What a pass of the main loop costs when there is nothing to do.
    #[must_use]
    pub fn idle_pass(&self) -> u64 {
        self.idle.usual
    }

    /// Has a command served, and counts its cost.
    ///
    /// # Errors
    /// When it is not answered.
    pub fn cost(&mut self, command: &Command) -> Result<Cost, String> {
        self.bench.tally.begin_anew();
        let began_ms = self.bench.now_ms();
        match (self.way, &mut self.bench.genius) {
            (Way::Bus, Some(genius)) => genius.send(command)?,
            _ => self.bench.send_command(command),
        }
        let Commands { bench, way, decoder, .. } = self;
        let what = format!("the answer to {command:?}");
        until(bench, &what, |bench| match (*way, &mut bench.genius) {
            (Way::Bus, Some(genius)) => genius.take_received().first().map(drop),
            _ => holds_frame(decoder, &bench.take_sent()).then_some(()),
        })?;
        // When the line is silent, the work that the reply leaves is done as well, printed lines
        // included.
        let mut silent_ms = 0;
        until(&mut self.bench, "the line falls silent", |bench| {
            silent_ms = if bench.take_sent().is_empty() { silent_ms + 1 } else { 0 };
            (silent_ms >= SILENT_MS).then_some(())
        })?;
        let ready = |bench: &mut Bench<'_>| {
            bench.genius.as_ref().is_none_or(Genius::is_ready).then_some(())
        };
        until(&mut self.bench, "the host is ready", ready)?;
        let ms = self.bench.now_ms() - began_ms;
        let tally = &self.bench.tally;
        let usual = self.idle.more_per_ms * ms / 16;
        let handlers = tally.runs.iter().filter(|run| run.handler != Handler::Capture);
        Ok(Cost {
            main_loop: self.idle.beyond(&tally.passes).saturating_sub(usual),
            handlers: handlers.map(|run| run.instructions).sum(),
            longest_pass: tally.passes.iter().map(|pass| pass.instructions).max().unwrap_or(0),
        })
    }
}

/// Whether these bytes end a frame.
fn holds_frame(decoder: &mut FrameDecoder<MAX_BODY_LEN>, bytes: &[u8]) -> bool {
    bytes
        .iter()
        .fold(false, |found, &byte| found | matches!(decoder.push(byte), Some(Decoded::Frame(_))))
}

/// Lets time pass until there is what is looked for.
fn until<T>(
    bench: &mut Bench<'_>,
    what: &str,
    mut look: impl FnMut(&mut Bench<'_>) -> Option<T>,
) -> Result<T, String> {
    for _ in 0..LIMIT_MS {
        bench.pass_ms()?;
        if let Some(found) = look(bench) {
            return Ok(found);
        }
    }
    Err(format!("{what}: not within {LIMIT_MS} ms"))
}

/// All commands and queries, with what to call them. The last one erases the log.
#[must_use]
pub fn commands() -> Vec<(&'static str, Command)> {
    let configure = Configure {
        size: None,
        baud: None,
        auto_report: AutoReport::Off,
        report_address: 0,
        auto_print: false,
    };
    vec![
        ("R  read 1 entry", Command::Read { start: 1, count: 1 }),
        ("R  read 10 entries", Command::Read { start: 1, count: 10 }),
        ("C  query configuration", Command::QueryConfiguration),
        ("C  configure, nothing new", Command::Configure(configure)),
        ("C  configure, stored", Command::Configure(Configure { size: Some(1024), ..configure })),
        ("M  query mode", Command::QueryMode),
        ("M  start recording", Command::SetMode { recording: true }),
        ("L  last broadcast", Command::LastBroadcast),
        ("S  set clock", Command::SetClock(TIME)),
        ("P  print 1 entry", Command::Print { start: 1, count: 1 }),
        ("E  erase", Command::Erase),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_usual_is_what_most_passes_cost() {
        let pass = |instructions| Pass { instructions, ..Pass::default() };
        let passes = [pass(600), pass(600), pass(640), pass(600)];
        let idle = Idle::of(&passes, 2);
        assert_eq!((idle.usual, idle.more_per_ms), (600, 20 * 16));
        assert_eq!(idle.beyond(&[pass(700), pass(600), pass(500)]), 100);
    }
}
