//! What the recorder's clock shows, and how far that is from what it should show.

use ser_client::Unit;
use ser_observer::{ClockSetting, clock_look};
use ser_proto::{ClockReading, ClockSource};

use crate::connection::ConnectionArgs;
use crate::error::Result;

/// A recorder's clock, as this computer sees it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Clock {
    /// The last reading.
    pub(super) reading: ClockReading,
    /// How far the clock is ahead of what it should show, in microseconds: from, to. `None` if it
    /// was never set, or shows what cannot be compared.
    pub(super) ahead_us: Option<(i64, i64)>,
    /// What it should show.
    pub(super) reference: ClockSetting,
    /// Whether the site file says so; otherwise it is this computer's local time.
    pub(super) is_of_site: bool,
}

impl Clock {
    /// Looks at the clock; `None` where it cannot be asked.
    pub(super) fn of(unit: &mut Unit, connection: &ConnectionArgs) -> Result<Option<Clock>> {
        let of_site = connection.clock_setting();
        let is_of_site = of_site.is_some();
        let reference = of_site.unwrap_or_else(ClockSetting::of_this_computer);
        let Some(looks) = clock_look::take(unit)? else { return Ok(None) };
        let Some(&reading) = looks.last() else { return Ok(None) };
        let was_set = reading.source != ClockSource::NeverSet;
        let ahead_us = looks.ahead_of(&reference).filter(|_| was_set);
        Ok(Some(Clock { reading, ahead_us, reference, is_of_site }))
    }
}
