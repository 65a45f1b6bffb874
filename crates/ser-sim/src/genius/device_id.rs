//! Which device on a bus is meant.

/// A device on a bus, by the order in which they were connected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct DeviceId(pub(super) usize);
