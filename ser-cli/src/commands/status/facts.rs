//! Everything that a recorder says of itself, asked for once.

use ser_client::{Delivery, LogPosition, Unit};
use ser_proto::{Capabilities, Configuration, Counter, Entry, Identity, InputFilter, Mode, Model};

use super::clock::Clock;
use crate::connection::{ConnectionArgs, unless_unanswered};
use crate::error::Result;
use crate::extension;

/// What a recorder says of itself. What an original one cannot say is `None`.
pub(super) struct Facts {
    pub(super) position: LogPosition,
    pub(super) mode: Option<Mode>,
    pub(super) configuration: Option<Configuration>,
    /// The newest event, its entry's number and the model that it shows.
    pub(super) latest: Option<(u16, Entry, Model)>,
    pub(super) identity: Option<Identity>,
    pub(super) clock: Option<Clock>,
    pub(super) filters: Option<Vec<InputFilter>>,
    pub(super) counters: Option<Vec<(Counter, u32)>>,
}

impl Facts {
    pub(super) fn of(unit: &mut Unit, connection: &ConnectionArgs) -> Result<Facts> {
        // Every recorder answers a read. One that does not is not there, and must not be waited for
        // again.
        let position = unit.log_position()?;
        let mode = unless_unanswered(unit.mode())?;
        let configuration = match mode {
            Some(_) => Some(unit.configuration()?),
            None => None,
        };
        if mode.is_none() {
            unit.take_for_original();
        }
        let size = configuration.map(|configuration| configuration.size);
        let latest = latest_event(unit, position, size)?;
        Ok(Facts {
            position,
            mode,
            configuration,
            latest,
            identity: extension::identity(unit, connection)?,
            clock: Clock::of(unit, connection)?,
            filters: unless_unanswered(unit.filters())?.flatten(),
            counters: unless_unanswered(unit.recorder_counters())?.flatten(),
        })
    }

    /// The recorder's model, if it can be known.
    pub(super) fn model(&self) -> Option<Model> {
        let of_entry = self.latest.map(|(_, _, model)| model);
        self.identity.map(|identity| identity.model).or(of_entry)
    }

    /// Whether the counts of power-ups and lives hold over power cycles.
    pub(super) fn counts_last(&self) -> bool {
        let lasting = Capabilities::LASTING_COUNTS;
        self.identity.is_some_and(|identity| identity.capabilities.contains(lasting))
    }
}

fn latest_event(
    unit: &mut Unit,
    position: LogPosition,
    size: Option<u16>,
) -> Result<Option<(u16, Entry, Model)>> {
    // Entry n is slot n - 1, and the newest is in the slot before the next one. Before slot 0 comes
    // the last slot.
    let number = match (position.next_slot, size) {
        (0, None) => return Ok(None),
        (0, Some(size)) => size,
        (next, _) => next,
    };
    let mut latest = None;
    unit.read_range(number, 1, size.unwrap_or(number), &mut |delivery| {
        if let Delivery::Event { entry_number, entry, model, .. } = delivery {
            latest = Some((entry_number, entry, model));
        }
    })?;
    Ok(latest)
}
