//! Why a board sends a message.

/// Why the board sends a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reason {
    /// The command in the command block.
    Command,
    /// A command whose end the host does not want to hear of.
    UnreportedCommand,
    /// A Read ID to a device that is not logged in.
    LogIn { address: u8 },
    /// A device's outputs were enabled.
    Assign { address: u8 },
    /// An answer.
    Reply,
}
