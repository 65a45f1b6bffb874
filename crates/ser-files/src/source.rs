//! A file of records, in whichever format.

use std::io::{self, BufRead, Chain, Cursor, Read};

use ser_evidence::record::{EntryRecord, Gap, Life, Lost, Record, Told, Why};

use crate::error::{MAX_LINE_LEN, Problem, ReadError};
use crate::{csv, jsonl};

/// A file whose first bytes were looked at.
type Input<R> = Chain<Cursor<Vec<u8>>, R>;

/// Reads the records of a file, JSON lines or CSV. After an error in one line it goes on with the
/// next.
pub struct Source<R> {
    reader: Reader<Input<R>>,
    /// The recorder of the last entry, and where that is.
    last: Option<(String, Life, Option<u64>)>,
}

enum Reader<R> {
    Jsonl(Box<jsonl::Reader<R>>),
    Csv(Box<csv::Reader<R>>),
    /// An empty file holds no records, and says so in any format.
    Nothing,
}

impl<R: BufRead> Reader<R> {
    fn recorder(&self) -> &str {
        match self {
            Reader::Jsonl(reader) => reader.recorder(),
            Reader::Csv(reader) => reader.recorder(),
            Reader::Nothing => "",
        }
    }
}

impl<R: BufRead> Source<R> {
    /// Looks at the beginning of `input`, whatever its name is. `recorder` is the name of the
    /// recorder where the file does not say it: the stem of the file's name, if nobody knows
    /// better.
    ///
    /// # Errors
    /// If the file cannot be read, or is neither JSON lines nor CSV of ours.
    pub fn new(mut input: R, recorder: &str) -> Result<Source<R>, ReadError> {
        let first = first_line(&mut input).map_err(|error| ReadError::at(1, Problem::Io(error)))?;
        let line = first.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&first).trim_ascii_start();
        if matches!(first.get(..2), Some([0xFF, 0xFE] | [0xFE, 0xFF])) {
            return Err(ReadError::at(1, Problem::Utf16));
        }
        if has_lone_return(&first) {
            return Err(ReadError::at(1, Problem::LoneReturns));
        }
        let kind = line.first().copied();
        let is_csv = csv::is_header(line);
        let input = Cursor::new(first).chain(input);
        let reader = match kind {
            None => Reader::Nothing,
            Some(b'{') => Reader::Jsonl(Box::new(jsonl::Reader::new(input, recorder))),
            Some(_) if is_csv => Reader::Csv(Box::new(csv::Reader::new(input, recorder))),
            Some(_) => return Err(ReadError::at(1, Problem::NotOurs)),
        };
        Ok(Source { reader, last: None })
    }

    /// The next record. Whose it is, [`recorder`](Self::recorder) says: where there are millions,
    /// a name for each takes time.
    pub fn read(&mut self) -> Option<Result<Record, ReadError>> {
        let record = match &mut self.reader {
            Reader::Jsonl(reader) => reader.read(),
            Reader::Csv(reader) => reader.read(),
            Reader::Nothing => None,
        };
        let recorder = self.reader.recorder();
        if self.last.as_ref().is_some_and(|(name, ..)| name != recorder) {
            self.last = None;
        }
        if let Some(Ok(Record::Entry(EntryRecord { life, sequence, .. }))) = record {
            match &mut self.last {
                // Neighbours often have the same recorder, whose name is not copied then.
                Some((_, of, last)) => (*of, *last) = (life, sequence),
                None => self.last = Some((recorder.to_owned(), life, sequence)),
            }
        }
        record
    }

    /// What may be missing because of the damaged line that was [read](Self::read) last: it may have
    /// been the next entry of the log before it, of the same [recorder](Self::recorder). Where no
    /// entry is before it, or one without a sequence, nobody knows its place, and
    /// [`after`](Gap::after) is `None`.
    #[must_use]
    pub fn damage(&self) -> Gap {
        let (life, after) =
            self.last.as_ref().map_or((Life::UNKNOWN, None), |(_, life, after)| (*life, *after));
        Gap { life, after, lost: Lost::Unknown, why: Why::Unreadable }
    }

    /// The name of the recorder of the record that was [read](Self::read) last.
    #[must_use]
    pub fn recorder(&self) -> &str {
        self.reader.recorder()
    }

    /// The remark for people that goes with the record that was [read](Self::read) last.
    #[must_use]
    pub fn note(&self) -> Option<&str> {
        match &self.reader {
            Reader::Jsonl(reader) => reader.note(),
            Reader::Csv(_) | Reader::Nothing => None,
        }
    }

    /// The program that wrote the file, as it calls itself, if it has said so by now.
    #[must_use]
    pub fn program(&self) -> Option<&str> {
        match &self.reader {
            Reader::Jsonl(reader) => reader.program(),
            Reader::Csv(_) | Reader::Nothing => None,
        }
    }
}

impl<R: BufRead> Iterator for Source<R> {
    type Item = Result<Told, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        let record = self.read()?;
        Some(record.map(|record| Told { recorder: self.recorder().to_owned(), record }))
    }
}

/// Whether a carriage return stands anywhere but before the end of a line.
fn has_lone_return(lines: &[u8]) -> bool {
    lines.windows(2).any(|pair| matches!(pair, [b'\r', next] if *next != b'\n'))
}

/// The first line that is not empty, with the empty ones before it.
fn first_line(input: &mut impl BufRead) -> io::Result<Vec<u8>> {
    let limit = u64::try_from(MAX_LINE_LEN).unwrap_or(u64::MAX);
    let mut input = input.take(limit);
    let mut first = Vec::new();
    while first.trim_ascii().is_empty() && input.read_until(b'\n', &mut first)? > 0 {}
    Ok(first)
}
