//! What is to be told of a file from elsewhere: what was not understood, and why nothing was.

use std::error::Error;
use std::fmt;
use std::io;

use super::calendar::DateOrder;

/// Notes of a file that are kept; further ones are counted.
const KEPT: usize = 200;

/// Something that was not understood, or that the reader of the list has to know.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// The line, or of binary data the row, from 1; `None` if it is about the whole file.
    pub line: Option<u64>,
    /// What it is.
    pub why: String,
}

/// What there is to tell of a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Notes {
    /// Lines that were left out, the first ones.
    pub left_out: Vec<Note>,
    /// How many were left out.
    pub left_out_count: u64,
    /// What the file has lost itself: places where it shows that something is not in it.
    pub lost: Vec<Note>,
    /// How many such places there are.
    pub lost_count: u64,
    /// What else has to be known.
    pub remarks: Vec<Note>,
}

impl Notes {
    /// A line is left out.
    pub(super) fn leave_out(&mut self, line: u64, why: impl Into<String>) {
        self.left_out_count += 1;
        if self.left_out.len() < KEPT {
            self.left_out.push(Note { line: Some(line), why: why.into() });
        }
    }

    /// Something is missing before a line.
    pub(super) fn lose(&mut self, line: u64, why: impl Into<String>) {
        self.lost_count += 1;
        if self.lost.len() < KEPT {
            self.lost.push(Note { line: Some(line), why: why.into() });
        }
    }

    /// Something is missing behind everything that a file holds.
    pub(super) fn lose_at_end(&mut self, why: impl Into<String>) {
        self.lost_count += 1;
        if self.lost.len() < KEPT {
            self.lost.push(Note { line: None, why: why.into() });
        }
    }

    /// Something is to be known about a line, or about the whole.
    pub(super) fn remark(&mut self, line: Option<u64>, why: impl Into<String>) {
        let note = Note { line, why: why.into() };
        if self.remarks.len() < KEPT && !self.remarks.contains(&note) {
            self.remarks.push(note);
        }
    }
}

/// As `line 17: month 13 is out of range`.
impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(line) = self.line {
            write!(f, "line {line}: ")?;
        }
        f.write_str(&self.why)
    }
}

/// Why nothing can be read from a file, or not without being told something.
#[derive(Debug)]
pub enum Refusal {
    /// The file cannot be read.
    Io(io::Error),
    /// There is nothing in it.
    Empty,
    /// It looks like UTF-16 without the mark that says so.
    Utf16,
    /// It is binary.
    NoText,
    /// It is in none of the formats.
    Unknown,
    /// It is COMTRADE data, which needs the configuration beside it.
    NoConfiguration,
    /// It is a COMTRADE configuration, and its data is not there.
    NoData(io::Error),
    /// A place without which nothing can be read is not as it has to be.
    Damaged {
        /// The line, from 1.
        line: u64,
        /// What is wrong with it.
        why: String,
    },
    /// The list says neither what time zone it is in nor its offset from UTC.
    NoZone,
    /// Nothing tells in which order day, month and year are written.
    NoDates {
        /// A date of the file.
        example: String,
        /// The orders that would be possible.
        possible: Vec<DateOrder>,
    },
    /// Nothing tells from when the seconds count.
    NoEpoch,
    /// What was read could not be handed on.
    NotTaken(io::Error),
    /// There is more in it than is read at once.
    TooMuch {
        /// What.
        what: &'static str,
        /// How much would be read.
        most: u64,
    },
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Refusal::Io(error) => write!(f, "cannot be read: {error}"),
            Refusal::NotTaken(error) => write!(f, "what it holds cannot be written: {error}"),
            Refusal::Empty => f.write_str("the file is empty"),
            Refusal::Utf16 => f.write_str("this looks like UTF-16, without the mark that says so"),
            Refusal::NoText => f.write_str("this is binary, and not text"),
            Refusal::Unknown => f.write_str("this is in none of the formats that are known"),
            Refusal::NoConfiguration => {
                f.write_str("this is COMTRADE data, which says nothing without its .cfg")
            }
            Refusal::NoData(error) => write!(f, "its COMTRADE data cannot be read: {error}"),
            Refusal::Damaged { line, why } => write!(f, "line {line}: {why}"),
            Refusal::NoZone => {
                f.write_str("the file does not say in which time zone its times are")
            }
            Refusal::NoDates { example, .. } => {
                write!(f, "nothing tells in which order {example} has day, month and year")
            }
            Refusal::NoEpoch => f.write_str("the file does not say from when its seconds count"),
            Refusal::TooMuch { what, most } => write!(f, "it has more than {most} {what}"),
        }
    }
}

impl Error for Refusal {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            Refusal::Io(error) | Refusal::NoData(error) | Refusal::NotTaken(error) => Some(error),
            _ => None,
        }
    }
}

impl Refusal {
    pub(super) fn damaged(line: u64, why: impl Into<String>) -> Refusal {
        Refusal::Damaged { line, why: why.into() }
    }
}
