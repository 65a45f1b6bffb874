//! What people say about incidents.

use super::{HostReading, Life};

/// A remark of a person on the incident that an entry belongs to. It changes nothing of what was
/// read, and takes no part in the timeline.
///
/// An incident is closed if the last note on it closes it; a later one that does not opens it
/// again.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NoteRecord {
    /// When it was written.
    pub at: HostReading,
    /// Who wrote it, as that computer calls the person.
    pub user: String,
    /// The computer on which it was written.
    pub host: String,
    /// The life of the entry that it is attached to.
    pub life: Life,
    /// The sequence of that entry.
    pub sequence: u64,
    /// What it says; empty only if it closes the incident without a word.
    pub text: String,
    /// Whether the incident is closed with it.
    pub closes: bool,
}

impl NoteRecord {
    /// The longest text, in characters.
    pub const LONGEST: usize = 4000;

    /// The longest name of a person or a computer, in characters.
    pub const LONGEST_NAME: usize = 200;
}
