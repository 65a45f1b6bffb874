//! What a recorder prints. Every line is an event of the ledger, or says how many events have no
//! line.

use chrono::NaiveDateTime;

use super::ledger::Ledger;

/// The characters of date and time, after the entry number and a space.
const STAMP: std::ops::Range<usize> = 5..28;

/// The lines of one recorder.
#[derive(Clone, Debug, Default)]
pub struct Printout {
    line: String,
    events: u64,
    /// Events and edges for which there is no line.
    missing: u64,
    /// Events among them.
    unprinted: u64,
}

impl Printout {
    /// Takes a character that the recorder prints.
    ///
    /// # Errors
    /// When it completes a line that is not true.
    pub fn take(&mut self, character: u8, ledger: &Ledger) -> Result<(), String> {
        if character != b'\n' {
            self.line.push(character.into());
            return Ok(());
        }
        let line = std::mem::take(&mut self.line);
        let line = line.trim_end_matches('\r');
        if let Some((count, what)) = count_missing(line) {
            self.missing += count;
            self.unprinted += if what == UNPRINTED { count } else { 0 };
            return Ok(());
        }
        self.events += 1;
        let known = event(line).is_some_and(|(stamp_ms, changed, on)| {
            ledger.latest().any(|event| {
                (event.stamp_ms, event.changed, event.state & event.changed)
                    == (stamp_ms, changed, on)
            })
        });
        if known { Ok(()) } else { Err(format!("this line is printed and no event: {line:?}")) }
    }

    /// How many events were reported as not printed.
    #[must_use]
    pub fn unprinted(&self) -> u64 {
        self.unprinted
    }

    /// The number of events printed, by command or automatically, and the number of events and
    /// edges reported as not printed.
    #[must_use]
    pub fn counts(&self) -> (u64, u64) {
        (self.events, self.missing)
    }
}

/// What a line says of events that have none.
const UNPRINTED: &str = "EVENTS NOT PRINTED";

/// `*** 12 EVENTS NOT PRINTED ***`: how many, and what.
fn count_missing(line: &str) -> Option<(u64, &str)> {
    let (count, what) = line.strip_prefix("*** ")?.strip_suffix(" ***")?.split_once(' ')?;
    let known = matches!(what, UNPRINTED | "INPUT CHANGES NOT RECORDED");
    Some((count.parse().ok().filter(|_| known)?, what))
}

/// `0001 2026-11-22 10:00:00.250  3 ON  17 OFF`: its stamp, the inputs, and those that are on.
fn event(line: &str) -> Option<(i64, u32, u32)> {
    let stamp = NaiveDateTime::parse_from_str(line.get(STAMP)?, "%Y-%m-%d %H:%M:%S%.3f").ok()?;
    let (mut changed, mut on) = (0, 0);
    let mut words = line.get(STAMP.end..)?.split_whitespace();
    while let Some(number) = words.next() {
        let bit = 1 << number.parse::<u32>().ok()?.checked_sub(1).filter(|bit| *bit < 32)?;
        changed |= bit;
        on |= match words.next()? {
            "ON" => bit,
            "OFF" => 0,
            _ => return None,
        };
    }
    Some((stamp.and_utc().timestamp_millis(), changed, on))
}
