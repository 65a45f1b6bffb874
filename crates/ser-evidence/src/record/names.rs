//! What a file says about a recorder and its inputs, where it knows names and the site file may not.
//!
//! A recorder of ours knows numbers only. The list of a relay, or of another recorder, has names,
//! and its stamps are in a time that its reader knew.

/// What an input is called, and what on and off mean there.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct PointRecord {
    /// The input, 1 to 32.
    pub input: u8,
    /// Its name.
    pub name: String,
    /// What it means when it is on.
    pub on: String,
    /// What it means when it is off.
    pub off: String,
}

/// In what time all stamps of a recorder are. Who wrote them knows it: it comes before what the site
/// file says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct RecorderRecord {
    /// Seconds east of UTC, less than a day either way; 0 is UTC.
    pub utc_offset_s: i32,
}

impl PointRecord {
    /// The last input that there can be.
    pub const LAST_INPUT: u8 = 32;

    /// The longest name or text, in characters.
    pub const LONGEST: usize = 200;
}

impl RecorderRecord {
    /// The stamps are in UTC.
    pub const UTC: RecorderRecord = RecorderRecord { utc_offset_s: 0 };

    /// No offset is as large as this.
    pub const DAY_S: i32 = 86_400;
}
