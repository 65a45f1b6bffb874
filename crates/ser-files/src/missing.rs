//! The words for what is missing.

use ser_evidence::record::{Lost, Why};

/// A recorder that could not be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NotReached {
    /// Its name.
    pub recorder: String,
    /// Why.
    pub why: String,
}

/// How a row of our CSV for PRC-002 begins its state where it says that something is missing.
pub(crate) const RECORDS_MISSING: &str = "RECORDS MISSING";

/// How many entries are missing, and why.
pub(crate) fn missing(lost: Lost, why: Why) -> String {
    let why = match why {
        Why::Overwritten => "overwritten",
        Why::LogBeganAnew => "the log began anew",
        Why::NotRecorded(inputs) => {
            return format!("inputs changed without being recorded: {}", ser_proto::Inputs(inputs));
        }
        Why::NotReached => "in none of the sources",
        Why::Unreadable => "a line could not be read",
    };
    match lost {
        Lost::Exactly(1) => format!("1 entry missing ({why})"),
        Lost::Exactly(count) => format!("{count} entries missing ({why})"),
        Lost::AtLeast(1) => format!("at least 1 entry missing ({why})"),
        Lost::AtLeast(count) => format!("at least {count} entries missing ({why})"),
        Lost::Unknown => format!("an unknown number of entries missing ({why})"),
    }
}
