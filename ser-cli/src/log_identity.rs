//! Which log this is, as the recorder itself says.
//!
//! A log that was erased, or lost with the power, and has filled again can look like the one
//! before. A recorder with our extension counts the lives of its log. Where the numbers are others,
//! the log is another one. Where they are the same, it is the same only if the counts outlive a
//! power cut.

use ser_client::Unit;
use ser_evidence::record::Life;
use ser_observer::{LogIdentity, LogLook, life_of_recorder};
use ser_proto::Identity;

use crate::connection::ConnectionArgs;
use crate::error::Result;
use crate::keeper::{self, Keeper, StateArgs};
use crate::original::Originals;

/// A log that a run is about to read, as the recorder itself says.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Met {
    /// What it says; `None` from an original one.
    pub(crate) log: Option<LogIdentity>,
    /// Whether it is another log than the one that was read last.
    pub(crate) is_another: bool,
}

/// Asks which log this is before it is read, and tells the keeper.
pub(crate) fn meet(unit: &mut Unit, keeper: &mut Keeper, originals: &Originals) -> Result<Met> {
    let Some(identity) = originals.identity(unit)? else { return Ok(Met::default()) };
    let log = LogIdentity::from(&identity);
    let is_another = keeper.is_of_another_log(log);
    if is_another || keeper.has_no_life() {
        keeper.propose(life_of_recorder(unit, &identity)?);
    }
    Ok(Met { log: Some(log), is_another })
}

/// A look at the log of a recorder that has said who it is, with the life that it was in. No entry
/// tells which life an empty log is, so that gets its name now. Without one, as when a `watch` is
/// running, a report cannot know that the clock was set in this life.
pub(crate) fn named(
    look: LogLook,
    unit: &mut Unit,
    identity: Option<&Identity>,
    (state, connection): (&StateArgs, &ConnectionArgs),
) -> LogLook {
    let log = identity.map(LogIdentity::from);
    let mut life_of_empty_log = || -> Result<Life> {
        let mut keeper = Keeper::load(state, connection)?;
        if let Some(identity) = identity {
            keeper.propose(life_of_recorder(unit, identity)?);
        }
        keeper.life_of_empty_log(log)
    };
    look.named(
        || life_of_empty_log().unwrap_or(Life::UNKNOWN),
        || keeper::last_delivered(state, connection, log),
    )
}

/// Asks which log this is that has begun anew under a reading, and how it is called.
pub(crate) fn begun_anew(unit: &mut Unit) -> Result<(Option<LogIdentity>, Option<Life>)> {
    let Some(identity) = unit.identity_again()? else { return Ok((None, None)) };
    let name = life_of_recorder(unit, &identity)?;
    Ok((Some(LogIdentity::from(&identity)), name))
}

/// Remembers which log it was that has been read, if it has been the same all the time. What was
/// read is whole without it, so no silence is a failure here.
pub(crate) fn remember(
    unit: &mut Unit,
    keeper: &mut Keeper,
    log: Option<LogIdentity>,
) -> Result<()> {
    let Some(log) = log else { return Ok(()) };
    match unit.identity_again() {
        Ok(Some(identity)) if LogIdentity::from(&identity) == log => keeper.read_from(log),
        _ => Ok(()),
    }
}
