//! Letting go of what is old, and saying so.
//!
//! What was added first goes first, whole batches at a time. Entries go; what is known besides them
//! stays, since later entries need it. A gap says how many entries are gone from where, and a
//! checkpoint holds the digest from which the chain goes on.

use std::collections::BTreeMap;

use ser_evidence::record::{Gap, Life, Lost, Record, Why};
use ser_evidence::time::{Moment, Utc};

use crate::append::next;
use crate::archive::Archive;
use crate::batch::Batch;
use crate::chain::{Checkpoint, Digest, Link, NOTHING_KEPT};
use crate::error::{Error, Result};
use crate::sql::{Sql, Value, first};
use crate::stored::sequence;

/// What is kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Keep {
    /// What was added at this time or later.
    pub since: Option<Moment<Utc>>,
    /// As much as this many bytes hold; the newest.
    pub bytes: Option<u64>,
}

/// What was let go.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Expired {
    /// Entries, conflicts included.
    pub entries: u64,
    /// Gaps that say so.
    pub gaps: u64,
}

/// How much of an archive that is too large goes at a time: a part in this many.
const PART: u64 = 16;

/// The last position of each chain before the first batch that was added at a time or later. What was
/// added after something that is to be kept stays, too, whatever the computer's clock showed then.
const OLD: &str = "SELECT id, CASE WHEN kept IS NULL \
    THEN (SELECT max(position) FROM link WHERE chain = id) \
    ELSE (SELECT max(position) FROM link WHERE chain = id AND position < kept) END \
    FROM (SELECT id, (SELECT min(position) FROM link WHERE chain = id AND archived_us >= ?1) AS kept \
    FROM chain) AS chains";

/// The last position of each chain up to a position.
const FIRST: &str = "SELECT id, (SELECT max(position) FROM link \
    WHERE chain = id AND position <= ?1) FROM chain";

impl Archive {
    /// Lets go of what is not to be kept, as of now. Each step is one transaction.
    ///
    /// # Errors
    /// If anything cannot be written. What was let go before that is told in the archive.
    pub fn expire(&mut self, keep: Keep, now: Moment<Utc>) -> Result<Expired> {
        let mut expired = Expired::default();
        if let Some(since) = keep.since {
            expired.add(self.expire_to(OLD, since.us(), now)?);
        }
        if let Some(bytes) = keep.bytes {
            while self.sql.size()? > bytes {
                let Some(position) = self.oldest_part()? else { break };
                let gone = self.expire_to(FIRST, position, now)?;
                expired.add(gone);
                if gone.entries == 0 {
                    break;
                }
            }
        }
        if expired.entries > 0 {
            self.sql.give_back()?;
        }
        Ok(expired)
    }

    /// The end of the batch up to which there is about one part of the entries.
    fn oldest_part(&mut self) -> Result<Option<i64>> {
        const ENTRIES: &str = "SELECT count(*) FROM entry";
        const PLACE: &str = "SELECT position FROM entry ORDER BY position LIMIT 1 OFFSET ?1";
        const END: &str = "SELECT min(position) FROM link WHERE position >= ?1";
        let sql = &mut *self.sql;
        let count = first(sql, ENTRIES, &[], |row| row.int(0))?.unwrap_or(0);
        let place = (count.cast_unsigned() / PART).cast_signed();
        let Some(place) = first(sql, PLACE, &[Value::Int(place)], |row| row.int(0))? else {
            return Ok(None);
        };
        Ok(first(sql, END, &[Value::Int(place)], |row| row.maybe_int(0))?.flatten())
    }

    /// Lets go of what each chain has up to the position that a statement says for a value.
    fn expire_to(&mut self, ends: &'static str, value: i64, now: Moment<Utc>) -> Result<Expired> {
        self.in_transaction(|archive| {
            let mut chains = Vec::new();
            archive.sql.query(ends, &[Value::Int(value)], &mut |row| {
                chains.extend(row.maybe_int(1)?.map(|to| (row.int(0), to)));
                Ok(())
            })?;
            let mut expired = Expired::default();
            for (chain, to) in chains {
                expired.add(archive.expire_chain(chain?, to, now)?);
            }
            Ok(expired)
        })
    }

    /// Lets go of the entries of a chain up to a position at which it has a link.
    fn expire_chain(&mut self, chain: i64, to: i64, now: Moment<Utc>) -> Result<Expired> {
        const NAMES: &str = "SELECT collector, recorder.name FROM chain \
            JOIN recorder ON recorder.id = chain.recorder WHERE chain.id = ?1";
        const AT: &str = "SELECT rows, digest FROM link WHERE chain = ?1 AND position = ?2";
        let values = [Value::Int(chain), Value::Int(to)];
        let gone = stretches(&mut *self.sql, chain, to)?;
        if gone.is_empty() {
            return Ok(Expired::default());
        }
        let archive = self.sql.name().to_owned();
        let damaged = |what: &str| Error::damaged(&archive, what);
        let names = first(&mut *self.sql, NAMES, &values[..1], |row| {
            Ok((row.text(0)?.to_owned(), row.text(1)?.to_owned()))
        })?;
        let (collector, recorder) = names.ok_or_else(|| damaged("a chain has no name"))?;
        let at = first(&mut *self.sql, AT, &values, |row| {
            let digest = Digest::try_from(row.bytes(1)?)
                .map_err(|_| Error::damaged(&archive, "a digest has another length"))?;
            Ok((row.int(0)?, digest))
        })?;
        let (rows, digest) = at.ok_or_else(|| damaged("a link is gone"))?;
        let kept = kept_digest(&mut *self.sql, chain, to)?;
        let entries = self.delete(&values)?;
        let checkpoint = Checkpoint {
            to_position: to,
            rows,
            digest,
            kept,
            entries: entries.cast_signed(),
            expired_us: now.us(),
        };
        self.add_checkpoint(&collector, &recorder, &checkpoint)?;
        let gaps: Vec<Record> = gone.iter().map(Stretch::gap).collect();
        let expired = Expired { entries, gaps: gaps.len() as u64 };
        self.append_within(&[Batch {
            collector,
            recorder,
            records: gaps,
            bookmark: None,
            at: now,
        }])?;
        Ok(expired)
    }

    /// Deletes entries, conflicts and links of a chain up to a position. Returns how many entries.
    fn delete(&mut self, values: &[Value]) -> Result<u64> {
        const CHECKPOINTS: &str = "DELETE FROM checkpoint WHERE chain = ?1 AND position <= ?2";
        const ENTRIES: &str = "DELETE FROM entry WHERE chain = ?1 AND position <= ?2";
        const CONFLICTS: &str = "DELETE FROM conflict WHERE chain = ?1 AND position <= ?2";
        const LINKS: &str = "DELETE FROM link WHERE chain = ?1 AND position <= ?2";
        let entries = self.sql.run(ENTRIES, values)? + self.sql.run(CONFLICTS, values)?;
        self.sql.run(LINKS, values)?;
        // The new checkpoint speaks for those before it.
        self.sql.run(CHECKPOINTS, values)?;
        Ok(entries)
    }

    fn add_checkpoint(
        &mut self,
        collector: &str,
        recorder: &str,
        checkpoint: &Checkpoint,
    ) -> Result<()> {
        const ADD: &str = "INSERT INTO checkpoint (position, chain, to_position, rows, digest, \
            kept, entries, expired_us) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8)";
        const POSITION: &str = "UPDATE archive SET position = ?1";
        let position = next(self.position()?, self.name())?;
        let mut chain = self.chain(collector, recorder)?;
        // Where all links are gone, the chain goes on from here.
        if chain.rows == 0 {
            (chain.rows, chain.digest) = (checkpoint.rows, checkpoint.digest);
        }
        chain.rows = next(chain.rows, self.name())?;
        chain.digest = Link::Checkpoint(checkpoint).after(&chain.digest);
        let Checkpoint { to_position, rows, digest, kept, entries, expired_us } = checkpoint;
        let values = [
            Value::Int(position),
            Value::Int(chain.id),
            Value::Int(*to_position),
            Value::Int(*rows),
            Value::from(&digest[..]),
            Value::from(&kept[..]),
            Value::Int(*entries),
            Value::Int(*expired_us),
        ];
        self.sql.run(ADD, &values)?;
        self.sql.run(POSITION, &[Value::Int(position)])?;
        chain.note(&mut *self.sql, position, *expired_us)
    }

    /// The newest checkpoint of a chain.
    pub(crate) fn checkpoint(&mut self, chain: i64) -> Result<Option<Checkpoint>> {
        const NEWEST: &str = "SELECT to_position, rows, digest, kept, entries, expired_us \
            FROM checkpoint WHERE chain = ?1 ORDER BY position DESC LIMIT 1";
        let archive = self.sql.name().to_owned();
        let digest = |bytes: &[u8]| {
            Digest::try_from(bytes)
                .map_err(|_| Error::damaged(&archive, "a digest has another length"))
        };
        first(&mut *self.sql, NEWEST, &[Value::Int(chain)], |row| {
            Ok(Checkpoint {
                to_position: row.int(0)?,
                rows: row.int(1)?,
                digest: digest(row.bytes(2)?)?,
                kept: digest(row.bytes(3)?)?,
                entries: row.int(4)?,
                expired_us: row.int(5)?,
            })
        })
    }
}

impl Expired {
    fn add(&mut self, other: Expired) {
        self.entries += other.entries;
        self.gaps += other.gaps;
    }
}

/// Neighbouring entries.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    life: Life,
    first: u64,
    last: u64,
}

impl Stretch {
    /// What says that they are gone.
    fn gap(&self) -> Record {
        let count = u32::try_from(self.last - self.first + 1).unwrap_or(u32::MAX);
        Record::Gap(Gap {
            life: self.life,
            after: Some(self.first - 1),
            lost: Lost::Exactly(count),
            why: Why::Expired,
        })
    }
}

/// The entries of a chain up to a position, as stretches of neighbours.
fn stretches(sql: &mut dyn Sql, chain: i64, to: i64) -> Result<Vec<Stretch>> {
    const ENTRIES: &str = "SELECT life, sequence FROM entry \
        WHERE chain = ?1 AND position <= ?2 ORDER BY life, sequence";
    let archive = sql.name().to_owned();
    let mut by_life: BTreeMap<u64, Vec<Stretch>> = BTreeMap::new();
    sql.query(ENTRIES, &[Value::Int(chain), Value::Int(to)], &mut |row| {
        let (life, sequence) = (row.int(0)?.cast_unsigned(), sequence(row, 1, &archive)?);
        let of_life = by_life.entry(life).or_default();
        match of_life.last_mut() {
            Some(stretch) if stretch.last + 1 == sequence => stretch.last = sequence,
            _ => of_life.push(Stretch {
                life: Life::from_bits(life),
                first: sequence,
                last: sequence,
            }),
        }
        Ok(())
    })?;
    Ok(by_life.into_values().flatten().collect())
}

/// The digest over the evidence of a chain up to a position.
fn kept_digest(sql: &mut dyn Sql, chain: i64, to: i64) -> Result<Digest> {
    const LINES: &str = "SELECT line FROM evidence WHERE chain = ?1 AND position <= ?2 \
        ORDER BY position";
    let mut kept = NOTHING_KEPT;
    sql.query(LINES, &[Value::Int(chain), Value::Int(to)], &mut |row| {
        kept = Link::Evidence(row.text(0)?).after(&kept);
        Ok(())
    })?;
    Ok(kept)
}
