//! CSV as `ser-cli` writes it: a row for each input that changed, and one for each loss.
//!
//! The rows of one entry stand together and become one entry again. A row shows the state of its
//! input only. The states of other inputs are carried on from earlier rows as far as these follow
//! each other without a gap, and [`known`](EntryRecord::known) says which they are. A header, a
//! loss, a damaged row or a jump in the numbers ends what is known.
//!
//! A file of several recorders names the recorder of each row in a column of its own, after the
//! first seven.
//!
//! Files of earlier versions have only the first four columns. A header may come again, with other
//! columns, where a file was continued. Every row is a line: a quote that is not closed damages its
//! own row and not the next.

use std::collections::HashMap;
use std::io::BufRead;

use ser_evidence::record::{EntryRecord, Gap, Life, Lost, Record, Told, Why};
use ser_proto::{Entry, Inputs, TimeStamp};

use crate::error::{MAX_LINE_LEN, ReadError, quoted};
use crate::fields::Fields;
use crate::lines::Lines;
use crate::merged::without_apostrophe;
use crate::missing::{why_named, why_text};
use crate::stamp;

/// The columns, in their order. Later versions may append more.
const COLUMNS: [&str; 7] = ["entry", "time", "input", "state", "sequence", "life", "note"];

/// How many columns the files of the first versions have.
const FIRST_COLUMNS: usize = 4;

/// The column that follows in a file of several recorders.
const RECORDER_COLUMN: &str = "recorder";

/// Of how many recorders a file may hold entries. Each needs memory.
const MAX_RECORDERS: usize = 4096;

/// Whether this is the first line of such a file.
pub(crate) fn is_header(line: &[u8]) -> bool {
    let line = line.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(line).trim_ascii_end();
    let mut fields = line.split(|&byte| byte == b',');
    COLUMNS.iter().take(FIRST_COLUMNS).all(|name| fields.next() == Some(name.as_bytes()))
}

/// Reads the records of a file. After an error in one line it goes on with the next.
pub struct Reader<R> {
    lines: Lines<R>,
    recorders: Recorders,
    /// Whose record was handed out last.
    told: usize,
    fields: Fields,
    parser: Parser,
    /// What the rows have; `None` before the first header.
    columns: Option<Columns>,
    gathering: Option<Gathering>,
    /// What comes after the entry that was handed out just now, and whose it is.
    held: Option<(usize, Result<Record, ReadError>)>,
    is_over: bool,
}

impl<R: BufRead> Reader<R> {
    /// Reads `input`, the file of this recorder.
    pub fn new(input: R, recorder: &str) -> Reader<R> {
        Reader {
            lines: Lines::new(input, MAX_LINE_LEN),
            recorders: Recorders::new(recorder),
            told: 0,
            fields: Fields::new(),
            parser: Parser::default(),
            columns: None,
            gathering: None,
            held: None,
            is_over: false,
        }
    }

    /// The name of the recorder of the record that was read last.
    #[must_use]
    pub fn recorder(&self) -> &str {
        self.recorders.name(self.told)
    }

    /// The next record, without the name of its recorder.
    pub fn read(&mut self) -> Option<Result<Record, ReadError>> {
        let (recorder, record) = self.next_record()?;
        self.told = recorder;
        Some(record)
    }

    fn next_record(&mut self) -> Option<(usize, Result<Record, ReadError>)> {
        if let Some(held) = self.held.take() {
            return Some(held);
        }
        while !self.is_over {
            let row = match self.lines.next_whole() {
                None => {
                    self.is_over = true;
                    break;
                }
                Some(Err(error)) => Err(error),
                Some(Ok(line)) => {
                    row(line, self.columns, &mut self.fields, &mut self.parser, &mut self.recorders)
                        .map_err(|why| ReadError::damaged(self.lines.number(), why))
                }
            };
            match row {
                Ok(Row::Change(change)) => match self.gather(&change) {
                    Some(entry) => return Some(entry),
                    None => continue,
                },
                // What was known of the states of this recorder ends here.
                Ok(Row::Loss(recorder, gap)) => {
                    self.held = Some((recorder, Ok(Record::Gap(gap))));
                    let entry = self.finish();
                    self.recorders.forget(recorder);
                    return entry.or_else(|| self.held.take());
                }
                Ok(Row::Header(columns)) => self.columns = Some(columns),
                Err(error) => {
                    self.is_over = !error.is_of_one_line();
                    // Whose it was, nobody knows; most rows follow one of the same recorder.
                    self.held = Some((self.recorders.last, Err(error)));
                }
            }
            // Whatever else it was, it may have been of any recorder.
            let entry = self.finish();
            self.recorders.forget_all();
            if let Some(next) = entry.or_else(|| self.held.take()) {
                return Some(next);
            }
        }
        self.finish()
    }

    /// Adds a row to the entry that it belongs to. Returns the entry before, if it has ended.
    fn gather(&mut self, change: &Change) -> Option<(usize, Result<Record, ReadError>)> {
        if let Some(gathering) = self.gathering.as_mut().filter(|entry| entry.goes_on_with(change))
        {
            gathering.add(change);
            return None;
        }
        let finished = self.finish();
        let mut gathering = Gathering { key: change.key, changed: 0, on: 0, told: 0 };
        gathering.add(change);
        self.gathering = Some(gathering);
        finished
    }

    fn finish(&mut self) -> Option<(usize, Result<Record, ReadError>)> {
        let gathered = self.gathering.take()?;
        let recorder = gathered.key.recorder;
        let states = self.recorders.states.get_mut(recorder)?;
        Some((recorder, Ok(Record::Entry(states.entry(&gathered)))))
    }
}

impl<R: BufRead> Iterator for Reader<R> {
    type Item = Result<Told, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        let record = self.read()?;
        Some(record.map(|record| Told { recorder: self.recorder().to_owned(), record }))
    }
}

/// What a line is.
enum Row {
    Header(Columns),
    Change(Change),
    Loss(usize, Gap),
}

/// The columns of a file.
#[derive(Clone, Copy)]
struct Columns {
    /// How many of those that every recorder's file has.
    count: usize,
    has_recorder: bool,
}

/// The recorders of a file, with the states of their inputs. The first is the one that the file is
/// named after.
struct Recorders {
    names: Vec<String>,
    states: Vec<States>,
    by_name: HashMap<String, usize>,
    /// The one of the row before.
    last: usize,
}

impl Recorders {
    fn new(first: &str) -> Recorders {
        Recorders {
            names: vec![first.to_owned()],
            states: vec![States::default()],
            by_name: HashMap::from([(first.to_owned(), 0)]),
            last: 0,
        }
    }

    fn name(&self, place: usize) -> &str {
        self.names.get(place).map_or("", String::as_str)
    }

    /// The place of the recorder with this name; the first one's if there is none.
    fn place(&mut self, name: &[u8]) -> Result<usize, String> {
        if name.is_empty() {
            return Ok(0);
        }
        if self.name(self.last).as_bytes() == name {
            return Ok(self.last);
        }
        let text = std::str::from_utf8(name);
        let text = text.map_err(|_| {
            format!("the recorder {} is not UTF-8; save the file as UTF-8", quoted(name))
        })?;
        self.last = match self.by_name.get(text) {
            Some(&known) => known,
            None if self.names.len() < MAX_RECORDERS => {
                let place = self.names.len();
                self.names.push(text.to_owned());
                self.states.push(States::default());
                self.by_name.insert(text.to_owned(), place);
                place
            }
            None => return Err(format!("a file holds no more than {MAX_RECORDERS} recorders")),
        };
        Ok(self.last)
    }

    fn forget(&mut self, place: usize) {
        if let Some(states) = self.states.get_mut(place) {
            *states = States::default();
        }
    }

    fn forget_all(&mut self) {
        self.states.iter_mut().for_each(|states| *states = States::default());
    }
}

/// A row of an entry.
struct Change {
    key: Key,
    /// The input that changed, as a bit; 0 if none did.
    input: u32,
    /// Whether it is on from then; `None` if that is not known.
    on: Option<bool>,
}

/// What the rows of one entry have in common.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Key {
    recorder: usize,
    number: u16,
    time: TimeStamp,
    sequence: Option<u64>,
    life: Life,
}

/// An entry whose rows are coming.
struct Gathering {
    key: Key,
    changed: u32,
    on: u32,
    /// Of the changed ones those whose state is told.
    told: u32,
}

impl Gathering {
    fn goes_on_with(&self, change: &Change) -> bool {
        // An input changes once in an entry. If it comes again, so does the whole entry: it was
        // read twice.
        self.key == change.key && self.changed & change.input == 0 && change.input != 0
    }

    fn add(&mut self, change: &Change) {
        self.changed |= change.input;
        self.on |= if change.on == Some(true) { change.input } else { 0 };
        self.told |= if change.on.is_some() { change.input } else { 0 };
    }
}

/// The states of inputs, as far as rows have shown them.
#[derive(Default)]
struct States {
    last: Option<Key>,
    on: u32,
    known: u32,
}

impl States {
    fn entry(&mut self, gathered: &Gathering) -> EntryRecord {
        let Gathering { key, changed, on, told } = *gathered;
        if !self.last.is_some_and(|last| last.is_before(&key)) {
            (self.on, self.known) = (0, 0);
        }
        self.on = self.on & !changed | on;
        self.known = self.known & !changed | told;
        self.last = Some(key);
        let (changed, state) = (Inputs(changed), Inputs(self.on));
        EntryRecord {
            life: key.life,
            sequence: key.sequence,
            number: key.number,
            entry: Entry { changed, state, time: key.time },
            known: Inputs(self.known),
        }
    }
}

impl Key {
    /// Whether the other entry is the next one.
    fn is_before(&self, next: &Key) -> bool {
        let follows = match (self.sequence, next.sequence) {
            (Some(last), Some(next)) => last.checked_add(1) == Some(next),
            (None, None) => self.number.checked_add(1) == Some(next.number),
            _ => false,
        };
        follows && self.life == next.life
    }
}

/// Understands fields. Neighbouring rows often have the same time, and nearly always the same life.
struct Parser {
    time: ([u8; 23], TimeStamp),
    life: (Vec<u8>, Life),
}

impl Default for Parser {
    fn default() -> Parser {
        let time =
            TimeStamp { year: 0, month: 0, day: 0, hour: 0, minute: 0, second: 0, millisecond: 0 };
        Parser { time: ([0; 23], time), life: (Vec::new(), Life::UNKNOWN) }
    }
}

impl Parser {
    fn time(&mut self, text: &[u8]) -> Option<TimeStamp> {
        let (known, time) = &self.time;
        if text == known {
            return Some(*time);
        }
        let time = stamp::parse(text, None)?;
        if let Ok(text) = text.try_into() {
            self.time = (text, time);
        }
        Some(time)
    }

    fn life(&mut self, text: &[u8]) -> Option<Life> {
        let (known, life) = &self.life;
        if text == known {
            return Some(*life);
        }
        let life = Life::from_name(std::str::from_utf8(text).ok()?)?;
        self.life = (text.to_vec(), life);
        Some(life)
    }
}

fn row(
    line: &[u8],
    columns: Option<Columns>,
    fields: &mut Fields,
    parser: &mut Parser,
    recorders: &mut Recorders,
) -> Result<Row, String> {
    fields.split(line)?;
    if fields.field(0) == COLUMNS.first().map_or(&b""[..], |name| name.as_bytes()) {
        return header(fields);
    }
    let Columns { count, has_recorder } = columns.ok_or("there is no header before this row")?;
    let wanted = count + usize::from(has_recorder);
    if fields.count() < wanted {
        return Err(format!("{} fields where {wanted} have to be", fields.count()));
    }
    let recorder = match has_recorder {
        true => recorders.place(made_plain(fields.field(COLUMNS.len())))?,
        false => 0,
    };
    let is_loss = (0..FIRST_COLUMNS).all(|place| fields.field(place).is_empty());
    if is_loss {
        loss(fields, parser).map(|gap| Row::Loss(recorder, gap))
    } else {
        change(recorder, fields, parser).map(Row::Change)
    }
}

fn header(fields: &Fields) -> Result<Row, String> {
    let count = fields.count().min(COLUMNS.len());
    let is_ours = |place: usize, name: &str| fields.field(place) == name.as_bytes();
    let all_ours = COLUMNS.iter().take(count).enumerate().all(|(place, name)| is_ours(place, name));
    let has_recorder = is_ours(COLUMNS.len(), RECORDER_COLUMN);
    match count {
        FIRST_COLUMNS | 7 if all_ours => Ok(Row::Header(Columns { count, has_recorder })),
        _ => Err("this header has other columns than entry,time,input,state,…".to_owned()),
    }
}

fn change(recorder: usize, fields: &Fields, parser: &mut Parser) -> Result<Change, String> {
    let wrong = |place: usize| {
        let name = COLUMNS.get(place).copied().unwrap_or_default();
        format!("{name} cannot be {}", quoted(fields.field(place)))
    };
    let number = number(fields.field(0)).ok_or_else(|| wrong(0))?;
    let time = parser.time(fields.field(1)).ok_or_else(|| wrong(1))?;
    let (sequence, life) = place(fields, parser)?;
    let key = Key { recorder, number, time, sequence, life };
    let (input, state) = (fields.field(2), fields.field(3));
    if input.is_empty() && state.is_empty() {
        return Ok(Change { key, input: 0, on: None });
    }
    let input = self::number::<u32>(input).filter(|input| (1..=32).contains(input));
    let input = 1_u32 << (input.ok_or_else(|| wrong(2))? - 1);
    let on = match state {
        b"1" => Some(true),
        b"0" => Some(false),
        b"?" => None,
        _ => return Err(wrong(3)),
    };
    Ok(Change { key, input, on })
}

/// The sequence and the life of a row.
fn place(fields: &Fields, parser: &mut Parser) -> Result<(Option<u64>, Life), String> {
    let wrong = |name: &str, text: &[u8]| format!("{name} cannot be {}", quoted(text));
    let (sequence, life) = (fields.field(4), fields.field(5));
    let sequence = match sequence {
        b"" => None,
        text => Some(number(text).ok_or_else(|| wrong("sequence", text))?),
    };
    let life = match life {
        b"" => Life::UNKNOWN,
        text => parser.life(made_plain(text)).ok_or_else(|| wrong("life", text))?,
    };
    Ok((sequence, life))
}

/// A text without what an export for spreadsheets puts before one that they would take for
/// something else.
fn made_plain(text: &[u8]) -> &[u8] {
    match text.first() {
        Some(b'\'') => std::str::from_utf8(text).map_or(text, |t| without_apostrophe(t).as_bytes()),
        _ => text,
    }
}

fn loss(fields: &Fields, parser: &mut Parser) -> Result<Gap, String> {
    let note = fields.field(6);
    let understood = std::str::from_utf8(note).ok().and_then(lost_and_why);
    let (lost, why) = understood.ok_or_else(|| format!("this is not a loss: {}", quoted(note)))?;
    let (after, life) = place(fields, parser)?;
    Ok(Gap { life, after, lost, why })
}

/// A loss as the note of its row: `lost 37 (exactly) after 120: overwritten`.
#[must_use]
pub fn loss_note(gap: &Gap) -> String {
    let lost = match gap.lost {
        Lost::Exactly(count) => format!("lost {count} (exactly)"),
        Lost::AtLeast(count) => format!("lost {count} (at least)"),
        Lost::Unknown => "lost an unknown number".to_owned(),
    };
    let after = gap.after.map(|after| format!(" after {after}")).unwrap_or_default();
    format!("{lost}{after}: {}", why_text(gap.why))
}

/// Understands [`loss_note`].
fn lost_and_why(note: &str) -> Option<(Lost, Why)> {
    let (count, why) = note.strip_prefix("lost ")?.split_once(": ")?;
    let count = count.split_once(" after ").map_or(count, |(count, _)| count);
    let lost = if count == "an unknown number" {
        Lost::Unknown
    } else if let Some(count) = count.strip_suffix(" (exactly)") {
        Lost::Exactly(number(count.as_bytes())?)
    } else {
        Lost::AtLeast(number(count.strip_suffix(" (at least)")?.as_bytes())?)
    };
    let why = match why.strip_prefix("not recorded, inputs ") {
        Some(list) => Why::not_recorded(inputs(list)?),
        None => why_named(why)?,
    };
    Some((lost, why))
}

fn inputs(list: &str) -> Option<Inputs> {
    list.split(' ').try_fold(Inputs(0), |Inputs(inputs), text| {
        let place = number::<u32>(text.as_bytes())?.checked_sub(1)?;
        Some(Inputs(inputs | 1_u32.checked_shl(place)?))
    })
}

fn number<T: TryFrom<u64>>(digits: &[u8]) -> Option<T> {
    if digits.is_empty() {
        return None;
    }
    let number = digits.iter().try_fold(0_u64, |number, digit| {
        let value = digit.is_ascii_digit().then(|| u64::from(digit - b'0'))?;
        number.checked_mul(10)?.checked_add(value)
    })?;
    T::try_from(number).ok()
}
