//! All that is known of each recorder, put together from any number of sources.
//!
//! Readings of the same log overlap, and not all of them know which life of the log they read. They
//! are joined by what entries are: recorder, life and sequence, or, where the life has no name, by
//! their content. The result is the same whatever the order of the sources.

mod collector;
mod gaps;
mod join;
mod left_out;
mod names;

use ser_proto::{Entry, Inputs};

pub use collector::Collector;
pub use gaps::LogGap;
pub use names::TwoNames;

use crate::record::{
    ClockObservation, ClockStep, Life, PointRecord, RecorderRecord, Suppressed, Watched,
};
use crate::site::{Recorder, RecorderId};

/// Everything that is known of all recorders.
#[derive(Debug)]
pub struct History {
    /// By name.
    pub recorders: Vec<RecorderHistory>,
}

/// Everything that is known of one recorder.
#[derive(Debug)]
pub struct RecorderHistory {
    /// Its name and properties.
    pub recorder: Recorder,
    /// Where it is in the site file, if it is there.
    pub site: Option<RecorderId>,
    /// The lives of its log: first those with a name, by name, then those without, by content.
    pub lives: Vec<LifeHistory>,
    /// What its clock showed.
    pub observations: Vec<ClockObservation>,
    /// Where its clock may have been set without anybody knowing to what.
    pub steps: Vec<ClockStep>,
    /// When nothing was missed.
    pub watched: Vec<Watched>,
    /// How many changes it had left out, at each look.
    pub suppressed: Vec<Suppressed>,
    /// Whether a source could not reach it, and no other source has read it.
    pub is_not_reached: bool,
    /// What files say that its inputs are called, by input.
    pub points: Vec<PointRecord>,
    /// In what time its stamps are, where a file says it.
    pub stamps: Option<RecorderRecord>,
    /// Entries that cannot both be true, each with the sequence that they share.
    pub conflicts: Vec<Conflict>,
}

/// One life of a recorder's log.
#[derive(Debug, Default)]
pub struct LifeHistory {
    /// Its name; [`Life::UNKNOWN`] if no reading knew it.
    pub life: Option<Life>,
    /// Whether sequences count from the beginning of the log. Otherwise a multiple of 65536 may be
    /// missing in them.
    pub is_exact: bool,
    /// Whether the places of the entries are those of a reading by number, which tells no sequence.
    pub is_by_number: bool,
    /// The life before, if the log was erased by command.
    pub erased: Option<Life>,
    /// All entries, by sequence, each once.
    pub entries: Vec<Held>,
    /// What is missing, by place.
    pub gaps: Vec<LogGap>,
    /// Ahead of which places there are entries that were left out, since nobody asked for them.
    /// They are not missing; whether anything between them is, nobody says.
    pub left_out: Vec<usize>,
}

/// An entry in its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Held {
    /// The total after it.
    pub sequence: u64,
    /// The entry as it was read.
    pub entry: Entry,
    /// Its number in the ring.
    pub number: u16,
    /// Inputs whose state is known: all, except in formats that show only what changed.
    pub known: Inputs,
}

impl Held {
    /// Whether an input is on from this entry on; `None` if the source does not say.
    #[must_use]
    pub fn state_of(&self, input: u8) -> Option<bool> {
        self.known.contains(input).then(|| self.entry.state.contains(input))
    }

    /// Whether two readings may be of the same entry: they agree in everything that both know.
    #[must_use]
    pub fn agrees(&self, other: &Held) -> bool {
        let known = self.known.0 & other.known.0;
        self.entry.time == other.entry.time
            && self.entry.changed == other.entry.changed
            && (self.entry.state.0 ^ other.entry.state.0) & known == 0
    }
}

/// Two entries at one place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Conflict {
    /// The life.
    pub life: Life,
    /// Their sequence.
    pub sequence: u64,
    /// The one that is shown.
    pub shown: Entry,
    /// The other one.
    pub other: Entry,
}

impl RecorderHistory {
    /// What contradicts the entry at this place.
    pub fn conflicts_at(&self, life: Life, sequence: u64) -> impl Iterator<Item = &Conflict> {
        let at = move |conflict: &&Conflict| (conflict.life, conflict.sequence) == (life, sequence);
        let first = self
            .conflicts
            .partition_point(|conflict| (conflict.life, conflict.sequence) < (life, sequence));
        self.conflicts.iter().skip(first).take_while(at)
    }
}

impl LifeHistory {
    /// The place of the first entry with at least this sequence.
    #[must_use]
    pub fn place_of(&self, sequence: u64) -> usize {
        self.entries.partition_point(|held| held.sequence < sequence)
    }

    /// The entry with this sequence.
    #[must_use]
    pub fn entry(&self, sequence: u64) -> Option<&Held> {
        self.entries.get(self.place_of(sequence)).filter(|held| held.sequence == sequence)
    }

    /// Whether the entries of a life are not known without a break right ahead of a place.
    #[must_use]
    pub fn is_broken_ahead_of(&self, place: usize) -> bool {
        self.gaps.binary_search_by_key(&place, |gap| gap.place).is_ok()
            || self.left_out.binary_search(&place).is_ok()
    }

    /// The life's name.
    #[must_use]
    pub fn name(&self) -> Life {
        self.life.unwrap_or(Life::UNKNOWN)
    }
}
