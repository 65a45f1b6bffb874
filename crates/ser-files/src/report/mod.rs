//! The report about one incident: as text for a terminal, as a page, and as JSON.
//!
//! All say the same in the same order: the verdict, what the report is made from, the sequence of
//! changes, what was expected, what has not returned to normal, and what is missing. All answers
//! come from [`Report`]. The files here turn them into words; `text` and `html` draw the words.

mod brackets;
mod clock_sets;
mod elsewhere;
mod html;
mod json;
mod marks;
mod outcome;
mod sequence;
mod sources;
mod style;
mod table;
mod text;
mod times;
mod verdict;

pub use html::{MAX_ROWS, PageError, write as write_html};
pub use json::write as write_json;
pub use style::Styles;
pub use text::write as write_text;
pub use times::Clock;

pub use crate::missing::NotReached;

use ser_evidence::incident::Report;
use ser_evidence::timeline::Timeline;

use crate::missing::missing;
use crate::{names, span};

/// A report, and what is said about where it comes from.
#[derive(Debug)]
pub struct Document<'a> {
    /// The timeline that it is made from.
    pub timeline: &'a Timeline<'a>,
    /// All answers.
    pub report: &'a Report,
    /// The program that makes it, with its version.
    pub program: &'a str,
    /// SHA-256 of the site file, if there is one.
    pub site_digest: Option<String>,
    /// Where the chains of the archive ended from which it was read; none if it was not.
    pub archive_heads: &'a [ArchiveHead],
    /// Recorders that were to be read and were not, and why.
    pub not_reached: &'a [NotReached],
    /// How many lines of the sources could not be read.
    pub damaged_lines: u64,
    /// How many entries of the sources have a local time that came twice or was left out, of which
    /// nothing tells which of two instants it was.
    pub doubtful_hours: u64,
    /// Whether chatter is shown row by row.
    pub unfold: bool,
}

/// The end of a chain of an archive: whoever has it written down can prove later what was there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ArchiveHead {
    /// Whose entries they are.
    pub recorder: String,
    /// Who has added them.
    pub collector: String,
    /// The SHA-256 over all of them, as 64 hexadecimal digits.
    pub digest: String,
}

impl Document<'_> {
    /// Whether something is missing, or may be.
    #[must_use]
    pub fn is_incomplete(&self) -> bool {
        self.report.is_incomplete() || !self.not_reached.is_empty() || self.damaged_lines > 0
    }
}
