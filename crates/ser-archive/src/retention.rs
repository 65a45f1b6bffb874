//! Letting go of what is old, and saying so.
//!
//! What was added first goes first, whole batches at a time, in steps that are a transaction each.
//! Entries go; what is known besides them stays, since later entries need it. A gap says how many
//! entries are gone from where, and a checkpoint holds the digest from which the chain goes on.

use std::collections::BTreeMap;

use ser_evidence::record::{Gap, Life, Lost, Record, Why};
use ser_evidence::time::{Moment, Utc};

use crate::append::next;
use crate::archive::Archive;
use crate::batch::Batch;
use crate::chain::{Checkpoint, Digest, Link, NOTHING_KEPT};
use crate::error::{Error, Result};
use crate::numbers::Numbers;
use crate::sql::{Sql, Value, first};
use crate::stored::{StoredEvidence, sequence};

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
    /// Whether more would have gone, had everybody who is given it said that it is safe.
    pub is_held_back: bool,
}

/// How much of an archive that is too large goes at a time: a part in this many.
const PART: u64 = 16;

/// How many positions a step goes over, or as many as the last batch has. Others may write between
/// steps, and a step that is interrupted is as if it had not begun.
const STEP: i64 = 32_768;

/// The last position of each chain before the first batch that was added at a time or later. What
/// was added after something that is to be kept stays, too, whatever the computer's clock showed
/// then.
const OLD: &str = "SELECT id, CASE WHEN kept IS NULL \
    THEN (SELECT max(position) FROM link WHERE chain = id) \
    ELSE (SELECT max(position) FROM link WHERE chain = id AND position < kept) END \
    FROM (SELECT id, (SELECT min(position) FROM link WHERE chain = id AND archived_us >= ?1) AS kept \
    FROM chain) AS chains";

/// The last position of each chain up to a position.
const FIRST: &str = "SELECT id, (SELECT max(position) FROM link \
    WHERE chain = id AND position <= ?1) FROM chain";

impl Archive {
    /// Lets go of what is not to be kept, as of now, in steps that are a transaction each.
    ///
    /// # Errors
    /// If anything cannot be written. What was let go before that is told in the archive.
    /// [`Error::KeepsTooLittle`] before anything is let go, if all entries would have to go.
    pub fn expire(&mut self, keep: Keep, now: Moment<Utc>) -> Result<Expired> {
        if let Some(bytes) = keep.bytes {
            let evidence = self.sql.evidence_size()?;
            if evidence >= bytes {
                let archive = self.name().to_owned();
                return Err(Error::KeepsTooLittle { archive, bytes, evidence });
            }
        }
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

    /// The end of the batch up to which there is about one part of the entries and conflicts.
    fn oldest_part(&mut self) -> Result<Option<i64>> {
        const ENTRIES: &str =
            "SELECT (SELECT count(*) FROM entry) + (SELECT count(*) FROM conflict)";
        const PLACE: &str = "SELECT position FROM (SELECT position FROM entry \
            UNION ALL SELECT position FROM conflict) AS both_tables \
            ORDER BY position LIMIT 1 OFFSET ?1";
        let sql = &mut *self.sql;
        let count = first(sql, ENTRIES, &[], |row| row.int(0))?.unwrap_or(0);
        let place = (count.cast_unsigned() / PART).cast_signed();
        let Some(place) = first(sql, PLACE, &[Value::Int(place)], |row| row.int(0))? else {
            return Ok(None);
        };
        self.end_of_batch(place)
    }

    /// The end of the batch in which a position is, or of the next one.
    fn end_of_batch(&mut self, position: i64) -> Result<Option<i64>> {
        const END: &str = "SELECT min(ends) FROM (SELECT (SELECT min(position) FROM link \
            WHERE chain = id AND position >= ?1) AS ends FROM chain) AS chains";
        let end = first(&mut *self.sql, END, &[Value::Int(position)], |row| row.maybe_int(0))?;
        Ok(end.flatten())
    }

    /// Lets go of what each chain has up to the position that a statement says for a value.
    fn expire_to(&mut self, ends: &'static str, value: i64, now: Moment<Utc>) -> Result<Expired> {
        let mut chains = BTreeMap::new();
        self.sql.query(ends, &[Value::Int(value)], &mut |row| {
            chains.extend(row.maybe_int(1)?.map(|to| Ok((row.int(0)?, to))).transpose()?);
            Ok(())
        })?;
        let is_held_back = self.hold_back(&mut chains)?;
        let last = chains.values().copied().max().unwrap_or(0);
        let (mut expired, mut from) = (Expired { is_held_back, ..Expired::default() }, 0);
        while let Some(through) = self.step_after(&mut from, last)? {
            let range = Range { from, through };
            expired.add(self.in_transaction(|archive| archive.step(&chains, range, now))?);
            from = through;
        }
        Ok(expired)
    }

    /// Ends each chain where all outlets are by now. Returns whether that is before the end of any.
    fn hold_back(&mut self, chains: &mut BTreeMap<i64, i64>) -> Result<bool> {
        const SAFE: &str = "SELECT max(position) FROM link WHERE chain = ?1 AND position <= ?2";
        let Some(safe) = self.safe_elsewhere()? else { return Ok(false) };
        let late: Vec<i64> =
            chains.iter().filter(|(_, to)| **to > safe).map(|(&chain, _)| chain).collect();
        for &chain in &late {
            let values = [chain, safe].map(Value::Int);
            let to = first(&mut *self.sql, SAFE, &values, |row| row.maybe_int(0))?.flatten();
            match to {
                Some(to) => chains.insert(chain, to),
                None => chains.remove(&chain),
            };
        }
        Ok(!late.is_empty())
    }

    /// The end of the step that begins with the first entry after a position, which moves there.
    fn step_after(&mut self, from: &mut i64, last: i64) -> Result<Option<i64>> {
        const BEGIN: &str = "SELECT min(position) FROM \
            (SELECT min(position) AS position FROM entry WHERE position > ?1 \
            UNION ALL SELECT min(position) FROM conflict WHERE position > ?1) AS both_tables";
        let begin = first(&mut *self.sql, BEGIN, &[Value::Int(*from)], |row| row.maybe_int(0))?;
        let Some(begin) = begin.flatten().filter(|begin| *begin <= last) else { return Ok(None) };
        *from = begin.saturating_sub(1);
        let end = self.end_of_batch(begin.saturating_add(STEP - 1))?;
        Ok(Some(end.map_or(last, |end| end.min(last))))
    }

    /// Lets go of what is between two positions, of each chain no more than up to its end.
    fn step(
        &mut self,
        ends: &BTreeMap<i64, i64>,
        range: Range,
        now: Moment<Utc>,
    ) -> Result<Expired> {
        let mut chains = self.old_chains(ends, range)?;
        let mut recorders = read_entries(&mut *self.sql, &mut chains, range)?;
        for (recorder, gone) in &mut recorders {
            gone.join(&mut *self.sql, *recorder, &mut chains)?;
        }
        chains.retain(|_, chain| chain.entries > 0 || chain.is_kept_changed);
        let mut expired = Expired::default();
        for chain in chains.values() {
            expired.entries += chain.entries;
            self.check_point(chain, now)?;
        }
        self.delete_entries(range)?;
        for (recorder, gone) in recorders {
            expired.gaps += self.tell(recorder, gone.gaps(), now)?;
        }
        Ok(expired)
    }

    /// Adds gaps to the first chain of a recorder. All are in one, so that neighbours can be joined
    /// later. Returns how many there are.
    fn tell(&mut self, recorder: i64, records: Vec<Record>, now: Moment<Utc>) -> Result<u64> {
        const FIRST_CHAIN: &str = "SELECT collector, recorder.name FROM chain \
            JOIN recorder ON recorder.id = chain.recorder WHERE recorder.id = ?1 \
            ORDER BY chain.id LIMIT 1";
        let names = first(&mut *self.sql, FIRST_CHAIN, &[Value::Int(recorder)], |row| {
            Ok((row.text(0)?.to_owned(), row.text(1)?.to_owned()))
        })?;
        let (collector, recorder) =
            names.ok_or_else(|| Error::damaged(self.name(), "a recorder has no chain"))?;
        let batch = Batch { collector, recorder, records, bookmark: None, joins: false, at: now };
        Ok(self.append_within(&batch)?.evidence)
    }

    /// The chains that have batches which are old and end no later than a range.
    fn old_chains(
        &mut self,
        ends: &BTreeMap<i64, i64>,
        range: Range,
    ) -> Result<BTreeMap<i64, OldChain>> {
        const CHAIN: &str = "SELECT collector, recorder.name, recorder.id, \
            (SELECT max(position) FROM link WHERE link.chain = ?1 AND position <= ?2) FROM chain \
            JOIN recorder ON recorder.id = chain.recorder WHERE chain.id = ?1";
        let mut chains = BTreeMap::new();
        for (&id, &end) in ends {
            let values = [id, range.through.min(end)].map(Value::Int);
            let before = self.checkpoint(id)?;
            self.sql.query(CHAIN, &values, &mut |row| {
                let Some(to) = row.maybe_int(3)? else { return Ok(()) };
                let (collector, recorder) = (row.text(0)?.to_owned(), row.text(1)?.to_owned());
                let chain = OldChain {
                    id,
                    collector,
                    recorder,
                    recorder_id: row.int(2)?,
                    to,
                    entries: 0,
                    conflicts: 0,
                    before,
                    is_kept_changed: false,
                };
                chains.insert(id, chain);
                Ok(())
            })?;
        }
        Ok(chains)
    }

    /// Takes the links of a chain up to where it is old, and says in a checkpoint where it was.
    fn check_point(&mut self, chain: &OldChain, now: Moment<Utc>) -> Result<()> {
        const AT: &str = "SELECT rows, digest FROM link WHERE chain = ?1 AND position = ?2";
        const LINKS: &str = "DELETE FROM link WHERE chain = ?1 AND position <= ?2";
        // The new checkpoint speaks for those before it.
        const CHECKPOINTS: &str = "DELETE FROM checkpoint WHERE chain = ?1 AND position <= ?2";
        let values = [Value::Int(chain.id), Value::Int(chain.to)];
        let archive = self.sql.name().to_owned();
        let at = first(&mut *self.sql, AT, &values, |row| {
            let digest = Digest::try_from(row.bytes(1)?)
                .map_err(|_| Error::damaged(&archive, "a digest has another length"))?;
            Ok((row.int(0)?, digest))
        })?;
        let (rows, digest) = at.ok_or_else(|| Error::damaged(&archive, "a link is gone"))?;
        let kept = kept_digest(&mut *self.sql, chain)?;
        self.sql.run(LINKS, &values)?;
        self.sql.run(CHECKPOINTS, &values)?;
        let conflicts_before = chain.before.map_or(0, |before| before.conflicts);
        let conflicts = conflicts_before.checked_add(chain.conflicts.cast_signed());
        let checkpoint = Checkpoint {
            to_position: chain.to,
            rows,
            digest,
            kept,
            entries: chain.entries.cast_signed(),
            conflicts: conflicts.ok_or_else(|| Error::damaged(&archive, "it counts too far"))?,
            expired_us: now.us(),
        };
        self.add_checkpoint(&chain.collector, &chain.recorder, &checkpoint)
    }

    /// Deletes what is between two positions and not behind the newest checkpoint of its chain.
    fn delete_entries(&mut self, range: Range) -> Result<()> {
        const ENTRIES: &str = "DELETE FROM entry WHERE position > ?1 AND position <= ?2 \
            AND position <= (SELECT max(to_position) FROM checkpoint \
            WHERE checkpoint.chain = entry.chain)";
        const CONFLICTS: &str = "DELETE FROM conflict WHERE position > ?1 AND position <= ?2 \
            AND position <= (SELECT max(to_position) FROM checkpoint \
            WHERE checkpoint.chain = conflict.chain)";
        let values = [range.from, range.through].map(Value::Int);
        self.sql.run(ENTRIES, &values)?;
        self.sql.run(CONFLICTS, &values).map(|_| ())
    }

    fn add_checkpoint(
        &mut self,
        collector: &str,
        recorder: &str,
        checkpoint: &Checkpoint,
    ) -> Result<()> {
        const ADD: &str = "INSERT INTO checkpoint (position, chain, to_position, rows, digest, \
            kept, entries, conflicts, expired_us) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9)";
        let position = next(self.position()?, self.name())?;
        let mut chain = self.chain(collector, recorder)?;
        // Where all links are gone, the chain goes on from here.
        if chain.rows == 0 {
            (chain.rows, chain.digest) = (checkpoint.rows, checkpoint.digest);
        }
        chain.rows = next(chain.rows, self.name())?;
        chain.digest = Link::Checkpoint(checkpoint).after(&chain.digest);
        let Checkpoint { to_position, rows, digest, kept, entries, conflicts, expired_us } =
            checkpoint;
        let values = [
            Value::Int(position),
            Value::Int(chain.id),
            Value::Int(*to_position),
            Value::Int(*rows),
            Value::from(&digest[..]),
            Value::from(&kept[..]),
            Value::Int(*entries),
            Value::Int(*conflicts),
            Value::Int(*expired_us),
        ];
        self.sql.run(ADD, &values)?;
        self.set_position(position)?;
        chain.note(&mut *self.sql, position, *expired_us)
    }

    /// The newest checkpoint of a chain.
    pub(crate) fn checkpoint(&mut self, chain: i64) -> Result<Option<Checkpoint>> {
        const NEWEST: &str = "SELECT to_position, rows, digest, kept, entries, conflicts, \
            expired_us \
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
                conflicts: row.int(5)?,
                expired_us: row.int(6)?,
            })
        })
    }
}

impl Expired {
    fn add(&mut self, other: Expired) {
        self.entries += other.entries;
        self.gaps += other.gaps;
        self.is_held_back |= other.is_held_back;
    }
}

/// Positions after the first and up to the last.
#[derive(Clone, Copy, Debug)]
struct Range {
    from: i64,
    through: i64,
}

/// A chain of which something is let go.
struct OldChain {
    id: i64,
    collector: String,
    recorder: String,
    recorder_id: i64,
    /// Up to where; there is a link.
    to: i64,
    /// How many entries go, conflicts included, and how many of them are conflicts.
    entries: u64,
    conflicts: u64,
    /// The checkpoint before.
    before: Option<Checkpoint>,
    /// Whether evidence was taken away, so that its digest is to be reckoned anew.
    is_kept_changed: bool,
}

/// The entries of a recorder that are let go, of whatever chain, by life.
#[derive(Default)]
struct Gone(BTreeMap<u64, Numbers>);

impl Gone {
    /// Takes older gaps that touch these numbers, and says them together. Only what lies before the
    /// new checkpoint of a chain may be taken away.
    fn join(
        &mut self,
        sql: &mut dyn Sql,
        recorder: i64,
        chains: &mut BTreeMap<i64, OldChain>,
    ) -> Result<()> {
        for (life, numbers) in &mut self.0 {
            let older = older_gaps(sql, recorder, *life, chains)?;
            let mut all = numbers.clone();
            older.iter().for_each(|gap| all.add(gap.first, gap.last));
            for gap in older {
                let around = all.around(gap.first);
                if around == Some((gap.first, gap.last)) && numbers.count(gap.first, gap.last) == 0
                {
                    continue;
                }
                let (first, last) = around.unwrap_or((gap.first, gap.last));
                numbers.add(first, last);
                gap.delete(sql, chains)?;
            }
        }
        Ok(())
    }

    /// What says that they are gone.
    fn gaps(&self) -> Vec<Record> {
        let mut gaps = Vec::new();
        for (life, numbers) in &self.0 {
            for (mut first, last) in numbers.ranges() {
                while first <= last {
                    let count = u32::try_from(last - first + 1).unwrap_or(u32::MAX);
                    gaps.push(Record::Gap(Gap {
                        life: Life::from_bits(*life),
                        after: Some(first - 1),
                        lost: Lost::Exactly(count),
                        why: Why::Expired,
                    }));
                    first += u64::from(count);
                }
            }
        }
        gaps
    }
}

/// A gap that retention has told, and whose row may go.
struct OlderGap {
    position: i64,
    chain: i64,
    first: u64,
    last: u64,
}

impl OlderGap {
    fn delete(&self, sql: &mut dyn Sql, chains: &mut BTreeMap<i64, OldChain>) -> Result<()> {
        const DELETE: &str = "DELETE FROM evidence WHERE position = ?1";
        sql.run(DELETE, &[Value::Int(self.position)])?;
        if let Some(chain) = chains.get_mut(&self.chain) {
            chain.is_kept_changed = true;
        }
        Ok(())
    }
}

/// The gaps of a life that lie before the new checkpoints.
fn older_gaps(
    sql: &mut dyn Sql,
    recorder: i64,
    life: u64,
    chains: &BTreeMap<i64, OldChain>,
) -> Result<Vec<OlderGap>> {
    const GAPS: &str = "SELECT position, chain, line FROM evidence \
        WHERE kind = 'gap' AND recorder = ?1 AND life = ?2";
    let archive = sql.name().to_owned();
    let mut gaps = Vec::new();
    sql.query(GAPS, &[Value::Int(recorder), Value::Int(life.cast_signed())], &mut |row| {
        let (position, chain) = (row.int(0)?, row.int(1)?);
        if chains.get(&chain).is_none_or(|chain| position > chain.to) {
            return Ok(());
        }
        if let Record::Gap(Gap {
            after: Some(after),
            lost: Lost::Exactly(count @ 1..),
            why: Why::Expired,
            ..
        }) = StoredEvidence::record(row.text(2)?, position, &archive)?
            && let Some(last) = after.checked_add(count.into())
        {
            gaps.push(OlderGap { position, chain, first: after + 1, last });
        }
        Ok(())
    })?;
    Ok(gaps)
}

/// Counts what goes of each chain, and returns the numbers of the entries by recorder.
fn read_entries(
    sql: &mut dyn Sql,
    chains: &mut BTreeMap<i64, OldChain>,
    range: Range,
) -> Result<BTreeMap<i64, Gone>> {
    const ENTRIES: &str = "SELECT position, chain, life, sequence FROM entry \
        WHERE position > ?1 AND position <= ?2";
    const CONFLICTS: &str = "SELECT position, chain FROM conflict \
        WHERE position > ?1 AND position <= ?2";
    let archive = sql.name().to_owned();
    let values = [range.from, range.through].map(Value::Int);
    let mut recorders: BTreeMap<i64, Gone> = BTreeMap::new();
    sql.query(ENTRIES, &values, &mut |row| {
        let position = row.int(0)?;
        let chain = chains.get_mut(&row.int(1)?).filter(|chain| position <= chain.to);
        if let Some(chain) = chain {
            let (life, number) = (row.int(2)?.cast_unsigned(), sequence(row, 3, &archive)?);
            let gone = recorders.entry(chain.recorder_id).or_default();
            gone.0.entry(life).or_default().add(number, number);
            chain.entries += 1;
        }
        Ok(())
    })?;
    sql.query(CONFLICTS, &values, &mut |row| {
        let position = row.int(0)?;
        if let Some(chain) = chains.get_mut(&row.int(1)?).filter(|chain| position <= chain.to) {
            chain.entries += 1;
            chain.conflicts += 1;
        }
        Ok(())
    })?;
    Ok(recorders)
}

/// The digest over the evidence of a chain up to where it is old. It goes on from the one before,
/// unless evidence before that was taken away.
fn kept_digest(sql: &mut dyn Sql, chain: &OldChain) -> Result<Digest> {
    const LINES: &str = "SELECT line FROM evidence WHERE chain = ?1 AND position > ?2 \
        AND position <= ?3 ORDER BY position";
    let before = chain.before.filter(|_| !chain.is_kept_changed);
    let (from, mut kept) =
        before.map_or((0, NOTHING_KEPT), |before| (before.to_position, before.kept));
    sql.query(LINES, &[chain.id, from, chain.to].map(Value::Int), &mut |row| {
        kept = Link::Evidence(row.text(0)?).after(&kept);
        Ok(())
    })?;
    Ok(kept)
}
