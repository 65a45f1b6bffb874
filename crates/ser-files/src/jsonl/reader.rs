//! From lines to records.

use std::io::BufRead;

use ser_evidence::record::{
    ClockObservation, ClockStep, CommandRecord, EntryRecord, Gap, How, Life, LifeRecord, Lost,
    NoteRecord, Outcome, Place, PointRecord, Record, RecorderRecord, Reference, SiteRecord,
    Suppressed, Told, Watched, Why,
};
use ser_evidence::time::{Bound, Scale, shown};
use ser_proto::Entry;

use super::lines::{HostLine, Line, PlaceLine, Result, moment, needed, stamp, understood, wrong};
use super::texts::{Text, broadcast_named, fit_to_show, is_line, life_named, model_named};
use super::{MAX_LINE_LEN, SCHEMA};
use crate::error::{Problem, ReadError, quoted};
use crate::lines::Lines;
use crate::missing::why_named;
use crate::stamp as stamps;

/// Reads the records of a file. After an error in one line it goes on with the next.
pub struct Reader<R> {
    lines: Lines<R>,
    /// The recorder of lines that do not name theirs.
    unnamed: String,
    /// The recorder of the record that was read last.
    recorder: String,
    /// The remark that goes with it.
    note: Option<String>,
    program: Option<String>,
    is_over: bool,
}

impl<R: BufRead> Reader<R> {
    /// Reads `input`. `recorder` is the name for lines that name none, as earlier versions wrote
    /// them.
    pub fn new(input: R, recorder: &str) -> Reader<R> {
        let lines = Lines::new(input, MAX_LINE_LEN);
        let (unnamed, recorder) = (recorder.to_owned(), recorder.to_owned());
        Reader { lines, unnamed, recorder, note: None, program: None, is_over: false }
    }

    /// The name of the recorder of the record that was [read](Self::read) last.
    #[must_use]
    pub fn recorder(&self) -> &str {
        &self.recorder
    }

    /// The remark for people that goes with the record that was [read](Self::read) last.
    #[must_use]
    pub fn note(&self) -> Option<&str> {
        self.note.as_deref()
    }

    /// The next record, without the name of its recorder.
    pub fn read(&mut self) -> Option<std::result::Result<Record, ReadError>> {
        if self.is_over {
            return None;
        }
        let record = self.next_record();
        let goes_on = |record: &std::result::Result<Record, ReadError>| {
            record.as_ref().err().is_none_or(ReadError::is_of_one_line)
        };
        self.is_over = !record.as_ref().is_some_and(goes_on);
        record
    }

    /// The program that wrote the file, as it calls itself, if it has said so by now.
    #[must_use]
    pub fn program(&self) -> Option<&str> {
        self.program.as_deref()
    }

    fn next_record(&mut self) -> Option<std::result::Result<Record, ReadError>> {
        loop {
            let line = match self.lines.next()? {
                Ok(line) => line,
                Err(error) => return Some(Err(error)),
            };
            let understood = parse(line).and_then(|line| {
                let item = item(&line).map_err(|problem| (None, problem))?;
                let name = line.recorder.as_ref().map_or(&*self.unnamed, |Text(name)| name);
                // Neighbouring lines often have the same one.
                if self.recorder != name {
                    name.clone_into(&mut self.recorder);
                }
                self.note = line.note.as_ref().map(|Text(note)| note.to_string());
                Ok(item)
            });
            let number = self.lines.number();
            match understood {
                Ok(Item::Record(record)) => return Some(Ok(record)),
                Ok(Item::File(program)) => self.program = program,
                Err((byte, problem)) => {
                    return Some(Err(ReadError { line: number, byte, problem }));
                }
            }
        }
    }
}

impl<R: BufRead> Iterator for Reader<R> {
    type Item = std::result::Result<Told, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        let record = self.read()?;
        Some(record.map(|record| Told { recorder: self.recorder.clone(), record }))
    }
}

/// What a line says.
enum Item {
    /// A record.
    Record(Record),
    /// A program begins to write.
    File(Option<String>),
}

/// Why a line could not be understood, and at which byte.
type Trouble = (Option<usize>, Problem);

fn parse(line: &[u8]) -> std::result::Result<Line<'_>, Trouble> {
    // A list would be taken for the fields in their order.
    if line.trim_ascii_start().first() != Some(&b'{') {
        return Err((None, Problem::Damaged(format!("this is not an object: {}", quoted(line)))));
    }
    serde_json::from_slice(line).map_err(|error| match std::str::from_utf8(line) {
        Ok(_) => not_json(&error, line),
        Err(no_text) => (
            Some(no_text.valid_up_to() + 1),
            Problem::Damaged("this is not UTF-8; save the file as UTF-8".to_owned()),
        ),
    })
}

fn not_json(error: &serde_json::Error, line: &[u8]) -> Trouble {
    let text = error.to_string();
    // The error counts lines and columns, but has seen one line only.
    let what = text.rsplit_once(" at line ").map_or(&*text, |(what, _)| what);
    let why = format!("{what}, in {}", quoted(line));
    (Some(error.column()).filter(|&column| column > 0), Problem::Damaged(why))
}

fn item(line: &Line<'_>) -> std::result::Result<Item, Problem> {
    let record = match line.record.as_ref().map(|Text(kind)| &**kind) {
        Some("file") => return file(line),
        Some("entry") => entry(line),
        Some("gap") => gap(line),
        Some("clock") => clock(line),
        Some("step") => step(line),
        Some("life") => life(line),
        Some("watched") => watched(line),
        Some("suppressed") => suppressed(line),
        Some("point") => point(line),
        Some("recorder") => recorder(line),
        Some("command") => command(line),
        Some("note") => note(line),
        Some("site") => site(line),
        // Evidence that is passed over in silence would be lost.
        Some(kind) => Err(format!("there is no record {}", quoted(kind.as_bytes()))),
        None if line.entry.is_some() => entry(line),
        None if line.count.is_some() => gap(line),
        None => Err("neither `record` nor `entry` nor `lost` says what this is".to_owned()),
    };
    record.map(Item::Record).map_err(Problem::Damaged)
}

fn file(line: &Line<'_>) -> std::result::Result<Item, Problem> {
    match needed(line.schema, "schema").map_err(Problem::Damaged)? {
        SCHEMA => Ok(Item::File(line.program.as_ref().map(|Text(program)| program.to_string()))),
        0 => Err(Problem::Damaged("there is no schema 0".to_owned())),
        schema => Err(Problem::NewerSchema { schema }),
    }
}

fn life_of(line: &Line<'_>) -> Result<Life> {
    let name = line.life.as_ref().map(|Text(life)| &**life);
    life_named(name).ok_or_else(|| wrong("life", name.unwrap_or_default()))
}

fn entry(line: &Line<'_>) -> Result<Record> {
    let time = needed(line.time.as_ref(), "time")?;
    let entry = Entry {
        changed: needed(line.changed, "changed")?.0,
        state: needed(line.state, "state")?.0,
        time: stamp(time, line.year)?,
    };
    Ok(Record::Entry(EntryRecord {
        life: life_of(line)?,
        sequence: line.sequence,
        number: needed(line.entry, "entry")?,
        entry,
        known: line.known.map_or(EntryRecord::ALL_KNOWN, |known| known.0),
    }))
}

fn gap(line: &Line<'_>) -> Result<Record> {
    let Text(count) = needed(line.count.as_ref(), "count")?;
    let lost = match (&**count, line.lost) {
        ("exactly", Some(lost)) => Lost::Exactly(lost),
        ("at least", Some(lost)) => Lost::AtLeast(lost),
        ("unknown", _) => Lost::Unknown,
        ("exactly" | "at least", None) => return Err("`lost` is missing".to_owned()),
        (other, _) => return Err(wrong("count", other)),
    };
    let Text(why) = needed(line.why.as_ref(), "why")?;
    let why = match &**why {
        "not recorded" => Why::not_recorded(needed(line.inputs, "inputs")?.0),
        name => why_named(name).ok_or_else(|| wrong("why", name))?,
    };
    Ok(Record::Gap(Gap { life: life_of(line)?, after: line.after, lost, why }))
}

fn life(line: &Line<'_>) -> Result<Record> {
    Ok(Record::Life(LifeRecord {
        life: life_of(line)?,
        is_exact: needed(line.exact, "exact")?,
        model: understood("model", line.model.as_ref(), model_named)?,
        size: line.size,
        erased: understood("erased", line.erased.as_ref(), Life::from_name)?,
    }))
}

fn clock(line: &Line<'_>) -> Result<Record> {
    let text = needed(line.shown.as_ref(), "shown")?;
    let shown = stamps::parse(text.0.as_bytes(), None).and_then(|stamp| shown(&stamp));
    Ok(Record::Clock(ClockObservation {
        how: how(line)?,
        shown: shown.ok_or_else(|| wrong("shown", &text.0))?,
        at: reference(line)?,
        place: place(line.place.as_ref())?,
    }))
}

fn how(line: &Line<'_>) -> Result<How> {
    let broadcast = understood("broadcast", line.broadcast.as_ref(), broadcast_named)?;
    let Text(how) = needed(line.how.as_ref(), "how")?;
    Ok(match &**how {
        "set" => How::Set { broadcast },
        "mark" => How::Mark { broadcast: needed(broadcast, "broadcast")? },
        "query" => How::Query,
        "event" => How::Event,
        "hand" => How::Hand,
        other => return Err(wrong("how", other)),
    })
}

fn reference(line: &Line<'_>) -> Result<Reference> {
    let Text(scale) = needed(line.scale.as_ref(), "scale")?;
    match &**scale {
        "host" => Ok(Reference::Host {
            bound: bound(line)?,
            reading: needed(line.host.as_ref().map(HostLine::reading).transpose()?, "host")?,
        }),
        "utc" => Ok(Reference::Utc(bound(line)?)),
        other => Err(wrong("scale", other)),
    }
}

fn bound<S: Scale>(line: &Line<'_>) -> Result<Bound<S>> {
    let end = |name, us: Option<i64>| us.map(|us| moment(name, us)).transpose();
    Ok(Bound::new(end("lo_us", line.lo_us)?, end("hi_us", line.hi_us)?))
}

fn place(line: Option<&PlaceLine<'_>>) -> Result<Place> {
    line.map_or(Ok(Place::UNKNOWN), PlaceLine::place)
}

fn step(line: &Line<'_>) -> Result<Record> {
    Ok(Record::Step(ClockStep {
        place: place(line.place.as_ref())?,
        reading: needed(line.host.as_ref(), "host")?.reading()?,
    }))
}

fn watched(line: &Line<'_>) -> Result<Record> {
    Ok(Record::Watched(Watched {
        life: life_of(line)?,
        from: needed(line.from.as_ref(), "from")?.reading()?,
        to: needed(line.to.as_ref(), "to")?.reading()?,
        through: needed(line.through, "through")?,
    }))
}

fn suppressed(line: &Line<'_>) -> Result<Record> {
    let left_out = needed(line.left_out.as_ref(), "left_out")?;
    let is_input = |input: &u8| (1..=Suppressed::LAST_INPUT).contains(input);
    if let Some(wrong) = left_out.keys().find(|input| !is_input(input)) {
        return Err(format!("there is no input {wrong}"));
    }
    Ok(Record::Suppressed(Suppressed {
        from: needed(line.from.as_ref(), "from")?.reading()?,
        to: needed(line.to.as_ref(), "to")?.reading()?,
        on_for_us: needed(line.on_for_us, "on_for_us")?,
        left_out: left_out.clone(),
    }))
}

fn point(line: &Line<'_>) -> Result<Record> {
    let input = needed(line.input, "input")?;
    if !(1..=PointRecord::LAST_INPUT).contains(&input) {
        return Err(format!("there is no input {input}"));
    }
    let text = |field: &Option<Text<'_>>, name| {
        let Text(text) = needed(field.as_ref(), name)?;
        match fit_to_show(text) {
            true => Ok(text.to_string()),
            false => Err(wrong(name, text)),
        }
    };
    let (name, on, off) =
        (text(&line.name, "name")?, text(&line.on, "on")?, text(&line.off, "off")?);
    Ok(Record::Point(PointRecord { input, name, on, off }))
}

fn recorder(line: &Line<'_>) -> Result<Record> {
    let utc_offset_s = needed(line.utc_offset_s, "utc_offset_s")?;
    if utc_offset_s.unsigned_abs() >= RecorderRecord::DAY_S.unsigned_abs() {
        return Err(wrong("utc_offset_s", &utc_offset_s.to_string()));
    }
    Ok(Record::Recorder(RecorderRecord { utc_offset_s }))
}

fn command(line: &Line<'_>) -> Result<Record> {
    let text = |field: &Option<Text<'_>>, name, longest| {
        let Text(text) = needed(field.as_ref(), name)?;
        match is_line(text, 1..=longest) {
            true => Ok(text.to_string()),
            false => Err(wrong(name, text)),
        }
    };
    let name = |field, name| text(field, name, CommandRecord::LONGEST_NAME);
    let why = || text(&line.why, "why", CommandRecord::LONGEST_TEXT);
    let Text(outcome) = needed(line.outcome.as_ref(), "outcome")?;
    let outcome = match &**outcome {
        "done" => Outcome::Done,
        "sent" => Outcome::Sent,
        "refused" => Outcome::Refused(why()?),
        "not answered" => Outcome::NotAnswered(why()?),
        "not sent" => Outcome::NotSent(why()?),
        other => return Err(wrong("outcome", other)),
    };
    Ok(Record::Command(CommandRecord {
        at: needed(line.host.as_ref(), "host")?.reading()?,
        user: name(&line.user, "user")?,
        host: name(&line.host_name, "host_name")?,
        program: name(&line.program, "program")?,
        peer: name(&line.peer, "peer")?,
        command: text(&line.command, "command", CommandRecord::LONGEST_TEXT)?,
        outcome,
    }))
}

fn note(line: &Line<'_>) -> Result<Record> {
    let name = |field: &Option<Text<'_>>, name| {
        let Text(text) = needed(field.as_ref(), name)?;
        let is_fit = is_line(text, 1..=NoteRecord::LONGEST_NAME);
        is_fit.then(|| text.to_string()).ok_or_else(|| wrong(name, text))
    };
    let closes = needed(line.closes, "closes")?;
    let Text(text) = needed(line.text.as_ref(), "text")?;
    if !is_line(text, usize::from(!closes)..=NoteRecord::LONGEST) {
        return Err(wrong("text", text));
    }
    let life = life_of(line)?;
    Ok(Record::Note(NoteRecord {
        at: needed(line.host.as_ref(), "host")?.reading()?,
        user: name(&line.user, "user")?,
        host: name(&line.host_name, "host_name")?,
        life,
        sequence: needed(line.sequence, "sequence")?,
        text: text.to_string(),
        closes,
    }))
}

fn site(line: &Line<'_>) -> Result<Record> {
    let Text(text) = needed(line.text.as_ref(), "text")?;
    if !SiteRecord::holds(text) {
        return Err(wrong("text", text));
    }
    let at = needed(line.host.as_ref(), "host")?.reading()?;
    Ok(Record::Site(SiteRecord { at, text: text.to_string() }))
}
