//! The event log of a `CyTime` recorder, as its web server gives it: JSON.
//!
//! Events come in a long form, with a field for each thing, or as four words in hexadecimal digits.
//! Seconds count from 1984 in the recorder's local time, or from 1970 in UTC where `posix` is in the
//! address. The content does not tell which, so the user is asked. `last` tells how much is in the
//! log.

use std::collections::HashSet;
use std::io::Read;

use jiff::civil;
use serde::Deserialize;
use serde_json::value::RawValue;

use super::calendar::{Date, SECOND_NS};
use super::list::{Change, Found, LAST_PLACE, List, Order, Row, To, When};
use super::notes::{Notes, Refusal};
use crate::error::quoted;

/// From when seconds count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Epoch {
    /// 1970, in UTC.
    Posix,
    /// 1984, in the recorder's local time.
    Local1984,
}

/// A log holds 8192 events, each in some 200 bytes.
const MOST_BYTES: usize = 16 << 20;

/// Types of events that are changes of an input.
const CHANGES: [u8; 2] = [1, 6];

/// The type of a change that was made in test mode.
const TEST: u8 = 27;

/// What the answers of the web server have.
#[derive(Deserialize)]
#[serde(expecting = "an answer of the recorder")]
struct Answer<'a> {
    #[serde(borrow)]
    events: Option<Vec<&'a RawValue>>,
    #[serde(rename = "NumberOfEvents")]
    count: Option<u64>,
    #[serde(rename = "LastSequenceNumber")]
    last: Option<u64>,
}

/// An event in either form.
#[derive(Deserialize)]
#[serde(expecting = "an event")]
struct Written<'a> {
    #[serde(borrow)]
    r: Option<std::borrow::Cow<'a, str>>,
    event_type: Option<u8>,
    channel: Option<u8>,
    status: Option<u8>,
    milliseconds: Option<u16>,
    seconds: Option<u32>,
    seq_num: Option<u64>,
    coincident: Option<u32>,
}

/// An event.
#[derive(PartialEq, Eq)]
struct Event {
    kind: u8,
    /// The input, from 1; 0 if the event is of none.
    input: u8,
    is_on: bool,
    milliseconds: u16,
    seconds: u32,
    sequence: Option<u64>,
    /// Other inputs that changed in the same millisecond.
    coincident: u32,
}

/// An event and where it is from.
struct Placed {
    line: u64,
    /// Whether an event before it was left out.
    is_torn: bool,
    event: Event,
}

/// Whether a file begins like such an answer. A text may be called `events`; only a key counts.
pub(super) fn is_it(head: &str) -> bool {
    let head = head.trim_start();
    let is_key = |name: &str| {
        head.match_indices(name).any(|(at, _)| {
            head.get(at + name.len()..).is_some_and(|rest| rest.trim_start().starts_with(':'))
        })
    };
    head.starts_with('{') && ["\"events\"", "\"NumberOfEvents\""].into_iter().any(is_key)
}

/// Reads an answer.
pub(super) fn read(
    input: impl Read,
    epoch: Option<Epoch>,
    found: &mut Found,
    notes: &mut Notes,
) -> Result<(), Refusal> {
    let mut bytes = Vec::new();
    let limit = u64::try_from(MOST_BYTES).unwrap_or(u64::MAX) + 1;
    input.take(limit).read_to_end(&mut bytes).map_err(Refusal::Io)?;
    if bytes.len() > MOST_BYTES {
        return Err(Refusal::TooMuch { what: "bytes, and no such log has", most: limit - 1 });
    }
    let text = String::from_utf8_lossy(&bytes);
    let answer: Answer<'_> = serde_json::from_str(&text).map_err(|error| {
        let line = u64::try_from(error.line()).unwrap_or(u64::MAX);
        let what = error.to_string();
        let what = what.rsplit_once(" at line ").map_or(&*what, |(what, _)| what);
        Refusal::damaged(line, what)
    })?;
    let mut list = List { counts_from_beginning: true, ..List::default() };
    if let (Some(count), Some(last)) = (answer.count, answer.last) {
        tell_size(count, last, &mut list, notes);
    }
    let mut lines = LineNumbers { text: &text, at: 0, line: 1 };
    let mut events = Vec::new();
    let (mut is_torn, mut damaged) = (false, 0);
    for raw in answer.events.unwrap_or_default() {
        let line = lines.of(raw.get());
        match understood(raw.get()) {
            Ok(event) => {
                events.push(Placed { line, is_torn: std::mem::take(&mut is_torn), event });
            }
            Err(why) => {
                notes.leave_out(line, why);
                (is_torn, damaged) = (true, damaged + 1);
            }
        }
    }
    rows(&events, epoch, &mut list, found, notes)?;
    if list.counts_from_beginning {
        // Sequence numbers tell where an event was, but for the newest.
        torn_at_end(damaged, &mut list);
    } else if is_torn {
        list.torn_at_end = Some(Vec::new());
    }
    if !list.rows.is_empty() || list.overwritten.is_some() {
        found.lists.push(list);
    }
    Ok(())
}

/// Events that were left out and that no hole in the sequence accounts for are among the newest, or
/// before the first, where nobody knows what was.
fn torn_at_end(damaged: u64, list: &mut List) {
    let ends = (list.rows.first(), list.rows.last());
    let (Some(first), Some(last)) = ends else { return };
    let kept = u64::try_from(list.rows.len()).unwrap_or(u64::MAX);
    let holes = (last.place - first.place).saturating_add(1).saturating_sub(kept);
    if damaged > holes {
        list.torn_at_end = Some(Vec::new());
    }
}

/// The answer `last`: how many events there are, and how many there were.
fn tell_size(count: u64, last: u64, list: &mut List, notes: &mut Notes) {
    match last.checked_sub(count) {
        Some(gone) => {
            notes.remark(
                None,
                format!(
                    "the log holds {count} events up to sequence {last}: {gone} older ones are gone"
                ),
            );
            list.overwritten = Some(gone);
        }
        None => notes.remark(None, format!("{count} events up to sequence {last} cannot be")),
    }
}

/// Counts the lines before pieces of a text, which are in order.
struct LineNumbers<'t> {
    text: &'t str,
    at: usize,
    line: u64,
}

impl LineNumbers<'_> {
    fn of(&mut self, piece: &str) -> u64 {
        let at = (piece.as_ptr() as usize).saturating_sub(self.text.as_ptr() as usize);
        let between = self.text.as_bytes().get(self.at..at).unwrap_or_default();
        let ends = between.iter().filter(|byte| **byte == b'\n').count();
        self.line += u64::try_from(ends).unwrap_or_default();
        self.at = self.at.max(at);
        self.line
    }
}

fn understood(text: &str) -> Result<Event, String> {
    let written: Written<'_> = serde_json::from_str(text).map_err(|error| {
        let what = error.to_string();
        let what = what.rsplit_once(" at line ").map_or(&*what, |(what, _)| what);
        format!("{what}, in {}", quoted(text.as_bytes()))
    })?;
    let event = match &written.r {
        Some(words) => of_words(words)?,
        None => of_fields(&written)?,
    };
    match (event.milliseconds, event.sequence) {
        (_, Some(number)) if number > LAST_PLACE => {
            Err(format!("there is no sequence number {number}"))
        }
        (0..1000, _) => Ok(event),
        (ms, _) => Err(format!("there is no millisecond {ms}")),
    }
}

fn of_fields(written: &Written<'_>) -> Result<Event, String> {
    let missing = |name: &str| format!("`{name}` is missing");
    Ok(Event {
        kind: written.event_type.ok_or_else(|| missing("event_type"))?,
        input: written.channel.ok_or_else(|| missing("channel"))?,
        is_on: written.status.ok_or_else(|| missing("status"))? != 0,
        milliseconds: written.milliseconds.ok_or_else(|| missing("milliseconds"))?,
        seconds: written.seconds.ok_or_else(|| missing("seconds"))?,
        sequence: written.seq_num,
        coincident: written.coincident.unwrap_or_default(),
    })
}

/// Four words in hexadecimal digits. The form of eight has another first half, which is not known.
fn of_words(text: &str) -> Result<Event, String> {
    let wrong = || format!("{} are not four words", quoted(text.as_bytes()));
    let word = |text: &str| {
        let is_word = text.len() == 4 && text.bytes().all(|byte| byte.is_ascii_hexdigit());
        u16::from_str_radix(text, 16).ok().filter(|_| is_word)
    };
    let words: Option<Vec<u16>> = text.split('-').take(9).map(word).collect();
    let &[first, second, low, high] = words.ok_or_else(wrong)?.as_slice() else {
        return Err(wrong());
    };
    let [_, kind] = first.to_be_bytes();
    let input = u8::try_from(first >> 5 & 0x1F).unwrap_or_default();
    let (kind, has_input) = (kind & 0x1F, CHANGES.contains(&(kind & 0x1F)) || kind & 0x1F == TEST);
    Ok(Event {
        kind,
        // Inputs count from 0 there.
        input: if has_input { input + 1 } else { 0 },
        is_on: first >> 10 & 1 == 1,
        milliseconds: second & 0x3FF,
        seconds: u32::from(high) << 16 | u32::from(low),
        sequence: None,
        coincident: 0,
    })
}

fn rows(
    events: &[Placed],
    epoch: Option<Epoch>,
    list: &mut List,
    found: &mut Found,
    notes: &mut Notes,
) -> Result<(), Refusal> {
    let epoch = match epoch {
        Some(epoch) => epoch,
        None if events.is_empty() => return Ok(()),
        None => return Err(Refusal::NoEpoch),
    };
    let mut sorted: Vec<&Placed> = events.iter().collect();
    let is_counted =
        events.iter().all(|placed| placed.event.sequence.is_some_and(|number| number > 0));
    if is_counted {
        sorted.sort_by_key(|placed| placed.event.sequence);
        sorted = each_once(sorted, notes);
    } else {
        (list.order, list.counts_from_beginning) = (Order::PlacesOrReversed, false);
    }
    let own: HashSet<(u32, u16, u8)> = events
        .iter()
        .map(|Placed { event, .. }| (event.seconds, event.milliseconds, event.input))
        .collect();
    let mut before: Option<u64> = None;
    for Placed { line, is_torn, event } in sorted {
        let is_torn = *is_torn && !is_counted;
        let place = match event.sequence.filter(|_| is_counted) {
            Some(sequence) => sequence,
            None => before.map_or(1, |before| before + 1 + u64::from(is_torn)),
        };
        let is_own = |input: u8| own.contains(&(event.seconds, event.milliseconds, input));
        let changes = changes(event, is_own, found)?;
        found.count(changes.len())?;
        list.rows.push(Row {
            line: *line,
            when: when(event, epoch)?,
            place,
            forgets: before.is_some_and(|before| before + 1 != place),
            torn: is_torn.then(Vec::new),
            learnt: Vec::new(),
            changes,
        });
        before = Some(place);
    }
    Ok(())
}

/// Of one sequence number, the event that comes first in the file. One that contradicts it is told.
fn each_once<'e>(sorted: Vec<&'e Placed>, notes: &mut Notes) -> Vec<&'e Placed> {
    let mut once: Vec<&Placed> = Vec::with_capacity(sorted.len());
    for placed in sorted {
        match once.last().filter(|kept| kept.event.sequence == placed.event.sequence) {
            Some(kept) if kept.event == placed.event => {}
            Some(kept) => {
                let sequence = kept.event.sequence.unwrap_or_default();
                let why =
                    format!("another event, in line {}, has the sequence {sequence}", kept.line);
                notes.leave_out(placed.line, why);
            }
            None => once.push(placed),
        }
    }
    once
}

/// What an event tells. Inputs that changed in the same millisecond and have no event of their own
/// changed to nobody knows what.
fn changes(
    event: &Event,
    is_own: impl Fn(u8) -> bool,
    found: &mut Found,
) -> Result<Vec<Change>, Refusal> {
    let Event { kind, input, is_on, coincident, .. } = *event;
    let is_change = CHANGES.contains(&kind) && input > 0;
    let name = match kind {
        _ if is_change => format!("input {input}"),
        TEST => format!("input {input} in test mode"),
        10 => "log cleared".to_owned(),
        24 => "test mode on".to_owned(),
        25 => "test mode off".to_owned(),
        kind if input > 0 => format!("event type {kind}, input {input}"),
        kind => format!("event type {kind}"),
    };
    let to = match is_change || kind == TEST || CHANGES.contains(&kind) {
        true => To::State(is_on),
        false => To::Event,
    };
    let mut changes = vec![Change { point: found.point(&name)?, to }];
    for other in (1_u8..=32).filter(|other| coincident >> (other - 1) & 1 == 1 && is_change) {
        if other != input && !is_own(other) {
            let point = found.point(&format!("input {other}"))?;
            changes.push(Change { point, to: To::Unseen });
        }
    }
    Ok(changes)
}

fn when(event: &Event, epoch: Epoch) -> Result<When, Refusal> {
    let (first, utc_offset_s) = match epoch {
        Epoch::Posix => (civil::date(1970, 1, 1), Some(0)),
        Epoch::Local1984 => (civil::date(1984, 1, 1), None),
    };
    let (days, seconds) = (event.seconds / 86_400, event.seconds % 86_400);
    let date = first
        .checked_add(jiff::Span::new().days(i64::from(days)))
        .map_err(|_| Refusal::TooMuch { what: "days", most: days.into() })?;
    let day_ns = u64::from(seconds) * SECOND_NS + u64::from(event.milliseconds) * 1_000_000;
    Ok(When { date: Date::of(date), day_ns, later_ns: 0, utc_offset_s })
}
