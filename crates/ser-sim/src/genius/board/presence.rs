//! Whether a board runs, and whether it takes turns on the bus.

/// How long the board stays off the bus after the OK flag, and after a change of the configuration.
pub(super) const OFF_BUS_US: u64 = 1_500_000;

/// What the processors do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Power {
    InReset,
    SelfTest { released_us: u64, stage: Stage },
    Running,
    Stopped,
}

/// How far the start-up has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    Released,
    Interrupted,
    SecondPattern,
    RamReady,
}

/// Whether a running board takes turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Presence {
    /// The board takes no turns before then.
    Off {
        until_us: u64,
    },
    /// Another device has its bus address.
    Conflict {
        heard_us: u64,
    },
    On,
}
