//! The battery-backed clock: milliseconds that the bench counts on the external bus, and their
//! meaning.
//!
//! # Design
//! The bench counts whether or not the board runs, as a clock chip does on its battery. The clock
//! shows that count plus an offset. Setting the clock writes the offset into memory that outlives
//! the power. A fresh memory file holds no offset: the clock has never been set.
//!
//! # Tradeoffs
//! The clock is as good as the bench is punctual. The bench writes its count every 2 ms when its
//! computer has time for it, and late when not. Setting and reading are late alike, so on an idle
//! computer these errors cancel to within 2 ms.
//!
//! # Notes
//! Two words may be read while they are being written, half new and half old. Their check shows
//! that, and they are read again.

use chrono::NaiveDateTime;
use rtcc::DateTimeAccess;
use ser_board::clock_chip::{ClockHealth, KeepsTime};
use ser_node::calendar::date_time;

use crate::external_bus::{CLOCK_COUNT_MS, CLOCK_OFFSET_MS};

pub(crate) static HEALTH: ClockHealth = ClockHealth::new();

/// Looks at the count before it is given up. The bench takes a few instructions to write it, and
/// its computer may hold it up half-way.
const MAX_LOOKS: u32 = 10_000;

/// What went wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RtcError {
    /// The bench does not count.
    NotThere,
    /// The clock shows, or was to show, no valid date.
    NoDate,
}

/// The clock.
pub(crate) struct BenchClock(());

impl BenchClock {
    /// # Safety
    /// Call once only: the offset belongs to the caller.
    pub(crate) const unsafe fn open() -> BenchClock {
        BenchClock(())
    }

    fn count_ms(&self) -> Result<u64, RtcError> {
        (0..MAX_LOOKS).find_map(|_| CLOCK_COUNT_MS.read()).ok_or(RtcError::NotThere)
    }
}

impl DateTimeAccess for BenchClock {
    type Error = RtcError;

    fn datetime(&mut self) -> Result<NaiveDateTime, RtcError> {
        let offset_ms = CLOCK_OFFSET_MS.read().ok_or(RtcError::NoDate)?;
        let shown_ms = self.count_ms()?.wrapping_add(offset_ms).cast_signed();
        date_time(shown_ms).ok_or(RtcError::NoDate)
    }

    fn set_datetime(&mut self, datetime: &NaiveDateTime) -> Result<(), RtcError> {
        let shown_ms = datetime.and_utc().timestamp_millis().cast_unsigned();
        CLOCK_OFFSET_MS.write_unsealed(shown_ms.wrapping_sub(self.count_ms()?));
        Ok(())
    }
}

impl KeepsTime for BenchClock {
    const RESOLUTION_MS: u16 = 1;

    fn has_lost_time(&mut self) -> Result<bool, RtcError> {
        Ok(CLOCK_OFFSET_MS.read().is_none())
    }

    fn time_is_good(&mut self) -> Result<(), RtcError> {
        CLOCK_OFFSET_MS.seal();
        Ok(())
    }
}
