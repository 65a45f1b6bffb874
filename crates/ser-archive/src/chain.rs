//! The digests that make rows a chain: each is of the row and of the digest before it.
//!
//! Who changes, removes or adds a row would have to change all digests after it, also the last one,
//! which somebody may have written down elsewhere.

use sha2::{Digest as _, Sha256};

use crate::stored::StoredEntry;

/// A SHA-256.
pub(crate) type Digest = [u8; 32];

/// What a chain begins with, so that no row of another chain fits.
pub(crate) fn begin(collector: &str, recorder: &str) -> Digest {
    let mut hash = Sha256::new();
    hash.update(b"ser-archive 1\0");
    hash.update((collector.len() as u64).to_be_bytes());
    hash.update(collector);
    hash.update(recorder);
    hash.finalize().into()
}

/// A row of a chain.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Link<'r> {
    /// An entry.
    Entry(&'r StoredEntry),
    /// What contradicts one.
    Conflict(&'r StoredEntry),
    /// Another record, as a line.
    Evidence(&'r str),
    /// Rows before it were let go.
    Checkpoint(&'r Checkpoint),
}

/// What is left of the beginning of a chain whose rows were let go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Checkpoint {
    /// The position of the last row that may be gone.
    pub(crate) to_position: i64,
    /// How many rows the chain had by then.
    pub(crate) rows: i64,
    /// The digest of the chain by then.
    pub(crate) digest: Digest,
    /// The digest over the evidence that stays.
    pub(crate) kept: Digest,
    /// How many entries are gone, conflicts included.
    pub(crate) entries: i64,
    /// How many conflicts are gone, those of earlier checkpoints included.
    pub(crate) conflicts: i64,
    /// When that was, in microseconds of UTC.
    pub(crate) expired_us: i64,
}

impl Link<'_> {
    /// The digest after this row. A letter says how the bytes behind it are read, so two different
    /// rows never give the same ones.
    pub(crate) fn after(&self, before: &Digest) -> Digest {
        let mut hash = Sha256::new();
        hash.update(before);
        match self {
            Link::Entry(entry) => {
                hash.update(b"E");
                hash.update(entry.bytes());
            }
            Link::Conflict(entry) => {
                hash.update(b"C");
                hash.update(entry.bytes());
            }
            Link::Evidence(line) => {
                hash.update(b"L");
                hash.update(line);
            }
            Link::Checkpoint(checkpoint) => {
                let Checkpoint { to_position, rows, digest, kept, entries, conflicts, expired_us } =
                    checkpoint;
                hash.update(b"K");
                for number in [to_position, rows, entries, conflicts, expired_us] {
                    hash.update(number.to_be_bytes());
                }
                hash.update(digest);
                hash.update(kept);
            }
        }
        hash.finalize().into()
    }
}

/// The digest of a line, by which it is known again.
pub(crate) fn content(line: &str) -> Digest {
    Sha256::digest(line).into()
}

/// What the digest over the evidence before a checkpoint begins with.
pub(crate) const NOTHING_KEPT: Digest = [0; 32];
