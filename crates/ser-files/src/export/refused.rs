//! Why an export was not made.

use std::error::Error;
use std::fmt;
use std::io;

/// Why an export was not made.
#[derive(Debug)]
pub enum Refused {
    /// Nothing has a time that could be put on an axis.
    Empty,
    /// The selection is longer than the format can say.
    TooLong {
        /// How long it is, in milliseconds.
        is_ms: u64,
        /// How long it may be, in milliseconds.
        may_be_ms: u64,
    },
    /// What it was to be written to did not take it.
    Io(io::Error),
}

impl From<io::Error> for Refused {
    fn from(error: io::Error) -> Refused {
        Refused::Io(error)
    }
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Refused::Empty => f.write_str("no entry has a time, so none can be drawn"),
            Refused::TooLong { is_ms, may_be_ms } => {
                let (is, may_be) = match (long(*is_ms), long(*may_be_ms)) {
                    (is, may_be) if is == may_be => (exactly(*is_ms), exactly(*may_be_ms)),
                    texts => texts,
                };
                write!(f, "the entries are {is} apart, and this format can hold {may_be}")
            }
            Refused::Io(error) => error.fmt(f),
        }
    }
}

impl Error for Refused {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            Refused::Io(error) => Some(error),
            Refused::Empty | Refused::TooLong { .. } => None,
        }
    }
}

/// A time in days, hours and so on, as in `30 h 0 min`.
fn long(ms: u64) -> String {
    let (seconds, minutes) = (ms / 1000, ms / 60_000);
    match ms {
        0..60_000 => format!("{seconds} s"),
        60_000..3_600_000 => format!("{minutes} min {} s", seconds % 60),
        3_600_000..172_800_000 => format!("{} h {} min", minutes / 60, minutes % 60),
        _ => format!("{} days {} h", minutes / 1440, minutes / 60 % 24),
    }
}

/// The same to the millisecond.
fn exactly(ms: u64) -> String {
    let (seconds, minutes) = (ms / 1000, ms / 60_000);
    format!("{} h {} min {}.{:03} s", minutes / 60, minutes % 60, seconds % 60, ms % 1000)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_lengths_that_look_alike_are_told_to_the_millisecond() {
        let told = Refused::TooLong { is_ms: 3_600_001, may_be_ms: 3_600_000 }.to_string();
        assert_eq!(
            told,
            "the entries are 1 h 0 min 0.001 s apart, and this format can hold 1 h 0 min 0.000 s"
        );
        let told = Refused::TooLong { is_ms: 7_200_000, may_be_ms: 3_600_000 }.to_string();
        assert_eq!(told, "the entries are 2 h 0 min apart, and this format can hold 1 h 0 min");
    }

    #[test]
    fn lengths_are_told_in_units_that_people_use() {
        let told = [5_999, 61_000, 3_600_000, 200_000_000].map(long);
        assert_eq!(told, ["5 s", "1 min 1 s", "1 h 0 min", "2 days 7 h"]);
    }
}
