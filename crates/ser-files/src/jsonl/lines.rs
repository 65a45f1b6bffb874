//! Lines as they are read: one flat struct for all kinds, so that a line is gone over once.

use std::collections::BTreeMap;

use ser_evidence::record::{Boot, Fellow, HostReading, Place};
use ser_evidence::time::{Moment, Scale};
use ser_proto::{Entry, TimeStamp};
use serde::Deserialize;

use super::texts::{Numbers, Text, life_named};
use crate::error::quoted;
use crate::stamp;

/// Why a line is not what it has to be.
pub(super) type Result<T> = std::result::Result<T, String>;

/// All fields of all kinds.
#[derive(Debug, Deserialize)]
pub(super) struct Line<'a> {
    #[serde(borrow)]
    pub(super) record: Option<Text<'a>>,
    #[serde(borrow)]
    pub(super) recorder: Option<Text<'a>>,
    pub(super) schema: Option<u32>,
    #[serde(borrow)]
    pub(super) program: Option<Text<'a>>,
    pub(super) entry: Option<u16>,
    #[serde(borrow)]
    pub(super) time: Option<Text<'a>>,
    pub(super) year: Option<u8>,
    pub(super) changed: Option<Numbers>,
    pub(super) state: Option<Numbers>,
    pub(super) known: Option<Numbers>,
    pub(super) sequence: Option<u64>,
    #[serde(borrow)]
    pub(super) life: Option<Text<'a>>,
    pub(super) lost: Option<u32>,
    #[serde(borrow)]
    pub(super) count: Option<Text<'a>>,
    pub(super) after: Option<u64>,
    #[serde(borrow)]
    pub(super) why: Option<Text<'a>>,
    pub(super) inputs: Option<Numbers>,
    pub(super) exact: Option<bool>,
    #[serde(borrow)]
    pub(super) model: Option<Text<'a>>,
    pub(super) size: Option<u16>,
    #[serde(borrow)]
    pub(super) erased: Option<Text<'a>>,
    #[serde(borrow)]
    pub(super) how: Option<Text<'a>>,
    #[serde(borrow)]
    pub(super) broadcast: Option<Text<'a>>,
    #[serde(borrow)]
    pub(super) shown: Option<Text<'a>>,
    #[serde(borrow)]
    pub(super) scale: Option<Text<'a>>,
    pub(super) lo_us: Option<i64>,
    pub(super) hi_us: Option<i64>,
    #[serde(borrow)]
    pub(super) host: Option<HostLine<'a>>,
    #[serde(borrow)]
    pub(super) place: Option<PlaceLine<'a>>,
    #[serde(borrow)]
    pub(super) from: Option<HostLine<'a>>,
    #[serde(borrow)]
    pub(super) to: Option<HostLine<'a>>,
    pub(super) through: Option<u64>,
    pub(super) on_for_us: Option<u64>,
    pub(super) left_out: Option<BTreeMap<u8, u32>>,
    pub(super) input: Option<u8>,
    #[serde(borrow)]
    pub(super) name: Option<Text<'a>>,
    #[serde(borrow)]
    pub(super) on: Option<Text<'a>>,
    #[serde(borrow)]
    pub(super) off: Option<Text<'a>>,
    pub(super) utc_offset_s: Option<i32>,
    #[serde(borrow)]
    pub(super) text: Option<Text<'a>>,
    pub(super) closes: Option<bool>,
    #[serde(borrow)]
    pub(super) note: Option<Text<'a>>,
    #[serde(borrow)]
    pub(super) user: Option<Text<'a>>,
    #[serde(borrow)]
    pub(super) host_name: Option<Text<'a>>,
    #[serde(borrow)]
    pub(super) peer: Option<Text<'a>>,
    #[serde(borrow)]
    pub(super) command: Option<Text<'a>>,
    #[serde(borrow)]
    pub(super) outcome: Option<Text<'a>>,
}

/// Both clocks of a host.
#[derive(Debug, Deserialize)]
pub(super) struct HostLine<'a> {
    #[serde(borrow)]
    boot: Text<'a>,
    monotonic_us: i64,
    utc_us: i64,
    utc_doubt_us: Option<u64>,
}

/// A place in a log.
#[derive(Debug, Deserialize)]
pub(super) struct PlaceLine<'a> {
    #[serde(borrow)]
    life: Option<Text<'a>>,
    after: Option<u64>,
    before: Option<u64>,
    #[serde(borrow)]
    newest: Option<NewestLine<'a>>,
    #[serde(borrow)]
    fellow: Option<FellowLine<'a>>,
}

/// Another entry of the same life.
#[derive(Debug, Deserialize)]
struct FellowLine<'a> {
    ahead: i64,
    #[serde(borrow)]
    time: Text<'a>,
    year: Option<u8>,
    changed: Numbers,
    state: Numbers,
}

/// An entry as it was read, without its place in the ring.
#[derive(Debug, Deserialize)]
struct NewestLine<'a> {
    #[serde(borrow)]
    time: Text<'a>,
    year: Option<u8>,
    changed: Numbers,
    state: Numbers,
}

/// What a field has to be there for.
pub(super) fn needed<T>(field: Option<T>, name: &str) -> Result<T> {
    field.ok_or_else(|| format!("`{name}` is missing"))
}

/// What is wrong with the text of a field.
pub(super) fn wrong(name: &str, text: &str) -> String {
    format!("`{name}` cannot be {}", quoted(text.as_bytes()))
}

/// A field whose text has to stand for something.
pub(super) fn understood<T>(
    name: &str,
    text: Option<&Text<'_>>,
    parse: impl Fn(&str) -> Option<T>,
) -> Result<Option<T>> {
    let Some(Text(text)) = text else { return Ok(None) };
    parse(text).map(Some).ok_or_else(|| wrong(name, text))
}

pub(super) fn stamp(text: &Text<'_>, year: Option<u8>) -> Result<TimeStamp> {
    stamp::parse(text.0.as_bytes(), year).ok_or_else(|| wrong("time", &text.0))
}

/// The furthest that a moment may be from the beginning of its scale, in microseconds: 36,000
/// years. Beyond that, nothing could be reckoned with it.
const FURTHEST_US: i64 = 1 << 60;

pub(super) fn moment<S: Scale>(name: &str, us: i64) -> Result<Moment<S>> {
    match us.checked_abs() {
        Some(distance) if distance <= FURTHEST_US => Ok(Moment::from_us(us)),
        _ => Err(wrong(name, &us.to_string())),
    }
}

impl HostLine<'_> {
    pub(super) fn reading(&self) -> Result<HostReading> {
        let boot = Boot::from_name(&self.boot.0).ok_or_else(|| wrong("boot", &self.boot.0))?;
        Ok(HostReading {
            boot,
            monotonic: moment("monotonic_us", self.monotonic_us)?,
            utc: moment("utc_us", self.utc_us)?,
            utc_doubt_us: self.utc_doubt_us,
        })
    }
}

impl PlaceLine<'_> {
    pub(super) fn place(&self) -> Result<Place> {
        let name = self.life.as_ref().map(|Text(life)| &**life);
        let life = life_named(name).ok_or_else(|| wrong("life", name.unwrap_or_default()))?;
        let newest = self.newest.as_ref().map(NewestLine::entry).transpose()?;
        let fellow = self.fellow.as_ref().map(FellowLine::fellow).transpose()?;
        Ok(Place { life, after: self.after, before: self.before, newest, fellow })
    }
}

impl FellowLine<'_> {
    fn fellow(&self) -> Result<Fellow> {
        let time = stamp(&self.time, self.year)?;
        let entry = Entry { changed: self.changed.0, state: self.state.0, time };
        Ok(Fellow { ahead: self.ahead, entry })
    }
}

impl NewestLine<'_> {
    fn entry(&self) -> Result<Entry> {
        let time = stamp(&self.time, self.year)?;
        Ok(Entry { changed: self.changed.0, state: self.state.0, time })
    }
}
