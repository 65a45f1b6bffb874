//! `print`: the recorder prints entries on its RS-232 port, to which this computer is connected.

use std::io::{self, Write};
use std::ops::Range;
use std::time::{Duration, Instant};

use ser_client::{LineRate, TextLine, Unsolicited};
use ser_proto::TimeStamp;

use crate::connection::{self, ConnectionArgs};
use crate::error::{Failure, Result, inform, warn};
use crate::time::{ClockStep, parse_time};
use crate::values;

const EXAMPLES: &str = "\
Examples:
  ser-cli print --from 1 --count 20";

/// More than the length of a line with 32 changes.
const LONGEST_LINE: usize = 300;

/// Make the recorder print entries as lines of text, and show them.
///
/// The recorder prints on its RS-232 port, however the command reached it. Through a terminal
/// server or a printer sharer the lines arrive here only if they are passed on. The command ends
/// when all lines are there, or when no more come.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// Number of the first entry.
    #[arg(long, value_name = "N", value_parser = values::entries())]
    from: u16,

    /// How many entries.
    #[arg(long, value_name = "N", value_parser = values::entries())]
    count: u16,
}

pub(crate) fn run(args: &Args, connection: &ConnectionArgs) -> Result<()> {
    let mut unit = connection::open(connection)?;
    unit.print(args.from, args.count)?;
    if unit.bus_address().is_some() {
        inform("the recorder prints on its RS-232 port: no line comes over the Genius bus");
        return Ok(());
    }
    let patience = connection.timeout.unwrap_or(Duration::from_secs(1))
        + LineRate::from(unit.bits_per_second()).time_for(LONGEST_LINE);
    let mut out = io::stdout().lock();
    let mut wanted = Wanted::new(args.from, args.count);
    let mut clock = PrintedClock(None);
    let mut until = Instant::now() + patience;
    while !wanted.is_complete() {
        match unit.wait_event(until.saturating_duration_since(Instant::now()))? {
            None => break,
            Some(Unsolicited::Report(_)) => {}
            Some(Unsolicited::Line(line)) if wanted.take(&line) => {
                if let Some(step) = clock.step_to(&line.text) {
                    warn(format_args!("before the next line, {step}"));
                }
                writeln!(out, "{}", line.text)?;
                out.flush()?;
                until = Instant::now() + patience;
            }
            Some(Unsolicited::Line(line)) => tell_left_out(&line),
        }
    }
    if wanted.missing > 0 || (wanted.damaged > 0 && !wanted.is_complete()) {
        return Err(Failure::new("requested lines arrived damaged or not at all")
            .hint("repeat the command")
            .hint("ser-cli read gets the same entries protected by checksums"));
    }
    if !wanted.is_complete() {
        inform(format_args!(
            "{} of {} lines came; only entries that exist are printed",
            wanted.printed, args.count
        ));
    }
    Ok(())
}

/// Reports damage, or lines that the recorder prints automatically (auto print).
fn tell_left_out(line: &TextLine) {
    match is_damaged(line) {
        true => warn(format_args!("a line arrived damaged and is left out: {}", line.text)),
        false => inform(format_args!("not requested, left out: {}", line.text)),
    }
}

fn is_damaged(line: &TextLine) -> bool {
    line.noise > 0 || line.cut
}

/// The lines that are to come. A recorder with auto print on sends other lines in between.
struct Wanted {
    /// Entry numbers that have not come yet.
    entries: Range<u32>,
    printed: u16,
    /// Lines missing before one that came.
    missing: u32,
    /// Damaged lines, whether ours or not, which cannot be known.
    damaged: u32,
}

impl Wanted {
    fn new(from: u16, count: u16) -> Wanted {
        let from = u32::from(from);
        Wanted { entries: from..from + u32::from(count), printed: 0, missing: 0, damaged: 0 }
    }

    fn is_complete(&self) -> bool {
        self.entries.is_empty()
    }

    /// Whether the line is one of them.
    fn take(&mut self, line: &TextLine) -> bool {
        if is_damaged(line) {
            self.damaged += 1;
            return false;
        }
        let Some(number) = entry_number(&line.text).filter(|number| self.entries.contains(number))
        else {
            return false;
        };
        self.missing += number - self.entries.start;
        self.entries.start = number + 1;
        self.printed += 1;
        true
    }
}

/// The time of the previous line, to tell where the recorder's clock did not go on.
struct PrintedClock(Option<TimeStamp>);

impl PrintedClock {
    /// The step to a line's time, unless the clock simply went on or one of the two is no date.
    fn step_to(&mut self, line: &str) -> Option<ClockStep> {
        let later = time_of(line);
        let earlier = std::mem::replace(&mut self.0, later);
        let step = ClockStep::between(earlier?, later?)?;
        (step != ClockStep::Forward).then_some(step)
    }
}

/// The time of an entry's line, as in `0001 2026-11-22 10:00:00.250  3 ON`.
fn time_of(line: &str) -> Option<TimeStamp> {
    let mut words = line.split_whitespace().skip(1);
    parse_time(&format!("{} {}", words.next()?, words.next()?)).ok()
}

/// The number at the beginning of an entry's line: four digits or more, and a blank. A line whose
/// beginning is missing has none.
fn entry_number(line: &str) -> Option<u32> {
    let (number, _) = line.split_once(' ')?;
    let is_number = number.len() >= 4 && number.bytes().all(|byte| byte.is_ascii_digit());
    number.parse().ok().filter(|_| is_number)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_that_does_not_go_on_is_told_between_two_lines() {
        let mut clock = PrintedClock(None);
        let mut step = |time: &str| clock.step_to(&format!("0001 {time}  3 ON"));
        assert_eq!(step("2026-11-22 10:00:00.250"), None);
        assert_eq!(step("2026-11-22 10:00:00.250"), None);
        assert_eq!(step("2026-11-22 10:00:00.249"), Some(ClockStep::Back));
        assert_eq!(step("2069-12-31 23:59:59.999"), None);
        assert_eq!(step("1970-01-01 00:00:00.000"), Some(ClockStep::YearsBeganAnew));
        assert_eq!(step("2026-00-22 10:00:00.250"), None);
        assert_eq!(step("1970-01-01 00:00:00.000"), None);
    }

    fn line(text: &str) -> TextLine {
        TextLine { text: text.to_string(), ..TextLine::default() }
    }

    #[test]
    fn a_line_belongs_to_the_entry_that_it_begins_with() {
        assert_eq!(entry_number("0007 2026-11-22 10:00:00.250  3 ON"), Some(7));
        assert_eq!(entry_number("2048 2026-11-22 10:00:00.250  3 ON"), Some(2048));
        for fragment in [
            "",
            "0007",
            "007 2026-11-22",
            "2026-11-22 10:00:00.250",
            "*** 3 EVENTS NOT PRINTED ***",
            "+007 x",
        ] {
            assert_eq!(entry_number(fragment), None, "{fragment}");
        }
    }

    #[test]
    fn only_what_was_asked_for_is_printed_and_in_order() {
        let mut wanted = Wanted::new(6, 3);
        let mut take = |text: &str| wanted.take(&line(text));
        assert!(!take("2026-11-22 10:00:00.250  3 ON"), "a fragment");
        assert!(!take("0777 2026-11-22 10:00:00.250  3 ON"), "a new event");
        assert!(take("0006 x") && !take("0006 x") && take("0007 x") && !take("0006 x"));
        assert!(!take("0009 x") && take("0008 x") && !take("0008 x"));
        assert!(
            wanted.is_complete()
                && wanted.printed == 3
                && wanted.missing == 0
                && wanted.damaged == 0
        );
    }

    #[test]
    fn damaged_and_missing_lines_are_counted() {
        let mut wanted = Wanted::new(1, 3);
        assert!(!wanted.take(&TextLine { noise: 1, ..line("0001 x") }));
        assert!(!wanted.take(&TextLine { cut: true, ..line("0001 x") }));
        assert!(wanted.take(&line("0003 x")));
        assert_eq!((wanted.printed, wanted.missing, wanted.damaged), (1, 2, 2));
        assert!(wanted.is_complete());
    }
}
