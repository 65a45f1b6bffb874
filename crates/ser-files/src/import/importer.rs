//! Reads any number of files, and makes records of what is in them.

use std::collections::HashMap;
use std::io;

use jiff::tz::TimeZone;
use ser_evidence::record::Record;

use super::calendar::DateOrder;
use super::comtrade::{self, Extent};
use super::cytime::{self, Epoch};
use super::entries::{Made, Maker};
use super::format::Format;
use super::inputs::{Inputs, MOST_RECORDERS};
use super::list::{Found, LONGEST, fit};
use super::map::Map;
use super::notes::{Note, Notes, Refusal};
use super::states::Meanings;
use super::text::{Input, TextLines, opened};
use super::timed::{Timed, joined, timed};
use super::zone::date_order;
use super::{prc002, sel};
use crate::Source;

/// The most lists of one recorder: one a day for a year, and more.
const MOST_LISTS: usize = 500;

/// The most recorders of our own files: a name for each is kept.
const MOST_OWN_RECORDERS: usize = 65_536;

/// Takes the records of our own files as they are read: whose it is, the record, and the remark for
/// people that goes with it.
pub type Own<'o> = dyn FnMut(&str, &Record, Option<&str>) -> io::Result<()> + 'o;

/// What the user says of the files.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Their format; by their content if not given.
    pub format: Option<Format>,
    /// The zone of times that have none.
    pub zone: Option<TimeZone>,
    /// The order of dates.
    pub dates: Option<DateOrder>,
    /// From when `CyTime` counts seconds.
    pub epoch: Option<Epoch>,
    /// How far the clocks may be from UTC, in milliseconds; nothing is known of them otherwise.
    pub doubt_ms: Option<u32>,
    /// What names of the files mean.
    pub map: Map,
}

/// What was read of a file.
#[derive(Clone, Debug)]
pub struct Read {
    /// Its format.
    pub format: Format,
    /// What there is to tell.
    pub notes: Notes,
    /// The channels of a COMTRADE record.
    pub extent: Option<Extent>,
}

/// A file whose beginning was looked at.
pub struct Opened<'i> {
    format: Format,
    head: Vec<u8>,
    input: Input<'i>,
}

impl Opened<'_> {
    /// The format in which it will be read.
    #[must_use]
    pub const fn format(&self) -> Format {
        self.format
    }
}

/// Reads files.
#[derive(Debug, Default)]
pub struct Importer {
    options: Options,
    groups: Vec<Group>,
    /// What was handed on, counted.
    own: Imported,
}

/// What belongs to one recorder.
#[derive(Debug)]
struct Group {
    name: String,
    found: Found,
    lists: Vec<Timed>,
}

/// What all files became.
#[derive(Debug, Default)]
pub struct Imported {
    /// The recorders.
    pub recorders: Vec<ImportedRecorder>,
    /// What there is to tell of all files together.
    pub notes: Notes,
    records: Vec<(usize, Record, Option<String>)>,
    /// Where each recorder is in the list.
    by_name: HashMap<String, usize>,
}

/// A recorder of ours that a foreign one became.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ImportedRecorder {
    /// Its name.
    pub name: String,
    /// How many entries it has.
    pub entries: u64,
    /// How many points have names.
    pub points: u64,
}

impl Importer {
    /// Reads nothing yet.
    #[must_use]
    pub fn new(options: Options) -> Importer {
        Importer { options, ..Importer::default() }
    }

    /// Looks at the beginning of a file, and tells its format.
    ///
    /// # Errors
    /// If nothing can be read from it, or it is in no format that is known.
    pub fn open<'i>(&self, input: impl io::Read + 'i) -> Result<Opened<'i>, Refusal> {
        let (head, input) = opened(input)?;
        let format = match self.options.format {
            Some(format) => format,
            None => Format::of(&head).ok_or_else(|| {
                match comtrade::is_dat(&String::from_utf8_lossy(&head)) {
                    true => Refusal::NoConfiguration,
                    false => Refusal::Unknown,
                }
            })?,
        };
        Ok(Opened { format, head, input })
    }

    /// Reads a file of this recorder. `data` opens the data of a COMTRADE configuration. If the file
    /// is one of ours, its records go to `own` at once.
    ///
    /// # Errors
    /// If nothing can be read from it, or not without being told something, or if `own` fails.
    pub fn read(
        &mut self,
        recorder: &str,
        Opened { format, head, input }: Opened<'_>,
        data: impl FnOnce() -> io::Result<Box<dyn io::Read>>,
        own: &mut Own<'_>,
    ) -> Result<Read, Refusal> {
        let mut read = Read { format, notes: Notes::default(), extent: None };
        if matches!(format, Format::Csv | Format::Jsonl) {
            self.read_own(recorder, input, &mut read.notes, own)?;
            return Ok(read);
        }
        let group = self.group(recorder);
        let Some(group) = self.groups.get_mut(group) else { return Ok(read) };
        group.found.lists.clear();
        read_foreign(&mut group.found, (&head, input, data), self.options.epoch, &mut read)?;
        if std::mem::take(&mut group.found.is_cut) {
            let why = format!(
                "a name longer than {LONGEST} characters is cut, and has eight digits at its end that \
                 tell it from others"
            );
            read.notes.remark(None, why);
        }
        let lists = std::mem::take(&mut group.found.lists);
        if group.lists.len() + lists.len() > MOST_LISTS {
            let most = u64::try_from(MOST_LISTS).unwrap_or(u64::MAX);
            return Err(Refusal::TooMuch { what: "lists", most });
        }
        let needs_order = lists.iter().any(|list| !list.rows.is_empty());
        let order = match needs_order {
            true => date_order(&lists, self.options.dates, &mut read.notes)?,
            false => DateOrder::Ymd,
        };
        for list in lists {
            group.lists.push(timed(list, order, self.options.zone.as_ref(), &mut read.notes)?);
        }
        Ok(read)
    }

    fn group(&mut self, name: &str) -> usize {
        // A slash parts recorder and point where points are named.
        let name = fit(&name.replace('/', "-"));
        let known = self.groups.iter().position(|group| group.name == name);
        known.unwrap_or_else(|| {
            self.groups.push(Group { name, found: Found::default(), lists: Vec::new() });
            self.groups.len() - 1
        })
    }

    fn read_own(
        &mut self,
        recorder: &str,
        input: Input<'_>,
        notes: &mut Notes,
        own: &mut Own<'_>,
    ) -> Result<(), Refusal> {
        let mut source = Source::new(input, recorder)
            .map_err(|error| Refusal::damaged(error.line, error.problem.to_string()))?;
        while let Some(record) = source.read() {
            match record {
                Ok(record) => {
                    let recorder = self.own.recorder(source.recorder());
                    if recorder >= MOST_OWN_RECORDERS {
                        let most = u64::try_from(MOST_OWN_RECORDERS).unwrap_or(u64::MAX);
                        return Err(Refusal::TooMuch { what: "recorders", most });
                    }
                    self.own.count(recorder, &record);
                    own(source.recorder(), &record, source.note()).map_err(Refusal::NotTaken)?;
                }
                Err(error) if error.is_of_one_line() => {
                    notes.leave_out(error.line, error.problem.to_string());
                    let gap = Record::Gap(source.damage());
                    own(source.recorder(), &gap, None).map_err(Refusal::NotTaken)?;
                }
                Err(error) => return Err(Refusal::damaged(error.line, error.problem.to_string())),
            }
        }
        Ok(())
    }

    /// Makes records of everything.
    #[must_use]
    pub fn finish(self) -> Imported {
        let mut imported = self.own;
        for group in self.groups {
            imported.add_group(group, &self.options);
        }
        imported
    }
}

/// Reads a file in one of the foreign formats.
fn read_foreign(
    found: &mut Found,
    (head, input, data): (&[u8], Input<'_>, impl FnOnce() -> io::Result<Box<dyn io::Read>>),
    epoch: Option<Epoch>,
    read: &mut Read,
) -> Result<(), Refusal> {
    let notes = &mut read.notes;
    if read.format == Format::Cytime {
        return cytime::read(input, epoch, found, notes);
    }
    let mut lines = TextLines::new(input);
    match read.format {
        Format::SelSer => sel::report::read(&mut lines, found, notes)?,
        Format::SelCser => sel::compressed::read(&mut lines, found, notes)?,
        Format::Prc002 => prc002::read(&mut lines, found, notes)?,
        Format::Comtrade if comtrade::is_cff(&String::from_utf8_lossy(head)) => {
            read.extent = Some(comtrade::read_combined(lines, found, notes)?);
            return Ok(());
        }
        Format::Comtrade => {
            let data = || Ok(Box::new(io::BufReader::new(data()?)) as Input<'static>);
            read.extent = Some(comtrade::read(&mut lines, data, found, notes)?);
        }
        Format::Csv | Format::Jsonl | Format::Cytime => {}
    }
    if let Some(line) = lines.latin_1() {
        notes.remark(Some(line), "this is not UTF-8; such lines are read as Latin-1");
    }
    Ok(())
}

impl Imported {
    /// All records of lists, and whose they are. Those of our own files have been handed on.
    pub fn records(&self) -> impl Iterator<Item = (&str, &Record)> {
        self.with_notes().map(|(recorder, record, _)| (recorder, record))
    }

    /// The same with the remarks for people that go with them.
    pub(super) fn with_notes(&self) -> impl Iterator<Item = (&str, &Record, Option<&str>)> {
        self.records.iter().map(|(recorder, record, note)| {
            let name = self.recorders.get(*recorder).map_or("", |recorder| &*recorder.name);
            (name, record, note.as_deref())
        })
    }

    fn recorder(&mut self, name: &str) -> usize {
        if let Some(known) = self.by_name.get(name) {
            return *known;
        }
        let recorder = ImportedRecorder { name: name.to_owned(), ..ImportedRecorder::default() };
        self.recorders.push(recorder);
        self.by_name.insert(name.to_owned(), self.recorders.len() - 1);
        self.recorders.len() - 1
    }

    fn count(&mut self, recorder: usize, record: &Record) {
        if let Some(recorder) = self.recorders.get_mut(recorder) {
            recorder.entries += u64::from(matches!(record, Record::Entry(_)));
            recorder.points += u64::from(matches!(record, Record::Point(_)));
        }
    }

    fn add(
        &mut self,
        recorder: usize,
        record: Record,
        (line, note): (Option<u64>, Option<String>),
    ) {
        self.count(recorder, &record);
        if let Some(note) = &note {
            self.notes.remark(line, note);
        }
        self.records.push((recorder, record, note));
    }

    fn add_group(&mut self, group: Group, options: &Options) {
        let Group { name, found, lists } = group;
        let lists = joined(lists);
        let texts = (&found.points, &found.words);
        let meanings = Meanings::of(&lists, texts, &options.map, &mut self.notes);
        let inputs = Inputs::of(&lists, &found.points, &name, &options.map);
        let maker = Maker {
            points: &found.points,
            words: &found.words,
            inputs: &inputs,
            meanings: &meanings,
            doubt_ms: options.doubt_ms,
        };
        let places: Vec<usize> = inputs.recorders.iter().map(|name| self.recorder(name)).collect();
        let mut made = maker.recorders();
        for list in &lists {
            made.extend(maker.list(list, &mut self.notes));
        }
        for Made { recorder, record, line, note } in made {
            if let Some(place) = places.get(recorder) {
                self.add(*place, record, (line, note));
            }
        }
        if inputs.recorders.len() > 1 {
            self.notes.remarks.push(Note {
                line: None,
                why: format!(
                    "more points moved than a recorder of ours has inputs, or the map says so: \
                     {} are one clock",
                    inputs.recorders.join(", ")
                ),
            });
        }
        if let without @ 1.. = inputs.without_input.len() {
            let why = format!(
                "{without} points that moved are left out: {MOST_RECORDERS} recorders are full"
            );
            self.notes.remark(None, why);
        }
        for absent in options.map.unused(|name| found.points.contains(name)) {
            self.notes.remark(None, format!("the map names {absent:?}, which no file has"));
        }
    }
}
