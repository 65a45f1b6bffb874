//! `genius broadcast mark`: what the clocks of all recorders showed at one moment.
//!
//! A recorder with our extension tells what its clock showed when the mark came. An original one
//! tells the time of day only. The day is the one that brings the time nearest to what the clock is
//! expected to show. Where nothing says that the expectation is right, the day is not known, and no
//! observation is made of it.

use std::io::{self, Write};

use ser_evidence::record::{ClockObservation, How, Record, Reference};
use ser_evidence::time::{Moment, Shown, shown, stamp};
use ser_observer::host_reading;
use ser_proto::{LastBroadcast, TimeStamp};

use super::super::clock::Format;
use super::check::{Check, Heard};
use crate::connection::ConnectionArgs;
use crate::error::{Result, advise, inform};
use crate::keeper::StateArgs;
use crate::kept::KeptRecords;
use crate::output;
use crate::time::{Delta, local_time_in};

const DAY_US: i64 = 86_400_000_000;

/// How far a clock of which something is remembered may be from where that puts it: a minute, and a
/// thousandth of the time since.
const REMEMBERED_US: i64 = 60_000_000;

/// How old the newest entry may be if it is all that tells the day.
const RECENT_US: i64 = DAY_US / 2;

/// How much later than now an entry may be stamped, because the clock was set back a little.
const SET_BACK_US: i64 = 60_000_000;

/// What a clock showed.
struct Row {
    node: u8,
    /// The time of day in microseconds.
    time_us: i64,
    /// With its day, if that is known.
    shown: Option<Moment<Shown>>,
}

/// A moment with its day, or why that is not known.
type Day = std::result::Result<Moment<Shown>, &'static str>;

/// Shows what the clocks showed and remembers it.
pub(super) fn run(
    connection: &ConnectionArgs,
    state: &StateArgs,
    checks: &[Check],
    format: Format,
) -> Result<()> {
    let mut told = Vec::new();
    let how = How::Mark { broadcast: getrandom::u64().map_err(io::Error::from)? };
    let (mut rows, mut doubts) = (Vec::new(), Vec::new());
    for check in checks {
        if check.heard != Heard::Yes {
            continue;
        }
        let kept = check.kept(connection, state)?;
        let Some((time_us, shown)) = showed(check, &kept) else { continue };
        match shown {
            Ok(shown) => {
                let observation = check.observation(how, shown);
                kept.add(std::slice::from_ref(&observation));
                told.push((check.name(connection)?, observation));
            }
            Err(why) => doubts.push(format!("device {}: {why}", check.node)),
        }
        rows.push(Row { node: check.node, time_us, shown: shown.ok() });
    }
    match format {
        Format::Text => write(&mut io::stdout().lock(), &rows)?,
        Format::Jsonl => {
            output::write_records(told.iter().map(|(name, record)| (name.as_str(), record)))?;
        }
    }
    doubts.iter().for_each(inform);
    if !doubts.is_empty() {
        advise("set a clock once (ser-cli genius broadcast clock) to have its day known");
    }
    Ok(())
}

/// What the clock showed when the mark came: its time of day, and with its day or why that is not
/// known.
fn showed(check: &Check, kept: &KeptRecords) -> Option<(i64, Day)> {
    if let Some(mark) = check.mark {
        let shown = Moment::from_us(mark.clock_us - mark.clock_us.rem_euclid(1000));
        stamp(shown)?;
        return Some((mark.clock_us.rem_euclid(DAY_US), Ok(shown)));
    }
    let Ok(Some(last)) = &check.after else { return None };
    let time_us = time_of_day_us(last);
    Some((time_us, day(time_us, &Hints::of(check, &kept.load()))))
}

fn write(out: &mut dyn Write, rows: &[Row]) -> Result<()> {
    writeln!(out, "node  showed                   to the first")?;
    for row in rows {
        let showed = match row.shown.and_then(stamp) {
            Some(stamp) => stamp.to_string(),
            None => time_text(row.time_us),
        };
        match rows.first().filter(|first| first.node != row.node) {
            Some(first) => {
                let delta = Delta::of_ms(difference_us(first, row) / 1000);
                writeln!(out, "{:>4}  {showed:<23}  {delta} ± 1 ms", row.node)?;
            }
            None => writeln!(out, "{:>4}  {showed}", row.node)?,
        }
    }
    Ok(out.flush()?)
}

/// From the first clock to another. Without days it is less than half of one, either way.
fn difference_us(first: &Row, row: &Row) -> i64 {
    match (first.shown, row.shown) {
        (Some(first), Some(shown)) => shown.since(first),
        _ => nearest(row.time_us - first.time_us, 0),
    }
}

fn time_of_day_us(last: &LastBroadcast) -> i64 {
    let seconds =
        (i64::from(last.hour) * 60 + i64::from(last.minute)) * 60 + i64::from(last.second);
    (seconds * 1000 + i64::from(last.millisecond)) * 1000
}

fn time_text(time_us: i64) -> String {
    let (ms, seconds) = (time_us / 1000 % 1000, time_us / 1_000_000);
    format!("{:02}:{:02}:{:02}.{ms:03}", seconds / 3600, seconds / 60 % 60, seconds % 60)
}

/// What may tell the day.
#[derive(Clone, Copy, Debug, Default)]
struct Hints {
    /// What the clock has to show by what is remembered of it, and how far it may be from that.
    remembered: Option<(i64, i64)>,
    /// What this computer's clock shows, in local time.
    local: Option<i64>,
    /// The stamp of the newest entry.
    newest: Option<i64>,
}

impl Hints {
    fn of(check: &Check, kept: &[Record]) -> Hints {
        let us = |time: &TimeStamp| shown(time).map(Moment::us);
        Hints {
            // What it says itself is best; the mark came a moment before.
            remembered: check
                .clock
                .map(|clock| (clock.clock_us, REMEMBERED_US))
                .or_else(|| remembered(kept)),
            local: local_time_in(std::time::Duration::ZERO).ok().as_ref().and_then(us),
            newest: check.look.and_then(|look| look.newest).and_then(|newest| us(&newest.time)),
        }
    }
}

/// What the clock has to show now by the last time that it was seen, unless it may have been set
/// since.
fn remembered(kept: &[Record]) -> Option<(i64, i64)> {
    let seen = kept.iter().rev().find(|record| match record {
        Record::Clock(ClockObservation { how, .. }) => {
            matches!(how, How::Set { .. } | How::Mark { .. })
        }
        Record::Step(_) => true,
        _ => false,
    })?;
    let Record::Clock(seen) = seen else { return None };
    let Reference::Host { bound, reading } = seen.at else { return None };
    let (now, middle) = (host_reading::now(), bound.middle()?);
    let passed_us = match now.boot == reading.boot {
        true => now.monotonic.since(middle),
        // Two boots meet in UTC.
        false => now.utc.since(reading.utc).saturating_add(reading.monotonic.since(middle)),
    };
    let doubt_us = REMEMBERED_US.saturating_add(passed_us.saturating_abs() / 1000);
    Some((seen.shown.us().saturating_add(passed_us), doubt_us))
}

/// The moment with this time of day, or why its day is not known.
fn day(time_us: i64, hints: &Hints) -> std::result::Result<Moment<Shown>, &'static str> {
    let is_after_newest = |moment: i64| {
        hints.newest.is_none_or(|newest| newest <= moment.saturating_add(SET_BACK_US))
    };
    if let Some((expected, doubt_us)) = hints.remembered {
        let moment = nearest(time_us, expected);
        if (moment - expected).abs() <= doubt_us && is_after_newest(moment) {
            return Ok(Moment::from_us(moment));
        }
    }
    let Some(newest) = hints.newest else {
        return Err(
            "the day is not known: the log is empty, and nothing is remembered of the clock",
        );
    };
    let moment = nearest(time_us, hints.local.unwrap_or(newest));
    if is_after_newest(moment) && moment - newest <= RECENT_US {
        return Ok(Moment::from_us(moment));
    }
    Err("the day is not known: the newest entry is more than 12 hours from this computer's time")
}

/// The moment with this time of day that is nearest to another moment.
fn nearest(time_us: i64, to_us: i64) -> i64 {
    let after = (time_us - to_us).rem_euclid(DAY_US);
    to_us + if after > DAY_US / 2 { after - DAY_US } else { after }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::parse_time;

    fn us(text: &str) -> i64 {
        shown(&parse_time(text).unwrap()).unwrap().us()
    }

    fn time(text: &str) -> i64 {
        us(&format!("1970-01-01T{text}"))
    }

    fn day_of(time_us: i64, hints: Hints) -> Option<String> {
        day(time_us, &hints).ok().map(|moment| stamp(moment).unwrap().to_string())
    }

    #[test]
    fn a_recent_entry_tells_the_day() {
        let at = |newest: &str, local: &str, showed: &str| {
            let hints =
                Hints { newest: Some(us(newest)), local: Some(us(local)), remembered: None };
            day_of(time(showed), hints)
        };
        let known = |text: &str| Some(text.to_owned());
        assert_eq!(
            at("2026-11-22T09:00:00", "2026-11-22T10:00:00", "10:00:00.250"),
            known("2026-11-22T10:00:00.250")
        );
        // Around midnight, and a clock in another zone.
        assert_eq!(
            at("2026-11-22T23:00:00", "2026-11-22T23:59:59", "00:00:00.100"),
            known("2026-11-23T00:00:00.100")
        );
        assert_eq!(
            at("2026-11-22T22:00:00", "2026-11-23T04:00:00", "23:00:00.000"),
            known("2026-11-22T23:00:00.000")
        );
        // An old entry, one from the future, and a clock that was never set.
        assert_eq!(at("2026-11-20T09:00:00", "2026-11-22T10:00:00", "10:00:00.250"), None);
        assert_eq!(at("2026-11-22T12:00:00", "2026-11-22T10:00:00", "10:00:00.250"), None);
        assert_eq!(at("2000-01-01T00:10:00", "2026-11-22T10:00:00", "00:11:00.000"), None);
    }

    #[test]
    fn what_is_remembered_of_the_clock_tells_the_day_as_long_as_it_is_true() {
        let expected = us("2026-11-22T10:00:00");
        let hints = |newest: Option<&str>| Hints {
            remembered: Some((expected, REMEMBERED_US)),
            local: Some(us("2026-11-25T10:00:00")),
            newest: newest.map(us),
        };
        let ten = Some("2026-11-22T10:00:00.250".to_owned());
        assert_eq!(day_of(time("10:00:00.250"), hints(None)), ten);
        assert_eq!(day_of(time("10:00:00.250"), hints(Some("2026-11-01T10:00:00"))), ten);
        assert_eq!(day_of(time("10:02:00.000"), hints(None)), None, "it has been set since");
        assert_eq!(day_of(time("10:00:00.250"), hints(Some("2026-11-22T11:00:00"))), None);
        assert_eq!(day_of(time("10:00:00.250"), Hints::default()), None);
    }

    #[test]
    fn the_table_shows_how_far_the_clocks_are_apart() {
        let row = |node, text: &str, is_known: bool| Row {
            node,
            time_us: time(text),
            shown: is_known.then(|| Moment::from_us(us(&format!("2026-11-22T{text}")))),
        };
        let rows = [
            row(5, "23:59:59.999", true),
            row(9, "23:59:59.997", true),
            row(12, "00:00:01.000", false),
        ];
        let mut out = Vec::new();
        write(&mut out, &rows).unwrap();
        assert_eq!(
            String::from_utf8(out).unwrap(),
            "node  showed                   to the first\n   \
             5  2026-11-22T23:59:59.999\n   \
             9  2026-11-22T23:59:59.997  -0.002 s ± 1 ms\n  \
             12  00:00:01.000             +1.001 s ± 1 ms\n"
        );
    }
}
