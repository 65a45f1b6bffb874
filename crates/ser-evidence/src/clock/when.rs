//! When something was, on every clock that tells it.

use super::hosts::Hosts;
use crate::record::{Boot, Reference};
use crate::time::{Bound, Host, Utc};

/// On the clock of a host, and in UTC.
pub(crate) type When = (Option<(Boot, Bound<Host>)>, Bound<Utc>);

/// When something was observed.
pub(crate) fn when(at: Reference, hosts: &Hosts) -> When {
    match at {
        Reference::Host { bound, reading } => {
            (Some((reading.boot, bound)), hosts.utc(reading.boot, bound))
        }
        Reference::Utc(bound) => (None, bound),
    }
}

/// Whether one thing is known to have been earlier than another.
pub(crate) fn is_earlier(one: When, other: When) -> bool {
    let on_one_host = one.0.zip(other.0).is_some_and(|((boot, one), (other_boot, other))| {
        boot == other_boot && one.is_before(other)
    });
    on_one_host || one.1.is_before(other.1)
}
