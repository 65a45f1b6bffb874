//! What is wrong with a file, and where.

use std::error::Error;
use std::fmt;
use std::io;

/// The longest line of CSV that is read, in bytes. Ours have a few dozen.
pub const MAX_LINE_LEN: usize = 65_536;

/// How much of a file's text is quoted in an error, in characters.
const QUOTED_LEN: usize = 40;

/// Why a line of a file could not be read. Everything that was read before it stands.
#[derive(Debug)]
pub struct ReadError {
    /// The line, from 1.
    pub line: u64,
    /// The byte in the line, from 1, if it is known.
    pub byte: Option<usize>,
    /// What is wrong.
    pub problem: Problem,
}

/// What is wrong with a line.
#[derive(Debug)]
pub enum Problem {
    /// The file cannot be read on.
    Io(io::Error),
    /// The file is neither JSON lines nor CSV of ours.
    NotOurs,
    /// The file is UTF-16, and only UTF-8 is read.
    Utf16,
    /// The file was written by a later version, which may say things that this one does not
    /// understand.
    NewerSchema {
        /// The version of its layout.
        schema: u32,
    },
    /// Lines end with a carriage return alone, which ends no line of ours.
    LoneReturns,
    /// The line is longer than any of ours.
    TooLong {
        /// The longest that is read, in bytes.
        longest: usize,
    },
    /// The line holds something else than it has to, for this reason.
    Damaged(String),
}

impl ReadError {
    pub(crate) fn damaged(line: u64, why: impl Into<String>) -> ReadError {
        ReadError { line, byte: None, problem: Problem::Damaged(why.into()) }
    }

    pub(crate) const fn at(line: u64, problem: Problem) -> ReadError {
        ReadError { line, byte: None, problem }
    }

    /// Whether only this line is lost, and the lines after it can be read.
    #[must_use]
    pub const fn is_of_one_line(&self) -> bool {
        matches!(self.problem, Problem::TooLong { .. } | Problem::Damaged(_))
    }
}

/// As `line 17, byte 5: month 13 is out of range`.
impl fmt::Display for ReadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}", self.line)?;
        if let Some(byte) = self.byte {
            write!(f, ", byte {byte}")?;
        }
        write!(f, ": {}", self.problem)
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Problem::Io(error) => write!(f, "cannot be read: {error}"),
            Problem::NotOurs => {
                f.write_str("this is neither JSON lines nor CSV as ser-cli writes them")
            }
            Problem::Utf16 => f.write_str("this is UTF-16; our own files are UTF-8"),
            Problem::NewerSchema { schema } => write!(
                f,
                "written by a later version (schema {schema}; this one reads up to {})",
                crate::jsonl::SCHEMA
            ),
            Problem::LoneReturns => f.write_str(
                "its lines end with CR alone, as those of old Macintosh computers do; save it with \
                 lines that end with LF or CR LF",
            ),
            Problem::TooLong { longest } => write!(f, "longer than {longest} bytes"),
            Problem::Damaged(why) => f.write_str(why),
        }
    }
}

impl Error for ReadError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match &self.problem {
            Problem::Io(error) => Some(error),
            _ => None,
        }
    }
}

/// Why a last line is left out that may be a part of one. A number or a name that was cut off may
/// look whole.
pub(crate) const NO_LINE_END: &str = "this last line has no line end, so the file may be cut off in \
     it; if it is whole, end it with one";

/// A piece of a file, short enough for a message.
pub(crate) fn quoted(text: &[u8]) -> String {
    let text = String::from_utf8_lossy(text);
    let mut short: String = text.chars().take(QUOTED_LEN).collect();
    if text.chars().nth(QUOTED_LEN).is_some() {
        short.push('…');
    }
    format!("`{short}`")
}
