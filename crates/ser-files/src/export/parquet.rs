//! Parquet, for databases and data frames: a row per changed input, and one per loss.
//!
//! Rows are the same as in CSV, so that both answer a question alike; here columns have types, and
//! what is not known is null. They are written in groups, so memory is that of one group.

use std::io::{self, Write};
use std::sync::Arc;

use parquet::basic::Compression;
use parquet::column::writer::ColumnWriter;
use parquet::data_type::ByteArray;
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{
    SerializedColumnWriter, SerializedFileWriter, SerializedRowGroupWriter,
};
use parquet::schema::parser::parse_message_type;
use ser_evidence::history::Held;
use ser_evidence::record::{Gap, Lost, Why};

use ser_evidence::time::Moment;
use ser_evidence::timeline::{EventId, Item, Timeline};

use super::axis::doubt_us;
use super::counted::Counted;
use super::refused::Refused;
use super::selection::Selection;
use super::statement::Origin;
use crate::digits::push_stamp;
use crate::missing::why_text;
use crate::names;

/// How many rows are held before they are written.
const GROUP_ROWS: usize = 65_536;

const SCHEMA: &str = "
message ser {
    required binary kind (STRING);
    required binary recorder (STRING);
    required binary life (STRING);
    optional int64 sequence (INTEGER(64, false));
    optional int32 entry (INTEGER(16, false));
    optional binary stamp (STRING);
    optional int32 input (INTEGER(8, false));
    optional boolean state;
    optional binary point (STRING);
    optional binary meaning (STRING);
    optional int64 utc (TIMESTAMP(MICROS, true));
    optional int64 utc_earliest (TIMESTAMP(MICROS, true));
    optional int64 utc_latest (TIMESTAMP(MICROS, true));
    optional int64 err_us;
    required boolean clock_was_set_before;
    optional int64 lost;
    optional binary lost_count (STRING);
    optional binary lost_why (STRING);
}";

/// Writes a selection. Entries without a time are in it.
///
/// # Errors
/// If `out` does not take it.
pub fn write(
    out: &mut (dyn Write + Send),
    timeline: &Timeline<'_>,
    selection: &Selection,
    origin: &Origin<'_>,
) -> Result<Counted, Refused> {
    written(out, timeline, selection, origin).map_err(|error| Refused::Io(as_io(error)))
}

fn written(
    out: &mut (dyn Write + Send),
    timeline: &Timeline<'_>,
    selection: &Selection,
    origin: &Origin<'_>,
) -> Result<Counted, ParquetError> {
    let mut counted = Counted::default();
    let mut file = SerializedFileWriter::new(
        out,
        Arc::new(parse_message_type(SCHEMA)?),
        Arc::new(properties(timeline, origin)),
    )?;
    let mut rows = Rows::new(timeline);
    for item in selection.items(timeline) {
        counted.count(item);
        match item {
            Item::Entry(event) => rows.entry(timeline, event),
            Item::Gap(event, index) => rows.gap(timeline, event, index),
            Item::ClockSet(_) => rows.is_after_set = true,
        }
        if rows.kind.len() >= GROUP_ROWS {
            rows.write(&mut file)?;
        }
    }
    for (history, recorder) in timeline.history().recorders.iter().zip(0..) {
        if history.is_not_reached {
            rows.not_reached(recorder);
        }
    }
    rows.write(&mut file)?;
    file.close()?;
    Ok(counted)
}

/// What the file says about itself.
fn properties(timeline: &Timeline<'_>, origin: &Origin<'_>) -> WriterProperties {
    let mut about = vec![KeyValue::new("site".to_owned(), names::harmless(&timeline.site().name))];
    if let Some(digest) = origin.site_digest {
        about.push(KeyValue::new("site_sha256".to_owned(), digest.to_owned()));
    }
    for missed in origin.not_reached {
        let name = names::harmless(&missed.recorder);
        about.push(KeyValue::new(format!("not_reached {name}"), names::harmless(&missed.why)));
    }
    if origin.damaged_lines > 0 {
        about.push(KeyValue::new("damaged_lines".to_owned(), origin.damaged_lines.to_string()));
    }
    WriterProperties::builder()
        .set_created_by(origin.program.to_owned())
        .set_compression(Compression::SNAPPY)
        .set_key_value_metadata(Some(about))
        .build()
}

/// What `out` said, where it was that.
fn as_io(error: ParquetError) -> io::Error {
    match error {
        ParquetError::External(error) => match error.downcast::<io::Error>() {
            Ok(error) => *error,
            Err(error) => io::Error::other(error),
        },
        error => io::Error::other(error),
    }
}

/// A column in which some rows have no value.
struct Column<T> {
    values: Vec<T>,
    /// For each row, whether it has one.
    levels: Vec<i16>,
}

impl<T> Column<T> {
    const fn new() -> Column<T> {
        Column { values: Vec::new(), levels: Vec::new() }
    }

    fn push(&mut self, value: Option<T>) {
        self.levels.push(i16::from(value.is_some()));
        self.values.extend(value);
    }
}

/// The name of a point, and what off and on mean.
type PointTexts = (ByteArray, [ByteArray; 2]);

/// The rows that are held.
struct Rows {
    /// By recorder and input: the name, and what off and on mean.
    points: Vec<Vec<Option<PointTexts>>>,
    is_after_set: bool,
    /// By recorder: its name, and those of its lives.
    names: Vec<(ByteArray, Vec<ByteArray>)>,
    kind: Vec<ByteArray>,
    recorder: Vec<ByteArray>,
    life: Vec<ByteArray>,
    sequence: Column<i64>,
    entry: Column<i32>,
    stamp: Column<ByteArray>,
    input: Column<i32>,
    state: Column<bool>,
    point: Column<ByteArray>,
    meaning: Column<ByteArray>,
    utc: Column<i64>,
    utc_earliest: Column<i64>,
    utc_latest: Column<i64>,
    err_us: Column<i64>,
    clock_was_set_before: Vec<bool>,
    lost: Column<i64>,
    lost_count: Column<ByteArray>,
    lost_why: Column<ByteArray>,
}

/// What all rows of an entry, or of a loss, have in common.
#[derive(Default)]
struct Common {
    kind: &'static str,
    sequence: Option<i64>,
    entry: Option<i32>,
    stamp: Option<ByteArray>,
    utc: Option<i64>,
    ends: (Option<i64>, Option<i64>),
    err_us: Option<i64>,
    is_after_set: bool,
    loss: Option<(Lost, Why)>,
}

impl Rows {
    fn new(timeline: &Timeline<'_>) -> Rows {
        let text = |text: &str| ByteArray::from(text);
        let names = timeline.history().recorders.iter().map(|history| {
            let lives = history.lives.iter().map(|life| text(&life.name().to_string()));
            (text(&names::harmless(&history.recorder.name)), lives.collect())
        });
        Rows {
            points: points(timeline),
            is_after_set: false,
            names: names.collect(),
            kind: Vec::new(),
            recorder: Vec::new(),
            life: Vec::new(),
            sequence: Column::new(),
            entry: Column::new(),
            stamp: Column::new(),
            input: Column::new(),
            state: Column::new(),
            point: Column::new(),
            meaning: Column::new(),
            utc: Column::new(),
            utc_earliest: Column::new(),
            utc_latest: Column::new(),
            err_us: Column::new(),
            clock_was_set_before: Vec::new(),
            lost: Column::new(),
            lost_count: Column::new(),
            lost_why: Column::new(),
        }
    }

    fn entry(&mut self, timeline: &Timeline<'_>, event: EventId) {
        let (Some(held), Some(life)) = (timeline.held(event), timeline.life(event)) else { return };
        let Held { sequence, entry, number, .. } = *held;
        let mut stamp = Vec::new();
        push_stamp(&mut stamp, &entry.time);
        let bound = timeline.moved_utc(event, None);
        let utc = timeline.time(event).map(Moment::us);
        let doubt = utc.and_then(|us| doubt_us(timeline, event, us));
        let common = Common {
            kind: if entry.changed.is_empty() { "entry" } else { "change" },
            sequence: i64::try_from(sequence).ok().filter(|_| !life.is_by_number),
            entry: Some(number.into()),
            stamp: Some(ByteArray::from(stamp)),
            utc,
            ends: (bound.lo().map(Moment::us), bound.hi().map(Moment::us)),
            err_us: doubt.and_then(|us| i64::try_from(us).ok()),
            is_after_set: std::mem::take(&mut self.is_after_set),
            loss: None,
        };
        if entry.changed.is_empty() {
            self.row(event, &common, None);
        }
        for input in entry.changed.numbers() {
            let change = (input, held.state_of(input));
            self.row(event, &common, Some(change));
        }
    }

    fn gap(&mut self, timeline: &Timeline<'_>, event: EventId, index: usize) {
        let gap = timeline.life(event).and_then(|life| life.gaps.get(index));
        let Some(gap) = gap else { return };
        let common = Common {
            kind: "loss",
            sequence: i64::try_from(gap.after).ok(),
            loss: Some((gap.lost, gap.why)),
            ..Common::default()
        };
        self.row(event, &common, None);
    }

    /// A recorder that nobody could read.
    fn not_reached(&mut self, recorder: u32) {
        let Gap { lost, why, .. } = Gap::NOT_REACHED;
        let common = Common { kind: "loss", loss: Some((lost, why)), ..Common::default() };
        // It has no life.
        self.row(EventId { recorder, life: u32::MAX, place: 0 }, &common, None);
    }

    fn row(&mut self, event: EventId, common: &Common, change: Option<(u8, Option<bool>)>) {
        let of_recorder = self.names.get(event.recorder as usize);
        // A `ByteArray` by default is no text, and cannot be written.
        let recorder = of_recorder.map_or_else(|| ByteArray::from(""), |(name, _)| name.clone());
        let life = of_recorder.and_then(|(_, lives)| lives.get(event.life as usize).cloned());
        let texts = change.and_then(|(input, on)| {
            let of_recorder = self.points.get(event.recorder as usize)?;
            let (name, states) = of_recorder.get(usize::from(input).checked_sub(1)?)?.as_ref()?;
            Some((name.clone(), on.and_then(|on| states.get(usize::from(on)).cloned())))
        });
        let (point, meaning) = texts.unzip();
        self.kind.push(ByteArray::from(common.kind));
        self.recorder.push(recorder);
        self.life.push(life.unwrap_or_else(|| ByteArray::from("")));
        self.sequence.push(common.sequence);
        self.entry.push(common.entry);
        self.stamp.push(common.stamp.clone());
        self.input.push(change.map(|(input, _)| input.into()));
        self.state.push(change.and_then(|(_, on)| on));
        self.point.push(point);
        self.meaning.push(meaning.flatten());
        self.utc.push(common.utc);
        self.utc_earliest.push(common.ends.0);
        self.utc_latest.push(common.ends.1);
        self.err_us.push(common.err_us);
        self.clock_was_set_before.push(common.is_after_set);
        let counted = common.loss.map(|(lost, _)| match lost {
            Lost::Exactly(count) => (Some(i64::from(count)), "exactly"),
            Lost::AtLeast(count) => (Some(i64::from(count)), "at least"),
            Lost::Unknown => (None, "unknown"),
        });
        self.lost.push(counted.and_then(|(count, _)| count));
        self.lost_count.push(counted.map(|(_, word)| ByteArray::from(word)));
        let why = common.loss.map(|(_, why)| ByteArray::from(why_text(why).into_bytes()));
        self.lost_why.push(why);
    }

    /// Writes the rows as a group, and holds none.
    fn write<W: Write + Send>(
        &mut self,
        file: &mut SerializedFileWriter<W>,
    ) -> Result<(), ParquetError> {
        if self.kind.is_empty() {
            return Ok(());
        }
        let mut group = file.next_row_group()?;
        texts(&mut group, &mut self.kind, None)?;
        texts(&mut group, &mut self.recorder, None)?;
        texts(&mut group, &mut self.life, None)?;
        longs(&mut group, &mut self.sequence)?;
        ints(&mut group, &mut self.entry)?;
        optional_texts(&mut group, &mut self.stamp)?;
        ints(&mut group, &mut self.input)?;
        flags(&mut group, &mut self.state.values, Some(&self.state.levels))?;
        self.state.levels.clear();
        optional_texts(&mut group, &mut self.point)?;
        optional_texts(&mut group, &mut self.meaning)?;
        for column in [&mut self.utc, &mut self.utc_earliest, &mut self.utc_latest] {
            longs(&mut group, column)?;
        }
        longs(&mut group, &mut self.err_us)?;
        flags(&mut group, &mut self.clock_was_set_before, None)?;
        longs(&mut group, &mut self.lost)?;
        optional_texts(&mut group, &mut self.lost_count)?;
        optional_texts(&mut group, &mut self.lost_why)?;
        group.close().map(drop)
    }
}

/// By recorder and input: the name, and what off and on mean.
fn points(timeline: &Timeline<'_>) -> Vec<Vec<Option<PointTexts>>> {
    let text = |text: String| ByteArray::from(text.into_bytes());
    let site = timeline.site();
    let of_input = |id: Option<_>, input: u8| {
        let point = id.and_then(|id| site.point_at(id, input))?;
        let states = [false, true].map(|on| text(names::state(timeline, Some(point), on)));
        Some((text(names::point(timeline, Some(point), input)), states))
    };
    let recorders = timeline.history().recorders.iter();
    recorders
        .map(|recorder| (1..=32).map(|input| of_input(recorder.site, input)).collect())
        .collect()
}

type Group<'g, W> = SerializedRowGroupWriter<'g, W>;

/// Writes the next column of a group.
fn next<W: Write + Send>(
    group: &mut Group<'_, W>,
    write: impl FnOnce(&mut ColumnWriter<'_>) -> Result<usize, ParquetError>,
) -> Result<(), ParquetError> {
    let mut column: SerializedColumnWriter<'_> = group
        .next_column()?
        .ok_or_else(|| ParquetError::General("the layout has no further column".to_owned()))?;
    write(column.untyped())?;
    column.close()
}

fn wrong_type() -> ParquetError {
    ParquetError::General("the layout has another type in this column".to_owned())
}

fn texts<W: Write + Send>(
    group: &mut Group<'_, W>,
    values: &mut Vec<ByteArray>,
    levels: Option<&[i16]>,
) -> Result<(), ParquetError> {
    next(group, |column| match column {
        ColumnWriter::ByteArrayColumnWriter(column) => column.write_batch(values, levels, None),
        _ => Err(wrong_type()),
    })?;
    values.clear();
    Ok(())
}

fn optional_texts<W: Write + Send>(
    group: &mut Group<'_, W>,
    column: &mut Column<ByteArray>,
) -> Result<(), ParquetError> {
    texts(group, &mut column.values, Some(&column.levels))?;
    column.levels.clear();
    Ok(())
}

fn longs<W: Write + Send>(
    group: &mut Group<'_, W>,
    column: &mut Column<i64>,
) -> Result<(), ParquetError> {
    let Column { values, levels } = column;
    next(group, |column| match column {
        ColumnWriter::Int64ColumnWriter(column) => column.write_batch(values, Some(levels), None),
        _ => Err(wrong_type()),
    })?;
    values.clear();
    levels.clear();
    Ok(())
}

fn ints<W: Write + Send>(
    group: &mut Group<'_, W>,
    column: &mut Column<i32>,
) -> Result<(), ParquetError> {
    let Column { values, levels } = column;
    next(group, |column| match column {
        ColumnWriter::Int32ColumnWriter(column) => column.write_batch(values, Some(levels), None),
        _ => Err(wrong_type()),
    })?;
    values.clear();
    levels.clear();
    Ok(())
}

fn flags<W: Write + Send>(
    group: &mut Group<'_, W>,
    values: &mut Vec<bool>,
    levels: Option<&[i16]>,
) -> Result<(), ParquetError> {
    next(group, |column| match column {
        ColumnWriter::BoolColumnWriter(column) => column.write_batch(values, levels, None),
        _ => Err(wrong_type()),
    })?;
    values.clear();
    Ok(())
}
