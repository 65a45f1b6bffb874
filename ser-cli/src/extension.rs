//! What only the recorders of this project can be asked, and what is said where one cannot.

use ser_client::Unit;
use ser_proto::{Capabilities, Identity};

use crate::connection::ConnectionArgs;
use crate::error::{Failure, Result};

/// Who the recorder is; `None` for an original one. One that the site file calls original is not
/// asked.
pub(crate) fn identity(unit: &mut Unit, connection: &ConnectionArgs) -> Result<Option<Identity>> {
    if connection.is_original() {
        unit.take_for_original();
    }
    Ok(unit.identity()?)
}

/// Who the recorder is, if it can be asked for `what`, as in "its filters".
pub(crate) fn require(
    unit: &mut Unit,
    connection: &ConnectionArgs,
    wanted: Capabilities,
    what: &str,
) -> Result<Identity> {
    match identity(unit, connection)? {
        Some(identity) if identity.capabilities.contains(wanted) => Ok(identity),
        Some(Identity { firmware, capabilities, .. }) => Err(Failure::new(format!(
            "the recorder (firmware {firmware}) cannot be asked for {what}"
        ))
        .hint(format!("beyond the manual it answers for: {capabilities}"))),
        None if connection.is_original() => Err(original(what)
            .hint("the site file says so (original = true); take that out if it is not one")),
        None => Err(original(what)
            .hint("is it one with our firmware? Its answer may have been lost: try again")),
    }
}

fn original(what: &str) -> Failure {
    Failure::new(format!(
        "this is an original recorder (HE660SER160, HE660SER320): it cannot be asked for {what}"
    ))
}
