//! Whether anybody has changed, removed or added a row.

use std::collections::BTreeMap;

use crate::archive::Archive;
use crate::chain::{self, Checkpoint, Digest, Link, NOTHING_KEPT};
use crate::error::{Error, Result};
use crate::sql::{Columns, Value, first};
use crate::stored::{StoredEntry, StoredEvidence};

/// The end of the chain of one collector and one recorder. Written down elsewhere, it shows later
/// whether anything before it was changed, or rows at the end were taken away.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ChainHead {
    /// Who has added the rows.
    pub collector: String,
    /// Whose they are.
    pub recorder: String,
    /// The position of the last row.
    pub position: i64,
    /// How many rows there have been, also those that were let go.
    pub rows: u64,
    /// The SHA-256.
    pub digest: [u8; 32],
    /// Up to which position rows were let go by [`expire`](Archive::expire). What is left of them
    /// is covered by a digest of its own.
    pub expired_to: Option<i64>,
}

/// Where a chain is broken.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Broken {
    /// Who has added the rows.
    pub collector: String,
    /// Whose they are.
    pub recorder: String,
    /// Up to this position everything is as it was added.
    pub good_to: i64,
    /// Something between there and this position was changed, removed or added. `None`: there are
    /// rows behind the last that anybody has vouched for.
    pub until: Option<i64>,
}

/// A chain while it is gone over.
struct Walk {
    collector: String,
    recorder: String,
    recorder_id: i64,
    checkpoint: Option<Checkpoint>,
    /// The digest over the evidence before the checkpoint.
    kept: Digest,
    /// The position, number and digest of the last row.
    position: i64,
    rows: i64,
    digest: Digest,
    /// The last link that was right.
    good_to: i64,
    last_link: Option<(i64, i64, Digest)>,
    broken: Option<Option<i64>>,
}

/// A row of a chain.
enum Step<'r> {
    Row(Link<'r>),
    /// Columns of the row contradict each other.
    Contradiction,
    /// What was noted of the chain at this position.
    Noted {
        rows: i64,
        digest: Digest,
    },
}

impl Archive {
    /// Where each chain ends, as it was noted when the last row was added. Nothing is reckoned.
    ///
    /// # Errors
    /// If the archive cannot be read.
    pub fn heads(&mut self) -> Result<Vec<ChainHead>> {
        const HEADS: &str = "SELECT collector, recorder.name, position, rows, digest, \
            (SELECT max(to_position) FROM checkpoint WHERE checkpoint.chain = chain.id) \
            FROM chain JOIN recorder ON recorder.id = chain.recorder \
            JOIN link ON link.chain = chain.id AND link.position = \
            (SELECT max(position) FROM link WHERE link.chain = chain.id) \
            ORDER BY collector, recorder.name";
        let archive = self.sql.name().to_owned();
        let mut heads = Vec::new();
        self.sql.query(HEADS, &[], &mut |row| {
            let digest = row.bytes(4)?.try_into();
            heads.push(ChainHead {
                collector: row.text(0)?.to_owned(),
                recorder: row.text(1)?.to_owned(),
                position: row.int(2)?,
                rows: row.int(3)?.cast_unsigned(),
                digest: digest
                    .map_err(|_| Error::damaged(&archive, "a digest has another length"))?,
                expired_to: row.maybe_int(5)?,
            });
            Ok(())
        })?;
        Ok(heads)
    }

    /// Reckons all chains again. Returns where each ends, and where any is broken first.
    ///
    /// # Errors
    /// If the archive cannot be read. What cannot be understood is damage.
    pub fn verify(&mut self) -> Result<(Vec<ChainHead>, Vec<Broken>)> {
        self.in_snapshot(Archive::verify_now)
    }

    /// Whether this was once the head of a chain that is still the beginning of one here. What
    /// retention has let go is not known any more.
    ///
    /// # Errors
    /// If the archive cannot be read.
    pub fn has_head(&mut self, digest: &[u8; 32]) -> Result<bool> {
        const LINK: &str = "SELECT position FROM link WHERE digest = ?1";
        const CHECKPOINT: &str = "SELECT position FROM checkpoint WHERE digest = ?1";
        for statement in [LINK, CHECKPOINT] {
            let values = [Value::from(&digest[..])];
            if first(&mut *self.sql, statement, &values, |row| row.int(0))?.is_some() {
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn verify_now(&mut self) -> Result<(Vec<ChainHead>, Vec<Broken>)> {
        let mut walks = self.walks()?;
        let archive = self.sql.name().to_owned();
        self.for_each_step(&mut |chain, position, step| {
            let no_chain = || Error::damaged(&archive, format!("there is no chain {chain}"));
            walks.get_mut(&chain).ok_or_else(no_chain)?.step(position, &step);
            Ok(())
        })?;
        let (mut heads, mut broken) = (Vec::new(), Vec::new());
        for walk in walks.into_values() {
            let (head, fault) = walk.end();
            heads.extend(head);
            broken.extend(fault);
        }
        Ok((heads, broken))
    }

    fn walks(&mut self) -> Result<BTreeMap<i64, Walk>> {
        const CHAINS: &str = "SELECT chain.id, collector, recorder.name, recorder.id FROM chain \
            JOIN recorder ON recorder.id = chain.recorder";
        let mut walks = BTreeMap::new();
        self.sql.query(CHAINS, &[], &mut |row| {
            let (collector, recorder) = (row.text(1)?.to_owned(), row.text(2)?.to_owned());
            let digest = chain::begin(&collector, &recorder);
            let walk = Walk {
                collector,
                recorder,
                recorder_id: row.int(3)?,
                checkpoint: None,
                kept: NOTHING_KEPT,
                position: 0,
                rows: 0,
                digest,
                good_to: 0,
                last_link: None,
                broken: None,
            };
            walks.insert(row.int(0)?, walk);
            Ok(())
        })?;
        for (id, walk) in &mut walks {
            walk.checkpoint = self.checkpoint(*id)?;
        }
        Ok(walks)
    }

    /// Goes over all rows of all chains, in the order in which they were added. What was noted of a
    /// chain comes after the row at its position.
    fn for_each_step(
        &mut self,
        on: &mut dyn FnMut(i64, i64, Step<'_>) -> Result<()>,
    ) -> Result<()> {
        // One column each for what only some of the tables have: kind, line, content, digest, kept.
        const ROWS: &str = "SELECT position, 4 AS source, chain, 0 AS recorder, \
            rows AS life, 0 AS sequence, 0 AS number, 0 AS stamp, 0 AS shown_us, 0 AS changed, \
            0 AS state, 0 AS known, '' AS kind, '' AS line, digest AS content, digest, \
            digest AS kept FROM link \
            UNION ALL SELECT position, 3, chain, 0, to_position, rows, entries, expired_us, \
            conflicts, 0, \
            0, 0, '', '', digest, digest, kept FROM checkpoint \
            UNION ALL SELECT position, 2, chain, recorder, life, 0, 0, 0, 0, 0, 0, 0, kind, line, \
            content, content, content FROM evidence \
            UNION ALL SELECT position, 1, chain, recorder, life, sequence, number, stamp, \
            shown_us, changed, state, known, '', '', NULL, NULL, NULL FROM conflict \
            UNION ALL SELECT position, 0, chain, recorder, life, sequence, number, stamp, \
            shown_us, changed, state, known, '', '', NULL, NULL, NULL FROM entry \
            ORDER BY 1, 2";
        let recorders: BTreeMap<i64, i64> =
            self.walks()?.iter().map(|(id, walk)| (*id, walk.recorder_id)).collect();
        let archive = self.sql.name().to_owned();
        self.sql.query(ROWS, &[], &mut |row| {
            let (position, source, chain) = (row.int(0)?, row.int(1)?, row.int(2)?);
            let is_of_chain = |recorder: i64| recorders.get(&chain) == Some(&recorder);
            let digest = |column| {
                Digest::try_from(row.bytes(column)?)
                    .map_err(|_| Error::damaged(&archive, "a digest has another length"))
            };
            match source {
                0 | 1 => {
                    let entry = StoredEntry::from_row(row, 4, &archive)?;
                    let is_consistent = is_of_chain(row.int(3)?)
                        && entry.columns().get(4) == Some(&Value::from(row.maybe_int(8)?));
                    let link =
                        if source == 0 { Link::Entry(&entry) } else { Link::Conflict(&entry) };
                    let step = if is_consistent { Step::Row(link) } else { Step::Contradiction };
                    on(chain, position, step)
                }
                2 => {
                    let line = row.text(13)?;
                    let is_consistent = is_of_chain(row.int(3)?)
                        && chain::content(line) == digest(14)?
                        && is_as_said(row, &archive)?;
                    let step = match is_consistent {
                        true => Step::Row(Link::Evidence(line)),
                        false => Step::Contradiction,
                    };
                    on(chain, position, step)
                }
                3 => {
                    let checkpoint = Checkpoint {
                        to_position: row.int(4)?,
                        rows: row.int(5)?,
                        entries: row.int(6)?,
                        expired_us: row.int(7)?,
                        conflicts: row.int(8)?,
                        digest: digest(15)?,
                        kept: digest(16)?,
                    };
                    on(chain, position, Step::Row(Link::Checkpoint(&checkpoint)))
                }
                _ => on(chain, position, Step::Noted { rows: row.int(4)?, digest: digest(15)? }),
            }
        })
    }
}

/// Whether kind and life of a record are what its line says.
fn is_as_said(row: &dyn Columns, archive: &str) -> Result<bool> {
    let record = StoredEvidence::record(row.text(13)?, row.int(0)?, archive)?;
    let (kind, life) = StoredEvidence::kind_of(&record);
    Ok(kind == row.text(12)? && life.bits().cast_signed() == row.int(4)?)
}

impl Walk {
    fn step(&mut self, position: i64, step: &Step<'_>) {
        if let Some(checkpoint) = self.checkpoint {
            if position <= checkpoint.to_position {
                match step {
                    Step::Row(link @ Link::Evidence(_)) => self.kept = link.after(&self.kept),
                    Step::Noted { .. } => {}
                    Step::Row(_) | Step::Contradiction => self.fail(Some(position)),
                }
                return;
            }
            if self.position < checkpoint.to_position {
                self.begin_at(&checkpoint);
            }
        }
        match step {
            Step::Row(link) => {
                self.position = position;
                self.rows = self.rows.saturating_add(1);
                self.digest = link.after(&self.digest);
            }
            Step::Contradiction => self.fail(Some(position)),
            Step::Noted { rows, digest } => {
                self.last_link = Some((position, *rows, *digest));
                let is_right =
                    (self.position, self.rows, &self.digest) == (position, *rows, digest);
                match is_right {
                    true if self.broken.is_none() => self.good_to = position,
                    true => {}
                    false => self.fail(Some(position)),
                }
            }
        }
    }

    fn begin_at(&mut self, checkpoint: &Checkpoint) {
        if self.kept != checkpoint.kept {
            self.fail(Some(checkpoint.to_position));
        } else if self.broken.is_none() {
            self.good_to = checkpoint.to_position;
        }
        (self.position, self.rows) = (checkpoint.to_position, checkpoint.rows);
        self.digest = checkpoint.digest;
    }

    fn fail(&mut self, until: Option<i64>) {
        self.broken.get_or_insert(until);
    }

    fn end(mut self) -> (Option<ChainHead>, Option<Broken>) {
        // Rows behind the last link were added by somebody else.
        if self.last_link.map_or(0, |(position, ..)| position) < self.position {
            self.fail(None);
        }
        let broken = self.broken.map(|until| Broken {
            collector: self.collector.clone(),
            recorder: self.recorder.clone(),
            good_to: self.good_to,
            until,
        });
        let head = self.last_link.map(|(position, rows, digest)| ChainHead {
            collector: self.collector,
            recorder: self.recorder,
            position,
            rows: rows.cast_unsigned(),
            digest,
            expired_to: self.checkpoint.map(|checkpoint| checkpoint.to_position),
        });
        (head, broken)
    }
}
