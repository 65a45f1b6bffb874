//! COMTRADE (IEEE C37.111-2013), the format of fault records: status channels only.
//!
//! A file has one row for each instant at which something changed, with the states of all inputs of
//! all recorders, and the times stand in the rows (no rate). For programs that take times from a
//! rate only there is one row per millisecond. A state that nobody knows cannot be said: the row
//! then repeats the last one that was known, and the header file says for which times.

mod cff;
mod cfg;
mod dat;
mod header;
mod quality;
mod texts;

use std::io::Write;

use ser_evidence::timeline::Timeline;

use super::counted::Counted;
use super::refused::Refused;
use super::selection::Selection;
use super::statement::Origin;
use super::survey::{Span, Survey};

/// The longest stamp in text has ten digits. Entries whose times do not rise are drawn a little
/// later than the last one, and have room for that here.
const MAX_STAMP: u64 = 9_999_000_000;

/// The longest binary stamp, with the same room. FFFFFFFF says that there is none.
const MAX_BINARY_STAMP: u64 = 4_294_900_000;

/// The longest record with a row for every millisecond: an hour.
const MAX_ROWS_AT_RATE: u64 = 3_600_000;

/// How the rows are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Data {
    /// As text.
    #[default]
    Ascii,
    /// As binary numbers.
    Binary,
}

/// How a record is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// How the rows are written.
    pub data: Data,
    /// Whether there is a row for every millisecond.
    pub has_rate: bool,
    /// The line frequency that the record names, in hertz. Nothing is reckoned with it.
    pub line_hz: u8,
}

/// A record that can be written: its parts agree with each other.
pub struct Comtrade<'t> {
    timeline: &'t Timeline<'t>,
    selection: &'t Selection,
    options: Options,
    survey: Survey,
    span: Span,
    /// In microseconds: what stamps count.
    unit_us: i64,
    rows: u64,
    /// Names and values of the channels.
    channels: Vec<texts::ChannelText>,
    hidden: u64,
}

impl<'t> Comtrade<'t> {
    /// Prepares a record of a selection.
    ///
    /// # Errors
    /// If nothing has a time, or the selection is too long.
    pub fn new(
        timeline: &'t Timeline<'t>,
        selection: &'t Selection,
        options: Options,
    ) -> Result<Comtrade<'t>, Refused> {
        let survey = Survey::of(timeline, selection);
        let span = survey.span.ok_or(Refused::Empty)?;
        let channels = texts::channels(timeline, &survey.channels, options);
        let (rows, unit_us, hidden) = (0, 1, 0);
        let mut record = Comtrade {
            timeline,
            selection,
            options,
            survey,
            span,
            unit_us,
            rows,
            channels,
            hidden,
        };
        record.unit_us = record.unit()?;
        let made = dat::count(&record)?;
        (record.rows, record.hidden) = (made.rows, made.hidden);
        Ok(record)
    }

    /// What is in it.
    #[must_use]
    pub fn counted(&self) -> Counted {
        Counted { hidden: self.hidden, ..self.survey.counted }
    }

    /// Writes the configuration (`.cfg`).
    ///
    /// # Errors
    /// If `out` does not take it.
    pub fn write_cfg(&self, out: &mut dyn Write) -> Result<(), Refused> {
        Ok(cfg::write(out, self)?)
    }

    /// Writes the rows (`.dat`).
    ///
    /// # Errors
    /// If `out` does not take it.
    pub fn write_dat(&self, out: &mut dyn Write) -> Result<(), Refused> {
        Ok(dat::write(out, self)?)
    }

    /// Writes what people have to know (`.hdr`).
    ///
    /// # Errors
    /// If `out` does not take it.
    pub fn write_hdr(&self, out: &mut dyn Write, origin: &Origin<'_>) -> Result<(), Refused> {
        Ok(header::write(out, self, origin)?)
    }

    /// Writes all of it as one file (`.cff`).
    ///
    /// # Errors
    /// If `out` does not take it.
    pub fn write_cff(&self, out: &mut dyn Write, origin: &Origin<'_>) -> Result<(), Refused> {
        Ok(cff::write(out, self, origin)?)
    }

    /// What stamps count: microseconds, or milliseconds where there are too many of these.
    fn unit(&self) -> Result<i64, Refused> {
        let length_us = self.span.last_us.saturating_sub(self.span.begins_us()).unsigned_abs();
        let refused = |may_be_ms| Refused::TooLong { is_ms: length_us / 1000, may_be_ms };
        if self.options.has_rate && length_us / 1000 >= MAX_ROWS_AT_RATE {
            return Err(refused(MAX_ROWS_AT_RATE));
        }
        let most = match self.options.data {
            Data::Ascii => MAX_STAMP,
            Data::Binary => MAX_BINARY_STAMP,
        };
        match length_us {
            _ if length_us <= most => Ok(1),
            // Rounded up by half of one.
            _ if length_us / 1000 < most => Ok(1000),
            _ => Err(refused(most)),
        }
    }

    /// The stamp of an instant: from the first row on, in units.
    fn stamp(&self, at_us: i64) -> u64 {
        let since = at_us.saturating_sub(self.span.begins_us()).max(0);
        (since.unsigned_abs() + self.unit_us.unsigned_abs() / 2) / self.unit_us.unsigned_abs()
    }
}
