//! Adding what was read: all of a batch with its bookmark, or nothing.

use std::collections::BTreeMap;

use ser_evidence::record::Record;

use crate::archive::Archive;
use crate::batch::{Appended, Batch, Bookmark};
use crate::chain::{self, Digest, Link};
use crate::error::{Error, Result};
use crate::sql::{Sql, Value, first};
use crate::stored::{StoredEntry, StoredEvidence, stamp_number};

impl Archive {
    /// Adds what was read, in one transaction. Records that are there already change nothing, and
    /// an entry that contradicts one is kept beside it. Returns what has come of each batch.
    ///
    /// # Errors
    /// If anything cannot be written, nothing is. [`Error::NoPlace`] for an entry whose life or
    /// sequence is not known.
    pub fn append(&mut self, batches: &[Batch]) -> Result<Vec<Appended>> {
        self.in_transaction(|archive| {
            let mut position = archive.position()?;
            let mut appended = Vec::with_capacity(batches.len());
            for batch in batches {
                let of_batch = archive.append_one(batch, position)?;
                position = of_batch.position;
                appended.push(of_batch);
            }
            archive.set_position(position)?;
            Ok(appended)
        })
    }

    /// Adds one batch in a transaction of its own.
    pub(crate) fn append_alone(&mut self, batch: &Batch) -> Result<Appended> {
        self.in_transaction(|archive| archive.append_within(batch))
    }

    /// Adds one batch within a transaction.
    pub(crate) fn append_within(&mut self, batch: &Batch) -> Result<Appended> {
        let position = self.position()?;
        let appended = self.append_one(batch, position)?;
        self.set_position(appended.position)?;
        Ok(appended)
    }

    pub(crate) fn set_position(&mut self, position: i64) -> Result<()> {
        const POSITION: &str = "UPDATE archive SET position = ?1";
        self.sql.run(POSITION, &[Value::Int(position)]).map(|_| ())
    }

    /// Adds a batch behind a position.
    fn append_one(&mut self, batch: &Batch, position: i64) -> Result<Appended> {
        let chain = self.chain(&batch.collector, &batch.recorder)?;
        let joined = batch.joins.then(|| self.joined(chain, batch)).transpose()?;
        let records = joined.as_ref().unwrap_or(&batch.records);
        let before = Before::find(&mut *self.sql, chain, records, &batch.recorder)?;
        let mut rows = NewRows::new(chain, position);
        for record in records {
            let archive = self.sql.name();
            match record {
                Record::Entry(entry) => {
                    let entry = placed(entry, &batch.recorder)?;
                    rows.entry(&before, entry, archive)?;
                }
                record => {
                    let stored = StoredEvidence::of(&batch.recorder, record, archive)?;
                    rows.evidence(&mut *self.sql, &stored)?;
                }
            }
        }
        let appended = rows.write(&mut *self.sql, batch.at.us())?;
        if let Some(bookmark) = &batch.bookmark {
            self.set_bookmark(chain.id, bookmark)?;
        }
        Ok(appended)
    }

    /// The chain of a collector and a recorder, which is made if it is not there.
    pub(crate) fn chain(&mut self, collector: &str, recorder: &str) -> Result<Chain> {
        const NAME: &str = "INSERT INTO recorder (name) VALUES (?1) ON CONFLICT (name) DO NOTHING";
        const RECORDER: &str = "SELECT id FROM recorder WHERE name = ?1";
        const MAKE: &str = "INSERT INTO chain (collector, recorder) VALUES (?1, ?2) \
            ON CONFLICT (collector, recorder) DO NOTHING";
        const CHAIN: &str = "SELECT id FROM chain WHERE collector = ?1 AND recorder = ?2";
        const LAST: &str = "SELECT digest, rows FROM link WHERE chain = ?1 \
            ORDER BY position DESC LIMIT 1";
        let sql = &mut *self.sql;
        let name = [Value::from(recorder)];
        sql.run(NAME, &name)?;
        let recorder_id = id(sql, RECORDER, &name)?;
        let pair = [Value::from(collector), Value::Int(recorder_id)];
        sql.run(MAKE, &pair)?;
        let id = id(sql, CHAIN, &pair)?;
        let archive = sql.name().to_owned();
        let last = first(sql, LAST, &[Value::Int(id)], |row| {
            let digest = Digest::try_from(row.bytes(0)?)
                .map_err(|_| Error::damaged(&archive, "a digest has another length"))?;
            Ok((digest, row.int(1)?))
        })?;
        let (digest, rows) = last.unwrap_or_else(|| (chain::begin(collector, recorder), 0));
        Ok(Chain { id, recorder: recorder_id, digest, rows })
    }

    fn set_bookmark(&mut self, chain: i64, bookmark: &Bookmark) -> Result<()> {
        const SET: &str = "INSERT INTO bookmark \
            (chain, life, sequence, exact, log_size, stamp, changed, state, log) \
            VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9) ON CONFLICT (chain) DO UPDATE SET \
            life = excluded.life, sequence = excluded.sequence, exact = excluded.exact, \
            log_size = excluded.log_size, stamp = excluded.stamp, changed = excluded.changed, \
            state = excluded.state, log = excluded.log";
        let Bookmark { life, sequence, is_exact, anchor, log_size, log } = bookmark;
        let of_anchor = |mask: fn(&ser_proto::Entry) -> i64| Value::from(anchor.as_ref().map(mask));
        let values = [
            Value::Int(chain),
            Value::Int(life.bits().cast_signed()),
            Value::Int(sequence.cast_signed()),
            Value::Int((*is_exact).into()),
            Value::from(log_size.map(i64::from)),
            of_anchor(|entry| stamp_number(&entry.time)),
            of_anchor(|entry| entry.changed.0.into()),
            of_anchor(|entry| entry.state.0.into()),
            Value::from(log.as_ref().map_or(&[][..], |log| &log[..])),
        ];
        self.sql.run(SET, &values).map(|_| ())
    }
}

/// A chain, and how far it is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Chain {
    pub(crate) id: i64,
    pub(crate) recorder: i64,
    pub(crate) digest: Digest,
    pub(crate) rows: i64,
}

impl Chain {
    /// Notes where the chain is after the row at this position.
    pub(crate) fn note(&self, sql: &mut dyn Sql, position: i64, archived_us: i64) -> Result<()> {
        const LINK: &str = "INSERT INTO link (chain, position, rows, archived_us, digest) \
            VALUES (?1, ?2, ?3, ?4, ?5)";
        let numbers = [self.id, position, self.rows, archived_us].map(Value::Int);
        let values: Vec<Value> =
            numbers.into_iter().chain([Value::from(&self.digest[..])]).collect();
        sql.run(LINK, &values).map(|_| ())
    }
}

/// The next position or number of rows. No archive ever comes to the last one.
pub(crate) fn next(number: i64, archive: &str) -> Result<i64> {
    number.checked_add(1).ok_or_else(|| Error::damaged(archive, "it counts too far"))
}

fn id(sql: &mut dyn Sql, statement: &'static str, values: &[Value]) -> Result<i64> {
    let found = first(sql, statement, values, |row| row.int(0))?;
    found.ok_or_else(|| Error::damaged(sql.name(), "a name that was just added is not there"))
}

fn placed(entry: &ser_evidence::record::EntryRecord, recorder: &str) -> Result<StoredEntry> {
    StoredEntry::of(entry).ok_or_else(|| Error::NoPlace { recorder: recorder.to_owned() })
}

/// By place, the entry that is there and everything that contradicts it.
type ByPlace = BTreeMap<(u64, u64), Vec<StoredEntry>>;

/// What is there already at the places of a batch.
struct Before(ByPlace);

impl Before {
    fn find(sql: &mut dyn Sql, chain: Chain, records: &[Record], recorder: &str) -> Result<Before> {
        const ENTRIES: &str = "SELECT life, sequence, number, stamp, shown_us, changed, state, \
            known FROM entry WHERE recorder = ?1 AND life = ?2 AND sequence BETWEEN ?3 AND ?4";
        const CONFLICTS: &str = "SELECT life, sequence, number, stamp, shown_us, changed, state, \
            known FROM conflict WHERE recorder = ?1 AND life = ?2 AND sequence BETWEEN ?3 AND ?4";
        let mut places = Vec::new();
        for record in records {
            if let Record::Entry(entry) = record {
                let entry = placed(entry, recorder)?;
                places.push((entry.life.bits(), entry.sequence));
            }
        }
        let mut found = ByPlace::new();
        let archive = sql.name().to_owned();
        for (life, first, last) in stretches(places) {
            let of = |bits: u64| Value::Int(bits.cast_signed());
            let values = [Value::Int(chain.recorder), of(life), of(first), of(last)];
            for statement in [ENTRIES, CONFLICTS] {
                sql.query(statement, &values, &mut |row| {
                    let entry = StoredEntry::from_row(row, 0, &archive)?;
                    let place = (entry.life.bits(), entry.sequence);
                    found.entry(place).or_default().push(entry);
                    Ok(())
                })?;
            }
        }
        Ok(Before(found))
    }
}

/// Places as stretches of neighbours: life, first and last sequence.
fn stretches(mut places: Vec<(u64, u64)>) -> Vec<(u64, u64, u64)> {
    places.sort_unstable();
    let mut stretches: Vec<(u64, u64, u64)> = Vec::new();
    for (life, sequence) in places {
        match stretches.last_mut() {
            Some((of, _, last)) if *of == life && sequence <= last.saturating_add(1) => {
                *last = sequence;
            }
            _ => stretches.push((life, sequence, sequence)),
        }
    }
    stretches
}

/// The rows that a batch adds.
struct NewRows {
    chain: Chain,
    position: i64,
    entries: Vec<Vec<Value>>,
    conflicts: Vec<Vec<Value>>,
    evidence: Vec<Vec<Value>>,
    known: u64,
    /// What this batch itself has at each place.
    added: ByPlace,
    lines: std::collections::BTreeSet<Digest>,
}

impl NewRows {
    fn new(chain: Chain, position: i64) -> NewRows {
        NewRows {
            chain,
            position,
            entries: Vec::new(),
            conflicts: Vec::new(),
            evidence: Vec::new(),
            known: 0,
            added: ByPlace::new(),
            lines: std::collections::BTreeSet::new(),
        }
    }

    fn entry(&mut self, before: &Before, entry: StoredEntry, archive: &str) -> Result<()> {
        let place = (entry.life.bits(), entry.sequence);
        let there = before.0.get(&place).into_iter().flatten();
        let mut there = there.chain(self.added.get(&place).into_iter().flatten()).peekable();
        let is_first = there.peek().is_none();
        if there.any(|there| there.is_same(&entry)) {
            self.known += 1;
            return Ok(());
        }
        self.added.entry(place).or_default().push(entry);
        let link = if is_first { Link::Entry(&entry) } else { Link::Conflict(&entry) };
        let row = self.row(link, entry.columns(), archive)?;
        if is_first {
            self.entries.push(row);
        } else {
            self.conflicts.push(row);
        }
        Ok(())
    }

    fn evidence(&mut self, sql: &mut dyn Sql, stored: &StoredEvidence) -> Result<()> {
        const KNOWN: &str = "SELECT position FROM evidence WHERE recorder = ?1 AND content = ?2";
        let content = chain::content(&stored.line);
        let values = [Value::Int(self.chain.recorder), Value::from(&content[..])];
        let is_there = first(sql, KNOWN, &values, |row| row.int(0))?.is_some();
        if is_there || !self.lines.insert(content) {
            self.known += 1;
            return Ok(());
        }
        let StoredEvidence { kind, life, line } = stored;
        let life = Value::Int(life.bits().cast_signed());
        let of_row =
            [Value::from(*kind), life, Value::from(line.as_str()), Value::from(&content[..])];
        let row = self.row(Link::Evidence(line), of_row, sql.name())?;
        self.evidence.push(row);
        Ok(())
    }

    /// The next row of the chain: position, chain, recorder, and what is its own.
    fn row<const N: usize>(
        &mut self,
        link: Link<'_>,
        own: [Value; N],
        archive: &str,
    ) -> Result<Vec<Value>> {
        self.position = next(self.position, archive)?;
        self.chain.rows = next(self.chain.rows, archive)?;
        self.chain.digest = link.after(&self.chain.digest);
        let of_all = [self.position, self.chain.id, self.chain.recorder].map(Value::Int);
        Ok(of_all.into_iter().chain(own).collect())
    }

    fn write(self, sql: &mut dyn Sql, archived_us: i64) -> Result<Appended> {
        const ENTRY: &str = "INSERT INTO entry (position, chain, recorder, life, sequence, number, \
            stamp, shown_us, changed, state, known) \
            VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11)";
        const CONFLICT: &str = "INSERT INTO conflict (position, chain, recorder, life, sequence, \
            number, stamp, shown_us, changed, state, known) \
            VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11)";
        const EVIDENCE: &str = "INSERT INTO evidence (position, chain, recorder, kind, life, line, \
            content) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)";
        let count = |rows: &[Vec<Value>]| rows.len() as u64;
        let appended = Appended {
            position: self.position,
            entries: count(&self.entries),
            conflicts: count(&self.conflicts),
            evidence: count(&self.evidence),
            known: self.known,
        };
        sql.run_each(ENTRY, &self.entries)?;
        sql.run_each(CONFLICT, &self.conflicts)?;
        sql.run_each(EVIDENCE, &self.evidence)?;
        if appended.entries + appended.conflicts + appended.evidence > 0 {
            self.chain.note(sql, self.position, archived_us)?;
        }
        Ok(appended)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_are_looked_for_at_once() {
        let places = vec![(1, 7), (1, 5), (2, 8), (1, 6), (1, 6), (1, 9), (2, u64::MAX)];
        let expected = [(1, 5, 7), (1, 9, 9), (2, 8, 8), (2, u64::MAX, u64::MAX)];
        assert_eq!(stretches(places), expected);
    }
}
