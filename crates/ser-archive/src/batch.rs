//! What is added at once, and what comes of it.

use ser_evidence::record::{Life, Record};
use ser_evidence::time::{Moment, Utc};
use ser_proto::Entry;

/// What a collector has read of one recorder, and where it goes on. All of it is written, or
/// nothing.
#[derive(Clone, Debug)]
pub struct Batch {
    /// Who has read it.
    pub collector: String,
    /// Whose log it is.
    pub recorder: String,
    /// What was read, in that order.
    pub records: Vec<Record>,
    /// Where reading goes on, if that has moved.
    pub bookmark: Option<Bookmark>,
    /// Whether a life that this collector brings for the first time may be one that another
    /// collector has brought under another name. If an entry of it is there under that name and
    /// none contradicts it, all records are filed under that name, now and later. Names that
    /// recorders themselves give to their lives need no such thing.
    pub joins: bool,
    /// When it is written, by the clock of the computer.
    pub at: Moment<Utc>,
}

impl Batch {
    /// Records of which no reading goes on, and whose lives are called as they are here.
    #[must_use]
    pub fn of(
        collector: impl Into<String>,
        recorder: impl Into<String>,
        records: Vec<Record>,
        at: Moment<Utc>,
    ) -> Batch {
        let (collector, recorder) = (collector.into(), recorder.into());
        Batch { collector, recorder, records, bookmark: None, joins: false, at }
    }
}

/// Where a collector goes on reading a recorder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bookmark {
    /// The life of the log.
    pub life: Life,
    /// The sequence of the last entry that was read.
    pub sequence: u64,
    /// Whether sequences count from the beginning of the log.
    pub is_exact: bool,
    /// The last entry that was read, by which the log is known again.
    pub anchor: Option<Entry>,
    /// How many entries the log holds, if that is known.
    pub log_size: Option<u16>,
    /// What the recorder said which log it is, if it can: bytes that only collectors understand.
    pub log: Option<[u8; 20]>,
}

/// What was written of a batch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Appended {
    /// The position of the last row in the archive by then.
    pub position: i64,
    /// Entries that were new.
    pub entries: u64,
    /// Entries that contradict others at their place.
    pub conflicts: u64,
    /// Other records that were new.
    pub evidence: u64,
    /// Records that were there already.
    pub known: u64,
}
