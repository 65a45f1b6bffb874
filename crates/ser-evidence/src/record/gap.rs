//! What is known to be missing.

use ser_proto::Inputs;

use super::Life;

/// Entries, or changes, that are known to be missing at a place of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gap {
    /// The life of the last entry before it.
    pub life: Life,
    /// The sequence of the last entry before it; 0 at the beginning of a log.
    pub after: Option<u64>,
    /// How many entries.
    pub lost: Lost,
    /// Why.
    pub why: Why,
}

impl Gap {
    /// A reading did not get to the recorder.
    pub const NOT_REACHED: Gap =
        Gap { life: Life::UNKNOWN, after: None, lost: Lost::Unknown, why: Why::NotReached };
}

/// How many entries are missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Lost {
    /// This many.
    Exactly(u32),
    /// This many or more.
    AtLeast(u32),
    /// Nobody knows.
    Unknown,
}

/// Why entries are missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Why {
    /// Newer entries took their places before they were read.
    Overwritten,
    /// The log began anew, and what was unread then is gone.
    LogBeganAnew,
    /// These inputs (bit 0 is input 1) changed and no entry says when.
    NotRecorded(u32),
    /// The recorder, or the host that reads it, could not be reached. Without a sequence to come
    /// [after](Gap::after): the reading that these records are from did not get to this recorder.
    NotReached,
    /// A line of a file could not be read. What is missing may have been in it.
    Unreadable,
    /// An archive had them and let them go when their time there was over.
    Expired,
}

impl Why {
    /// Changed without being recorded.
    #[must_use]
    pub const fn not_recorded(inputs: Inputs) -> Why {
        Why::NotRecorded(inputs.0)
    }
}
