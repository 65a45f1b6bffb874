//! Changes that a recorder left out of its log, because an input chattered.

use std::collections::BTreeMap;

use super::HostReading;

/// What a recorder had counted when it was looked at.
///
/// It counts from its power-up on, whatever becomes of its log meanwhile, and nobody can reset that.
/// So two looks tell by their difference how many changes were left out between them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Suppressed {
    /// When the look began.
    pub from: HostReading,
    /// When it had ended: the counts are those of a moment in between.
    pub to: HostReading,
    /// How long the recorder had been on when the look began, by its own clock, in microseconds.
    pub on_for_us: u64,
    /// How many changes had been left out of each input, 1 to 32. Inputs without one need not be
    /// there.
    pub left_out: BTreeMap<u8, u32>,
}

impl Suppressed {
    /// The last input that there can be.
    pub const LAST_INPUT: u8 = 32;
}
