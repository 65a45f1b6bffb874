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
mod options;
mod quality;
mod record;
mod texts;

use std::io::Write;

use ser_evidence::timeline::Timeline;

use super::counted::Counted;
use super::refused::Refused;
use super::selection::Selection;
use super::statement::Origin;
use record::Record;

pub use options::{Data, Options};

/// A record that can be written: its parts agree with each other.
pub struct Comtrade<'t>(Record<'t>);

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
        let mut record = Record::new(timeline, selection, options)?;
        let made = dat::count(&record)?;
        (record.rows, record.hidden) = (made.rows, made.hidden);
        Ok(Comtrade(record))
    }

    /// What is in it.
    #[must_use]
    pub fn counted(&self) -> Counted {
        Counted { hidden: self.0.hidden, ..self.0.survey.counted }
    }

    /// Writes the configuration (`.cfg`).
    ///
    /// # Errors
    /// If `out` does not take it.
    pub fn write_cfg(&self, out: &mut dyn Write) -> Result<(), Refused> {
        Ok(cfg::write(out, &self.0)?)
    }

    /// Writes the rows (`.dat`).
    ///
    /// # Errors
    /// If `out` does not take it.
    pub fn write_dat(&self, out: &mut dyn Write) -> Result<(), Refused> {
        Ok(dat::write(out, &self.0)?)
    }

    /// Writes what people have to know (`.hdr`).
    ///
    /// # Errors
    /// If `out` does not take it.
    pub fn write_hdr(&self, out: &mut dyn Write, origin: &Origin<'_>) -> Result<(), Refused> {
        Ok(header::write(out, &self.0, origin)?)
    }

    /// Writes all of it as one file (`.cff`).
    ///
    /// # Errors
    /// If `out` does not take it.
    pub fn write_cff(&self, out: &mut dyn Write, origin: &Origin<'_>) -> Result<(), Refused> {
        Ok(cff::write(out, &self.0, origin)?)
    }
}
