//! Observations of recorders' clocks.

use std::fmt;

use ser_proto::Entry;

use super::Life;
use crate::time::{Bound, Host, Moment, Shown, Utc};

/// One run of a host's operating system, by a name that no other has: 128 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Boot(pub u128);

/// As 32 hexadecimal digits.
impl fmt::Display for Boot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

impl Boot {
    /// The boot with this name, as [`Display`](fmt::Display) writes it.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Boot> {
        let is_ours =
            name.len() == 32 && name.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'));
        u128::from_str_radix(name, 16).ok().filter(|_| is_ours).map(Boot)
    }
}

/// Both clocks of a host at one instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HostReading {
    /// Which boot its monotonic clock counts from.
    pub boot: Boot,
    /// The monotonic clock.
    pub monotonic: Moment<Host>,
    /// The clock that shows UTC.
    pub utc: Moment<Utc>,
    /// How far that clock may be from UTC, in microseconds; `None` if the operating system does not
    /// know.
    pub utc_doubt_us: Option<u64>,
}

/// What a recorder's clock showed, and when.
///
/// The clock began to show the millisecond `shown` within the bound of `at`. The bound allows for
/// everything that the observer does not know: the way there and back, the time on the line,
/// repeats, and the recorder's own millisecond.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClockObservation {
    /// How it was observed.
    pub how: How,
    /// What the clock showed: a whole millisecond.
    pub shown: Moment<Shown>,
    /// When it began to show that.
    pub at: Reference,
    /// Where in the log.
    pub place: Place,
}

/// When a clock showed something, against the observer's own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reference {
    /// By the monotonic clock of a host.
    Host {
        /// When the clock began to show the millisecond; either end may be unknown.
        bound: Bound<Host>,
        /// Both clocks of the host at the time of the observation.
        reading: HostReading,
    },
    /// In UTC, as told by a person.
    Utc(Bound<Utc>),
}

/// How a clock was observed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum How {
    /// It was set to this time: there is a step right before.
    Set {
        /// The broadcast that set it, if it was one. All observations of one broadcast share the
        /// instant at which it was on the bus.
        broadcast: Option<u64>,
    },
    /// A broadcast that does nothing came, and the recorder told when.
    Mark {
        /// The broadcast.
        broadcast: u64,
    },
    /// It was asked.
    Query,
    /// The entry whose sequence is [`Place::after`], stamped with this time, was first there between
    /// two readings.
    Event,
    /// A person read it.
    Hand,
}

impl How {
    /// The broadcast that it is an observation of.
    #[must_use]
    pub const fn broadcast(self) -> Option<u64> {
        match self {
            How::Set { broadcast } => broadcast,
            How::Mark { broadcast } => Some(broadcast),
            How::Query | How::Event | How::Hand => None,
        }
    }

    /// Whether the clock was set.
    #[must_use]
    pub const fn is_set(self) -> bool {
        matches!(self, How::Set { .. })
    }
}

/// Where in a log something happened that is not in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// The life of the log; unknown if nothing is remembered of it.
    pub life: Life,
    /// Entries up to this sequence came before. (Modulo 65536 if the life is unknown; 0: the log
    /// was empty.)
    pub after: Option<u64>,
    /// Entries above this sequence came after. Those between may be on either side. (Modulo 65536
    /// if the life is unknown.)
    pub before: Option<u64>,
    /// The entry whose sequence is `after`. Its content tells which life it was.
    pub newest: Option<Entry>,
    /// Another entry of the same life, where that one may not be at hand: a part of a log says so
    /// of what happened outside of it.
    pub fellow: Option<Fellow>,
}

/// An entry by which the place of something in its life is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fellow {
    /// Its sequence less that of the entry after which the place is.
    pub ahead: i64,
    /// The entry.
    pub entry: Entry,
}

impl Place {
    /// Nothing is known of the place.
    pub const UNKNOWN: Place =
        Place { life: Life::UNKNOWN, after: None, before: None, newest: None, fellow: None };
}

/// A place where a clock may have been set, for example by a command that was not answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClockStep {
    /// Where.
    pub place: Place,
    /// When the command may have arrived.
    pub reading: HostReading,
}
