//! The battery-backed clock: milliseconds that the bench counts on the external bus, and what they
//! mean.
//!
//! # Design
//! The bench counts whether or not the board runs, as a clock chip does on its battery. What the
//! clock shows is that count plus an offset, which setting the clock writes into memory that
//! outlives the power. A fresh memory file holds no offset: the clock has never been set.
//!
//! # Tradeoffs
//! The clock is as good as the bench is punctual: it writes its count every 2 ms when its computer
//! has the time, and late when not. Setting and reading are late alike, so with an idle computer
//! these errors cancel but for 2 ms.
//!
//! # Notes
//! Two words that are being written may be caught half new, half old; their check tells, and they
//! are read again.

use chrono::NaiveDateTime;
use rtcc::DateTimeAccess;
use ser_board::clock_chip::{ClockHealth, KeepsTime};
use ser_node::calendar::date_time;

use crate::external_bus::{CLOCK_COUNT_MS, CLOCK_OFFSET_MS};

pub(crate) static HEALTH: ClockHealth = ClockHealth::new();

/// Looks at the count before it is given up: the bench takes a few instructions to write it, and
/// may be held up in the middle by its computer.
const MAX_LOOKS: u32 = 10_000;

/// What went wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RtcError {
    /// The bench does not count.
    NotThere,
    /// What is shown, or was to be, is no date.
    NoDate,
}

/// The clock.
pub(crate) struct BenchClock(());

impl BenchClock {
    /// # Safety
    /// This is called once only: its offset belongs to whoever has it.
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
