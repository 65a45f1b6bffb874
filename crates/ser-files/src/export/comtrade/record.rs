//! What all parts of a record are made from.

use ser_evidence::timeline::Timeline;

use super::options::{Data, Options};
use super::texts::{self, ChannelText};
use crate::export::refused::Refused;
use crate::export::selection::Selection;
use crate::export::survey::{Span, Survey};

/// The longest stamp in text has ten digits. Entries whose times do not rise are drawn a little
/// later than the last one, and have room for that here.
const MAX_STAMP: u64 = 9_999_000_000;

/// The longest binary stamp, with the same room. FFFFFFFF says that there is none.
const MAX_BINARY_STAMP: u64 = 4_294_900_000;

/// The longest record with a row for every millisecond: an hour.
const MAX_ROWS_AT_RATE: u64 = 3_600_000;

/// Everything that the parts have in common.
pub(super) struct Record<'t> {
    pub(super) timeline: &'t Timeline<'t>,
    pub(super) selection: &'t Selection,
    pub(super) options: Options,
    pub(super) survey: Survey,
    pub(super) span: Span,
    /// In microseconds: what stamps count.
    pub(super) unit_us: i64,
    pub(super) rows: u64,
    /// Names and values of the channels.
    pub(super) channels: Vec<ChannelText>,
    pub(super) hidden: u64,
}

impl<'t> Record<'t> {
    /// A record of a selection, whose rows are not counted yet.
    pub(super) fn new(
        timeline: &'t Timeline<'t>,
        selection: &'t Selection,
        options: Options,
    ) -> Result<Record<'t>, Refused> {
        let survey = Survey::of(timeline, selection);
        let span = survey.span.ok_or(Refused::Empty)?;
        let channels = texts::channels(timeline, &survey.channels, options);
        let (rows, unit_us, hidden) = (0, 1, 0);
        let mut record =
            Record { timeline, selection, options, survey, span, unit_us, rows, channels, hidden };
        record.unit_us = record.unit()?;
        Ok(record)
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
    pub(super) fn stamp(&self, at_us: i64) -> u64 {
        let since = at_us.saturating_sub(self.span.begins_us()).max(0);
        (since.unsigned_abs() + self.unit_us.unsigned_abs() / 2) / self.unit_us.unsigned_abs()
    }
}
