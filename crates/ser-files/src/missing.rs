//! The words for what is missing.

use ser_evidence::record::{Lost, Why};
use ser_proto::Inputs;

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

/// What our files call a reason.
pub(crate) const fn why_name(why: Why) -> &'static str {
    match why {
        Why::Overwritten => "overwritten",
        Why::LogBeganAnew => "log began anew",
        Why::NotRecorded(_) => "not recorded",
        Why::NotReached => "not reached",
        Why::Unreadable => "unreadable",
        Why::Expired => "expired",
    }
}

/// The reason that our files call so. That inputs were `not recorded` says which ones beside it.
pub(crate) fn why_named(name: &str) -> Option<Why> {
    let all = [Why::Overwritten, Why::LogBeganAnew, Why::NotReached, Why::Unreadable, Why::Expired];
    all.into_iter().find(|&why| why_name(why) == name)
}

/// A reason in one text, with the inputs that it is about.
pub(crate) fn why_text(why: Why) -> String {
    match why {
        Why::NotRecorded(inputs) => format!("{}, inputs {}", why_name(why), Inputs(inputs)),
        _ => why_name(why).to_owned(),
    }
}

/// How many entries are missing, and why: `37 entries missing (overwritten)`.
#[must_use]
pub fn missing(lost: Lost, why: Why) -> String {
    let why = match why {
        Why::Overwritten => "overwritten",
        Why::LogBeganAnew => "the log began anew",
        Why::NotRecorded(inputs) => {
            return format!("inputs changed without being recorded: {}", Inputs(inputs));
        }
        Why::NotReached => "in none of the sources",
        Why::Unreadable => "a line could not be read",
        Why::Expired => "too old for the archive",
    };
    match lost {
        Lost::Exactly(1) => format!("1 entry missing ({why})"),
        Lost::Exactly(count) => format!("{count} entries missing ({why})"),
        Lost::AtLeast(1) => format!("at least 1 entry missing ({why})"),
        Lost::AtLeast(count) => format!("at least {count} entries missing ({why})"),
        Lost::Unknown => format!("an unknown number of entries missing ({why})"),
    }
}
