//! From records to lines.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::io::{self, Write};

use ser_console::is_obeyed;
use ser_evidence::record::{
    Boot, ClockObservation, ClockStep, CommandRecord, EntryRecord, Fellow, Gap, HostReading, Life,
    LifeRecord, Lost, NoteRecord, Place, PointRecord, Record, RecorderRecord, Reference,
    SiteRecord, Suppressed, Watched, Why,
};
use ser_evidence::time::{Moment, stamp};
use ser_proto::{Entry, Inputs, TimeStamp};
use serde::{Serialize, Serializer};
use serde_json::ser::Formatter;

use super::SCHEMA;
use super::texts::{Numbers, how_name, model_name, outcome_name};
use crate::missing::why_name;
use crate::stamp::untold_year;

/// Writes records, each as a line. The fields of a kind always come in the same order.
pub struct Writer<W> {
    out: W,
}

impl<W: Write> Writer<W> {
    /// Writes to `out`.
    pub const fn new(out: W) -> Writer<W> {
        Writer { out }
    }

    /// Writes which version of the layout follows, and who writes it. The first line of a file.
    ///
    /// # Errors
    /// As `out`.
    pub fn file(&mut self, program: &str) -> io::Result<()> {
        self.line(&FileLine { record: "file", schema: SCHEMA, program })
    }

    /// Writes a record of a recorder.
    ///
    /// # Errors
    /// As `out`, and `InvalidInput` for a clock observation that shows no stamp.
    pub fn record(&mut self, recorder: &str, record: &Record) -> io::Result<()> {
        match record {
            Record::Entry(entry) => self.entry(recorder, entry, None),
            Record::Gap(gap) => self.line(&GapLine::of(recorder, gap)),
            Record::Clock(clock) => self.line(&ClockLine::of(recorder, clock)?),
            Record::Step(step) => self.line(&StepLine::of(recorder, step)),
            Record::Life(life) => self.line(&LifeLine::of(recorder, life)),
            Record::Watched(watched) => self.line(&WatchedLine::of(recorder, watched)),
            Record::Suppressed(look) => self.line(&SuppressedLine::of(recorder, look)),
            Record::Point(point) => self.line(&PointLine::of(recorder, point)),
            Record::Recorder(stamps) => self.line(&RecorderLine::of(recorder, stamps)),
            Record::Command(command) => self.line(&CommandLine::of(recorder, command)),
            Record::Note(note) => self.line(&NoteLine::of(recorder, note)),
            Record::Site(site) => self.line(&SiteLine::of(recorder, site)),
        }
    }

    /// Writes an entry with a remark for people.
    ///
    /// # Errors
    /// As `out`.
    pub fn entry(
        &mut self,
        recorder: &str,
        entry: &EntryRecord,
        note: Option<&str>,
    ) -> io::Result<()> {
        self.line(&EntryLine::of(recorder, entry, note))
    }

    /// Passes on what was written.
    ///
    /// # Errors
    /// As `out`.
    pub fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }

    fn line(&mut self, line: &impl Serialize) -> io::Result<()> {
        line.serialize(&mut serde_json::Serializer::with_formatter(&mut self.out, Harmless))?;
        self.out.write_all(b"\n")
    }
}

/// Anything that can be displayed, as a text.
struct AsText<T>(T);

impl<T: Display> Serialize for AsText<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&self.0)
    }
}

#[derive(Serialize)]
struct FileLine<'a> {
    record: &'static str,
    schema: u32,
    program: &'a str,
}

#[derive(Serialize)]
struct EntryLine<'a> {
    record: &'static str,
    recorder: &'a str,
    entry: u16,
    time: AsText<TimeStamp>,
    #[serde(skip_serializing_if = "Option::is_none")]
    year: Option<u8>,
    changed: Numbers,
    state: Numbers,
    #[serde(skip_serializing_if = "Option::is_none")]
    known: Option<Numbers>,
    sequence: Option<u64>,
    life: AsText<Life>,
    #[serde(skip_serializing_if = "Option::is_none")]
    note: Option<&'a str>,
}

impl<'a> EntryLine<'a> {
    fn of(recorder: &'a str, record: &EntryRecord, note: Option<&'a str>) -> EntryLine<'a> {
        let EntryRecord { life, sequence, number, entry, known } = *record;
        EntryLine {
            record: "entry",
            recorder,
            entry: number,
            time: AsText(entry.time),
            year: untold_year(&entry.time),
            changed: Numbers(entry.changed),
            state: Numbers(entry.state),
            known: (known != EntryRecord::ALL_KNOWN).then_some(Numbers(known)),
            sequence,
            life: AsText(life),
            note,
        }
    }
}

#[derive(Serialize)]
struct GapLine<'a> {
    record: &'static str,
    recorder: &'a str,
    lost: Option<u32>,
    count: &'static str,
    after: Option<u64>,
    why: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    inputs: Option<Numbers>,
    life: AsText<Life>,
}

impl<'a> GapLine<'a> {
    fn of(recorder: &'a str, gap: &Gap) -> GapLine<'a> {
        let Gap { life, after, lost, why } = *gap;
        let (lost, count) = match lost {
            Lost::Exactly(count) => (Some(count), "exactly"),
            Lost::AtLeast(count) => (Some(count), "at least"),
            Lost::Unknown => (None, "unknown"),
        };
        let inputs = match why {
            Why::NotRecorded(inputs) => Some(Numbers(Inputs(inputs))),
            _ => None,
        };
        let (why, life) = (why_name(why), AsText(life));
        GapLine { record: "gap", recorder, lost, count, after, why, inputs, life }
    }
}

#[derive(Serialize)]
struct LifeLine<'a> {
    record: &'static str,
    recorder: &'a str,
    life: AsText<Life>,
    exact: bool,
    model: Option<&'static str>,
    size: Option<u16>,
    erased: Option<AsText<Life>>,
}

impl<'a> LifeLine<'a> {
    fn of(recorder: &'a str, record: &LifeRecord) -> LifeLine<'a> {
        let LifeRecord { life, is_exact, model, size, erased } = *record;
        let (life, model, erased) = (AsText(life), model.map(model_name), erased.map(AsText));
        LifeLine { record: "life", recorder, life, exact: is_exact, model, size, erased }
    }
}

#[derive(Serialize)]
struct HostFields {
    boot: AsText<Boot>,
    monotonic_us: i64,
    utc_us: i64,
    utc_doubt_us: Option<u64>,
}

impl From<&HostReading> for HostFields {
    fn from(reading: &HostReading) -> HostFields {
        HostFields {
            boot: AsText(reading.boot),
            monotonic_us: reading.monotonic.us(),
            utc_us: reading.utc.us(),
            utc_doubt_us: reading.utc_doubt_us,
        }
    }
}

#[derive(Serialize)]
struct PlaceFields {
    life: AsText<Life>,
    after: Option<u64>,
    before: Option<u64>,
    newest: Option<NewestFields>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fellow: Option<FellowFields>,
}

#[derive(Serialize)]
struct FellowFields {
    ahead: i64,
    #[serde(flatten)]
    entry: NewestFields,
}

impl From<&Place> for PlaceFields {
    fn from(place: &Place) -> PlaceFields {
        let Place { life, after, before, newest, fellow } = *place;
        PlaceFields {
            life: AsText(life),
            after,
            before,
            newest: newest.map(NewestFields::from),
            fellow: fellow
                .map(|Fellow { ahead, entry }| FellowFields { ahead, entry: entry.into() }),
        }
    }
}

#[derive(Serialize)]
struct NewestFields {
    time: AsText<TimeStamp>,
    #[serde(skip_serializing_if = "Option::is_none")]
    year: Option<u8>,
    changed: Numbers,
    state: Numbers,
}

impl From<Entry> for NewestFields {
    fn from(entry: Entry) -> NewestFields {
        let Entry { changed, state, time } = entry;
        let year = untold_year(&time);
        NewestFields { time: AsText(time), year, changed: Numbers(changed), state: Numbers(state) }
    }
}

#[derive(Serialize)]
struct ClockLine<'a> {
    record: &'static str,
    recorder: &'a str,
    how: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    broadcast: Option<String>,
    shown: AsText<TimeStamp>,
    scale: &'static str,
    lo_us: Option<i64>,
    hi_us: Option<i64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    host: Option<HostFields>,
    place: PlaceFields,
}

impl<'a> ClockLine<'a> {
    fn of(recorder: &'a str, clock: &ClockObservation) -> io::Result<ClockLine<'a>> {
        let no_stamp =
            || io::Error::new(io::ErrorKind::InvalidInput, "no recorder's clock shows this");
        let (scale, lo_us, hi_us, host) = match &clock.at {
            Reference::Host { bound, reading } => {
                let (lo, hi) = (bound.lo().map(Moment::us), bound.hi().map(Moment::us));
                ("host", lo, hi, Some(HostFields::from(reading)))
            }
            Reference::Utc(bound) => {
                ("utc", bound.lo().map(Moment::us), bound.hi().map(Moment::us), None)
            }
        };
        Ok(ClockLine {
            record: "clock",
            recorder,
            how: how_name(clock.how),
            broadcast: clock.how.broadcast().map(|number| format!("{number:016x}")),
            shown: AsText(stamp(clock.shown).ok_or_else(no_stamp)?),
            scale,
            lo_us,
            hi_us,
            host,
            place: PlaceFields::from(&clock.place),
        })
    }
}

#[derive(Serialize)]
struct StepLine<'a> {
    record: &'static str,
    recorder: &'a str,
    host: HostFields,
    place: PlaceFields,
}

impl<'a> StepLine<'a> {
    fn of(recorder: &'a str, step: &ClockStep) -> StepLine<'a> {
        let (host, place) = (HostFields::from(&step.reading), PlaceFields::from(&step.place));
        StepLine { record: "step", recorder, host, place }
    }
}

#[derive(Serialize)]
struct WatchedLine<'a> {
    record: &'static str,
    recorder: &'a str,
    life: AsText<Life>,
    from: HostFields,
    to: HostFields,
    through: u64,
}

impl<'a> WatchedLine<'a> {
    fn of(recorder: &'a str, watched: &Watched) -> WatchedLine<'a> {
        let (from, to) = (HostFields::from(&watched.from), HostFields::from(&watched.to));
        let (life, through) = (AsText(watched.life), watched.through);
        WatchedLine { record: "watched", recorder, life, from, to, through }
    }
}

#[derive(Serialize)]
struct SuppressedLine<'a> {
    record: &'static str,
    recorder: &'a str,
    from: HostFields,
    to: HostFields,
    on_for_us: u64,
    left_out: &'a BTreeMap<u8, u32>,
}

impl<'a> SuppressedLine<'a> {
    fn of(recorder: &'a str, look: &'a Suppressed) -> SuppressedLine<'a> {
        let (from, to) = (HostFields::from(&look.from), HostFields::from(&look.to));
        let (on_for_us, left_out) = (look.on_for_us, &look.left_out);
        SuppressedLine { record: "suppressed", recorder, from, to, on_for_us, left_out }
    }
}

#[derive(Serialize)]
struct PointLine<'a> {
    record: &'static str,
    recorder: &'a str,
    input: u8,
    name: &'a str,
    on: &'a str,
    off: &'a str,
}

impl<'a> PointLine<'a> {
    fn of(recorder: &'a str, point: &'a PointRecord) -> PointLine<'a> {
        let PointRecord { input, name, on, off } = point;
        PointLine { record: "point", recorder, input: *input, name, on, off }
    }
}

#[derive(Serialize)]
struct RecorderLine<'a> {
    record: &'static str,
    recorder: &'a str,
    utc_offset_s: i32,
}

impl<'a> RecorderLine<'a> {
    fn of(recorder: &'a str, stamps: &RecorderRecord) -> RecorderLine<'a> {
        RecorderLine { record: "recorder", recorder, utc_offset_s: stamps.utc_offset_s }
    }
}

#[derive(Serialize)]
struct CommandLine<'a> {
    record: &'static str,
    recorder: &'a str,
    command: &'a str,
    outcome: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    why: Option<&'a str>,
    user: &'a str,
    host_name: &'a str,
    program: &'a str,
    peer: &'a str,
    host: HostFields,
}

impl<'a> CommandLine<'a> {
    fn of(recorder: &'a str, record: &'a CommandRecord) -> CommandLine<'a> {
        let CommandRecord { at, user, host: host_name, program, peer, command, outcome } = record;
        CommandLine {
            record: "command",
            recorder,
            command,
            outcome: outcome_name(outcome),
            why: outcome.why(),
            user,
            host_name,
            program,
            peer,
            host: at.into(),
        }
    }
}

#[derive(Serialize)]
struct NoteLine<'a> {
    record: &'static str,
    recorder: &'a str,
    host: HostFields,
    user: &'a str,
    host_name: &'a str,
    life: AsText<Life>,
    sequence: u64,
    text: &'a str,
    closes: bool,
}

impl<'a> NoteLine<'a> {
    fn of(recorder: &'a str, note: &'a NoteRecord) -> NoteLine<'a> {
        let NoteRecord { at, user, host: host_name, life, sequence, text, closes } = note;
        NoteLine {
            record: "note",
            recorder,
            host: at.into(),
            user,
            host_name,
            life: AsText(*life),
            sequence: *sequence,
            text,
            closes: *closes,
        }
    }
}

#[derive(Serialize)]
struct SiteLine<'a> {
    record: &'static str,
    recorder: &'a str,
    host: HostFields,
    text: &'a str,
}

impl<'a> SiteLine<'a> {
    fn of(recorder: &'a str, site: &'a SiteRecord) -> SiteLine<'a> {
        SiteLine { record: "site", recorder, host: (&site.at).into(), text: &site.text }
    }
}

/// Writes JSON in which nothing is left that a terminal would obey: it is escaped, and read back as
/// it was.
struct Harmless;

impl Formatter for Harmless {
    fn write_string_fragment<W>(&mut self, out: &mut W, fragment: &str) -> io::Result<()>
    where
        W: ?Sized + Write,
    {
        if fragment.is_ascii() && !fragment.contains('\u{7f}') {
            return out.write_all(fragment.as_bytes());
        }
        for letter in fragment.chars() {
            // All of them are in the first plane.
            match is_obeyed(letter) {
                true => write!(out, "\\u{:04x}", u32::from(letter))?,
                false => write!(out, "{letter}")?,
            }
        }
        Ok(())
    }
}
