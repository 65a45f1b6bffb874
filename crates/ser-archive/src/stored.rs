//! Records as columns, and back.

use ser_evidence::record::{EntryRecord, Life, Record};
use ser_evidence::time::{Moment, shown};
use ser_files::jsonl;
use ser_proto::{Entry, Inputs, TimeStamp};

use crate::error::{Error, Result};
use crate::sql::{Columns, Value};

/// An entry at its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct StoredEntry {
    pub(crate) life: Life,
    pub(crate) sequence: u64,
    pub(crate) number: u16,
    pub(crate) entry: Entry,
    pub(crate) known: Inputs,
}

impl StoredEntry {
    /// Of a record whose place is known.
    pub(crate) fn of(record: &EntryRecord) -> Option<StoredEntry> {
        let EntryRecord { life, sequence, number, entry, known } = *record;
        let sequence = sequence.filter(|at| life.is_known() && SEQUENCES.contains(at))?;
        Some(StoredEntry { life, sequence, number, entry, known })
    }

    pub(crate) const fn record(&self) -> EntryRecord {
        let StoredEntry { life, sequence, number, entry, known } = *self;
        EntryRecord { life, sequence: Some(sequence), number, entry, known }
    }

    /// Whether this is the same reading. The number in the ring may be another one, since the ring
    /// may have been resized meanwhile.
    pub(crate) fn is_same(&self, other: &StoredEntry) -> bool {
        (self.entry, self.known) == (other.entry, other.known)
    }

    /// All that is stored of it, each field at its place.
    pub(crate) fn bytes(&self) -> [u8; 38] {
        let mut bytes = [0; 38];
        let fields: [&[u8]; 7] = [
            &self.life.bits().to_be_bytes(),
            &self.sequence.to_be_bytes(),
            &self.number.to_be_bytes(),
            &stamp_bytes(&self.entry.time),
            &self.entry.changed.0.to_be_bytes(),
            &self.entry.state.0.to_be_bytes(),
            &self.known.0.to_be_bytes(),
        ];
        for (byte, value) in bytes.iter_mut().zip(fields.into_iter().flatten()) {
            *byte = *value;
        }
        bytes
    }

    /// The columns from `life` on, in the order of the table.
    pub(crate) fn columns(&self) -> [Value; 8] {
        let mask = |inputs: Inputs| Value::Int(inputs.0.into());
        [
            Value::Int(self.life.bits().cast_signed()),
            Value::Int(self.sequence.cast_signed()),
            Value::Int(self.number.into()),
            Value::Int(stamp_number(&self.entry.time)),
            Value::from(shown(&self.entry.time).map(Moment::us)),
            mask(self.entry.changed),
            mask(self.entry.state),
            mask(self.known),
        ]
    }

    /// From a row whose columns from `first` on are those of the table from `life` on.
    pub(crate) fn from_row(row: &dyn Columns, first: usize, archive: &str) -> Result<StoredEntry> {
        let wrong = |what: &str| Error::damaged(archive, format!("an entry has no {what}"));
        let mask = |column: usize, what: &str| {
            u32::try_from(row.int(column)?).map(Inputs).map_err(|_| wrong(what))
        };
        let number = row.int(first + 2)?;
        Ok(StoredEntry {
            life: Life::from_bits(row.int(first)?.cast_unsigned()),
            sequence: sequence(row, first + 1, archive)?,
            number: u16::try_from(number).map_err(|_| wrong("number in the ring"))?,
            entry: Entry {
                time: stamp_of(row.int(first + 3)?),
                changed: mask(first + 5, "changed inputs")?,
                state: mask(first + 6, "state")?,
            },
            known: mask(first + 7, "known inputs")?,
        })
    }
}

/// The sequence of an entry in this column.
pub(crate) fn sequence(row: &dyn Columns, column: usize, archive: &str) -> Result<u64> {
    let sequence = row.int(column)?.cast_unsigned();
    let wrong = || Error::damaged(archive, format!("an entry is number {sequence} of its log"));
    SEQUENCES.contains(&sequence).then_some(sequence).ok_or_else(wrong)
}

/// A log counts from 1. None counts further than this, and a database's numbers do.
const SEQUENCES: std::ops::RangeInclusive<u64> = 1..=1 << 62;

/// A stamp as the eight bytes that it has on the wire. They rise with time within a century.
pub(crate) fn stamp_number(stamp: &TimeStamp) -> i64 {
    i64::from_be_bytes(stamp_bytes(stamp))
}

fn stamp_bytes(stamp: &TimeStamp) -> [u8; 8] {
    let [high, low] = stamp.millisecond.to_be_bytes();
    [stamp.year, stamp.month, stamp.day, stamp.hour, stamp.minute, stamp.second, high, low]
}

/// The stamp with these eight bytes, possible or not.
pub(crate) fn stamp_of(number: i64) -> TimeStamp {
    let [year, month, day, hour, minute, second, high, low] = number.to_be_bytes();
    let millisecond = u16::from_be_bytes([high, low]);
    TimeStamp { year, month, day, hour, minute, second, millisecond }
}

/// A record other than an entry, as it is stored.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct StoredEvidence {
    pub(crate) kind: &'static str,
    pub(crate) life: Life,
    pub(crate) line: String,
}

impl StoredEvidence {
    /// As the line of JSON that says it.
    pub(crate) fn of(recorder: &str, record: &Record, archive: &str) -> Result<Self> {
        let (kind, life) = StoredEvidence::kind_of(record);
        let failed = |error: &dyn std::fmt::Display| Error::Database {
            archive: archive.to_owned(),
            source: format!("a record of {recorder} cannot be written: {error}").into(),
        };
        let mut line = Vec::new();
        jsonl::Writer::new(&mut line).record(recorder, record).map_err(|error| failed(&error))?;
        line.pop_if(|last| *last == b'\n');
        let line = String::from_utf8(line).map_err(|error| failed(&error))?;
        // What could not be read again would keep everything else from being read, too.
        match jsonl::Reader::new(line.as_bytes(), "").read() {
            Some(Ok(_)) => {}
            Some(Err(error)) => return Err(failed(&error)),
            None => return Err(failed(&"nothing")),
        }
        Ok(StoredEvidence { kind, life, line })
    }

    /// What kind of record it is, and to which life it belongs, if it says so.
    pub(crate) fn kind_of(record: &Record) -> (&'static str, Life) {
        match record {
            Record::Entry(entry) => ("entry", entry.life),
            Record::Gap(gap) => ("gap", gap.life),
            Record::Clock(observation) => ("clock", observation.place.life),
            Record::Step(step) => ("step", step.place.life),
            Record::Life(life) => ("life", life.life),
            Record::Watched(watched) => ("watched", watched.life),
            Record::Suppressed(_) => ("suppressed", Life::UNKNOWN),
            Record::Point(_) => ("point", Life::UNKNOWN),
            Record::Recorder(_) => ("recorder", Life::UNKNOWN),
            Record::Command(_) => ("command", Life::UNKNOWN),
            Record::Note(note) => ("note", note.life),
            Record::Site(_) => ("site", Life::UNKNOWN),
        }
    }

    /// The record that a line says.
    pub(crate) fn record(line: &str, position: i64, archive: &str) -> Result<Record> {
        let damaged =
            |what: String| Error::damaged(archive, format!("the record at {position}: {what}"));
        match jsonl::Reader::new(line.as_bytes(), "").read() {
            Some(Ok(record)) => Ok(record),
            Some(Err(error)) => Err(damaged(error.to_string())),
            None => Err(damaged("nothing".to_owned())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_stamp_is_itself_again_possible_or_not() {
        for stamp in [
            TimeStamp {
                year: 26,
                month: 11,
                day: 22,
                hour: 10,
                minute: 0,
                second: 0,
                millisecond: 250,
            },
            TimeStamp {
                year: 255,
                month: 0,
                day: 255,
                hour: 99,
                minute: 61,
                second: 200,
                millisecond: u16::MAX,
            },
        ] {
            assert_eq!(stamp_of(stamp_number(&stamp)), stamp);
        }
    }

    #[test]
    fn an_entry_without_a_place_is_not_stored() {
        let stamp = stamp_of(0);
        let entry = Entry { time: stamp, changed: Inputs(1), state: Inputs(1) };
        let known = EntryRecord::ALL_KNOWN;
        let life = Life::from_bits(7);
        let at = |life, sequence| EntryRecord { life, sequence, number: 1, entry, known };
        assert!(StoredEntry::of(&at(life, Some(1))).is_some());
        assert!(StoredEntry::of(&at(life, None)).is_none());
        assert!(StoredEntry::of(&at(Life::UNKNOWN, Some(1))).is_none());
        assert!(StoredEntry::of(&at(life, Some(u64::MAX))).is_none());
        assert!(StoredEntry::of(&at(life, Some(0))).is_none());
    }
}
