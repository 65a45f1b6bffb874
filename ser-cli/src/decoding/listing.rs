//! The list that `decode` writes: place, kind and text.

use std::fmt;
use std::io::{self, Write};

use crate::output::Palette;

/// A place in the input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// In a binary capture: the number of bytes before it.
    Offset(u64),
    /// In hex text: line and column, both from 1.
    Text {
        /// Line number.
        line: u64,
        /// Column number, in characters.
        column: u64,
    },
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::Offset(offset) => write!(f, "byte {offset}"),
            Place::Text { line, column } => write!(f, "line {line}, column {column}"),
        }
    }
}

impl Place {
    /// For the first column of the list.
    fn short(self) -> String {
        match self {
            Place::Offset(offset) => offset.to_string(),
            Place::Text { line, column } => format!("{line}:{column}"),
        }
    }
}

/// The subject of a line in the list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// A message from the host.
    Host,
    /// A message from the recorder.
    Recorder,
    /// A message that either could have sent.
    Either,
    /// A line of text.
    Text,
    /// Bytes that are neither frame nor text.
    Noise,
    /// Something broken.
    Damage,
}

/// Counts of the listed items.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Messages in intact frames, or bodies.
    pub messages: u64,
    /// Lines of text between frames.
    pub lines: u64,
    /// Places where the capture is damaged.
    pub damages: u64,
}

/// Writes the list and counts.
#[derive(Debug)]
pub struct Listing<W> {
    out: W,
    palette: Palette,
    tally: Tally,
}

impl<W: Write> Listing<W> {
    /// A list without colours.
    #[must_use]
    pub fn plain(out: W) -> Listing<W> {
        Listing::new(out, Palette::plain())
    }

    pub(crate) fn new(out: W, palette: Palette) -> Listing<W> {
        Listing { out, palette, tally: Tally::default() }
    }

    /// Adds a line, and below it `details`.
    pub(crate) fn add(
        &mut self,
        place: Place,
        kind: Kind,
        text: &str,
        details: &[String],
    ) -> io::Result<()> {
        let Palette { faint, alarm, .. } = self.palette;
        let (name, style) = match kind {
            Kind::Host => ("host", anstyle::Style::new()),
            Kind::Recorder => ("recorder", anstyle::Style::new()),
            Kind::Either => ("either", anstyle::Style::new()),
            Kind::Text => ("text", faint),
            Kind::Noise => ("noise", alarm),
            Kind::Damage => ("damage", alarm),
        };
        match kind {
            Kind::Text => self.tally.lines += 1,
            Kind::Noise | Kind::Damage => self.tally.damages += 1,
            Kind::Host | Kind::Recorder | Kind::Either => self.tally.messages += 1,
        }
        writeln!(self.out, "{:>8}  {style}{name:<8}  {text}{style:#}", place.short())?;
        for detail in details {
            writeln!(self.out, "{:>20}{detail}", "")?;
        }
        Ok(())
    }

    /// Passes on what has been written so far.
    pub(crate) fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }

    /// What has been counted.
    #[must_use]
    pub fn tally(&self) -> Tally {
        self.tally
    }
}

impl Tally {
    /// Whether nothing at all was found.
    pub(crate) fn is_empty(&self) -> bool {
        *self == Tally::default()
    }
}

/// As `3 messages, 1 line of text, nothing damaged`.
impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let of = |count: u64, one: &str, many: &str| {
            format!("{count} {}", if count == 1 { one } else { many })
        };
        write!(f, "{}", of(self.messages, "message", "messages"))?;
        if self.lines > 0 {
            write!(f, ", {}", of(self.lines, "line of text", "lines of text"))?;
        }
        match self.damages {
            0 => write!(f, ", nothing damaged"),
            count => write!(f, ", {}", of(count, "damaged place", "damaged places")),
        }
    }
}
