//! A live view continues when board, bus or recorder fail for a while. It reports the failure, and
//! only a long one ends it. `watch` and `genius globals --follow` treat failures this way.

use std::time::{Duration, Instant};

use crate::error::{Failure, Result, inform};

/// A board that was reset is back on the bus within ten seconds, but somebody may have to reset it
/// first.
const PATIENCE: Duration = Duration::from_secs(60);

/// The present failure, if there is one.
pub(crate) struct Outage {
    patience: Duration,
    since: Option<Instant>,
}

impl Outage {
    /// No failure yet. A `patience` of more than a minute replaces the default.
    pub(crate) fn new(patience: Duration) -> Outage {
        Outage { patience: patience.max(PATIENCE), since: None }
    }

    /// Reports a failure that may pass, the first time. Returns it when it cannot pass, or has
    /// lasted too long.
    pub(crate) fn bear(&mut self, failure: Failure, now: Instant) -> Result<()> {
        if !failure.may_pass() {
            return Err(failure);
        }
        let since = *self.since.get_or_insert_with(|| {
            failure.warn();
            inform("this continues as soon as that has passed");
            now
        });
        if now.saturating_duration_since(since) < self.patience { Ok(()) } else { Err(failure) }
    }

    /// Notes that all is well, and reports that if it was not.
    pub(crate) fn end(&mut self) {
        if self.since.take().is_some() {
            inform("all is well again");
        }
    }
}

#[cfg(test)]
mod tests {
    use ser_client::GeniusError;

    use super::*;

    #[test]
    fn only_a_failure_that_lasts_too_long_is_the_end() {
        let began = Instant::now();
        let mut outage = Outage::new(Duration::from_secs(1));
        let mut bear =
            |failure: Failure, after_s| outage.bear(failure, began + Duration::from_secs(after_s));
        assert!(bear(GeniusError::BoardSilent.into(), 0).is_ok());
        assert!(bear(GeniusError::NotOnBus { node: 5 }.into(), 59).is_ok());
        assert!(bear(GeniusError::OwnNumber { node: 31 }.into(), 59).is_err(), "will not pass");
        assert!(bear(Failure::OutputClosed, 59).is_err());
        let end = bear(GeniusError::OffBus.into(), 60).expect_err("long enough");
        assert!(end.text().contains("not on the bus"), "{}", end.text());
        outage.end();
        assert!(
            outage.bear(GeniusError::OffBus.into(), began + Duration::from_secs(60)).is_ok(),
            "a new one"
        );
    }

    #[test]
    fn more_patience_can_be_had() {
        let began = Instant::now();
        let mut outage = Outage::new(Duration::from_secs(100));
        for after_s in [0, 99] {
            let now = began + Duration::from_secs(after_s);
            assert!(outage.bear(GeniusError::BoardSilent.into(), now).is_ok());
        }
    }
}
