//! One log, and several names for its life.
//!
//! A recorder that cannot say which log it has gets a name for each life from whoever reads it. Two
//! collectors draw two names. So a life that a collector brings for the first time is looked for by
//! its content, and where another collector has archived it already, everything is filed there.
//! Which name stands for which is remembered, because later entries alone need not tell.

use std::collections::BTreeMap;

use ser_evidence::record::{EntryRecord, Life, Place, Record};
use ser_evidence::time::{Moment, shown};
use ser_proto::Entry;

use crate::append::Chain;
use crate::archive::{Archive, WRAP};
use crate::batch::Batch;
use crate::error::{Error, Result};
use crate::sql::{Value, first};
use crate::stored::{StoredEntry, stamp_number};

/// The lives that have an entry, and none that a chain has told apart. The order is one that no
/// index has, since the one of all entries by place would be taken for it.
const LIVES: &str = "SELECT life, sequence, position FROM entry \
    WHERE recorder = ?1 AND stamp = ?2 AND shown_us = ?3 AND changed = ?4 \
    AND state = ?5 AND sequence % 65536 = ?6 \
    AND life NOT IN (SELECT joined FROM alias WHERE chain = ?7) \
    ORDER BY life + 0, sequence";
// PostgreSQL uses the index for either form, and for none that says both.
const LIVES_WITHOUT_TIME: &str = "SELECT life, sequence, position FROM entry \
    WHERE recorder = ?1 AND stamp = ?2 AND shown_us IS NULL AND changed = ?3 \
    AND state = ?4 AND sequence % 65536 = ?5 \
    AND life NOT IN (SELECT joined FROM alias WHERE chain = ?6) \
    ORDER BY life + 0, sequence";

/// A life as it is called here, and what is added to the sequences that its collector gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Filed {
    life: Life,
    shift: i64,
}

/// By the name that a collector gives.
#[derive(Debug, Default)]
struct Names(BTreeMap<Life, Filed>);

impl Archive {
    /// The life in which a recorder has had this entry, with the sequence that it has there, given
    /// modulo 65536: where something belongs of which only an entry is known. `None` if none has
    /// it; the lowest name if several have.
    ///
    /// # Errors
    /// If the archive cannot be read.
    pub fn life_of(
        &mut self,
        recorder: &str,
        sequence: u64,
        entry: &Entry,
    ) -> Result<Option<(Life, u64)>> {
        const LIFE: &str = "SELECT life, sequence FROM entry \
            JOIN recorder ON recorder.id = entry.recorder \
            WHERE recorder.name = ?1 AND stamp = ?2 AND shown_us = ?3 AND changed = ?4 \
            AND state = ?5 AND sequence % 65536 = ?6 ORDER BY life + 0, sequence DESC LIMIT 1";
        // PostgreSQL uses the index for either form, and for none that says both.
        const LIFE_WITHOUT_TIME: &str = "SELECT life, sequence FROM entry \
            JOIN recorder ON recorder.id = entry.recorder \
            WHERE recorder.name = ?1 AND stamp = ?2 AND shown_us IS NULL AND changed = ?3 \
            AND state = ?4 AND sequence % 65536 = ?5 ORDER BY life + 0, sequence DESC LIMIT 1";
        let shown_us = shown(&entry.time).map(Moment::us);
        let mut values = vec![Value::from(recorder), Value::Int(stamp_number(&entry.time))];
        values.extend(shown_us.map(Value::Int));
        values.extend([
            Value::Int(entry.changed.0.into()),
            Value::Int(entry.state.0.into()),
            Value::Int((sequence % WRAP).cast_signed()),
        ]);
        let statement = if shown_us.is_some() { LIFE } else { LIFE_WITHOUT_TIME };
        first(&mut *self.sql, statement, &values, |row| {
            Ok((Life::from_bits(row.int(0)?.cast_unsigned()), row.int(1)?.cast_unsigned()))
        })
    }

    /// The records of a batch, with the names and sequences under which their lives are filed here.
    pub(crate) fn joined(&mut self, chain: Chain, batch: &Batch) -> Result<Vec<Record>> {
        let records = &batch.records;
        // A collector that begins with a recorder has not told any life from another yet, even if
        // what it read under this name before was given to this archive.
        let tells_apart = batch.bookmark.is_none() || self.has_bookmark(chain)?;
        let mut names = Names::default();
        for life in lives(records) {
            let of_life = records.iter().filter_map(|record| match record {
                Record::Entry(entry) if entry.life == life => StoredEntry::of(entry),
                _ => None,
            });
            let entries: Vec<StoredEntry> = of_life.collect();
            if let Some(filed) = self.filed(chain, life, &entries, tells_apart)? {
                names.0.insert(life, filed);
            }
        }
        let archive = self.sql.name();
        records.iter().map(|record| names.renamed(record, archive)).collect()
    }

    /// Decides where a life is filed that this collector brings for the first time, by some entries
    /// of it: who gives a whole archive has more to show than what is given first. A life that is
    /// known, or of which there are no entries, stays as it is.
    ///
    /// # Errors
    /// If the archive cannot be read or written.
    pub fn file_life(
        &mut self,
        (collector, recorder): (&str, &str),
        life: Life,
        entries: &[EntryRecord],
    ) -> Result<()> {
        let entries: Vec<StoredEntry> = entries.iter().filter_map(StoredEntry::of).collect();
        self.in_transaction(|archive| {
            let chain = archive.chain(collector, recorder)?;
            archive.filed(chain, life, &entries, true).map(|_| ())
        })
    }

    /// Whether it is decided where a life is filed that this collector brings.
    ///
    /// # Errors
    /// If the archive cannot be read.
    pub fn knows_life(&mut self, (collector, recorder): (&str, &str), life: Life) -> Result<bool> {
        const KNOWN: &str = "SELECT 1 FROM alias JOIN chain ON chain.id = alias.chain \
            JOIN recorder ON recorder.id = chain.recorder \
            WHERE collector = ?1 AND recorder.name = ?2 AND alias.life = ?3";
        let life = Value::Int(life.bits().cast_signed());
        let values = [Value::from(collector), Value::from(recorder), life];
        Ok(first(&mut *self.sql, KNOWN, &values, |_| Ok(()))?.is_some())
    }

    /// The first entry of each life of a recorder's log. Of two readings of one log that have
    /// anything in common, the first entry of one is in the other.
    ///
    /// # Errors
    /// If the archive cannot be read.
    pub fn beginnings(&mut self, recorder: &str) -> Result<Vec<EntryRecord>> {
        let mut beginnings = Vec::new();
        for life in self.lives(recorder)? {
            beginnings.extend(self.beginning(recorder, life)?);
        }
        Ok(beginnings)
    }

    /// The first entry of a life.
    ///
    /// # Errors
    /// If the archive cannot be read.
    pub fn beginning(&mut self, recorder: &str, life: Life) -> Result<Option<EntryRecord>> {
        const FIRST: &str = "SELECT life, sequence, number, stamp, shown_us, changed, state, \
            known FROM entry WHERE recorder = (SELECT id FROM recorder WHERE name = ?1) \
            AND life = ?2 ORDER BY sequence LIMIT 1";
        let values = [Value::from(recorder), Value::Int(life.bits().cast_signed())];
        let archive = self.sql.name().to_owned();
        let found =
            first(&mut *self.sql, FIRST, &values, |row| StoredEntry::from_row(row, 0, &archive))?;
        Ok(found.map(|entry| entry.record()))
    }

    /// The entry of a life that says the same as another one, whose sequence counts modulo 65536.
    ///
    /// # Errors
    /// If the archive cannot be read.
    pub fn same_entry(
        &mut self,
        recorder: &str,
        life: Life,
        other: &EntryRecord,
    ) -> Result<Option<EntryRecord>> {
        const SAME: &str = "SELECT life, sequence, number, stamp, shown_us, changed, state, \
            known FROM entry WHERE recorder = (SELECT id FROM recorder WHERE name = ?1) \
            AND shown_us = ?2 AND life = ?3 ORDER BY life + 0, sequence";
        let Some(shown) = shown(&other.entry.time) else { return Ok(None) };
        let life = Value::Int(life.bits().cast_signed());
        let values = [Value::from(recorder), Value::Int(shown.us()), life];
        let (archive, mut found) = (self.sql.name().to_owned(), None);
        self.sql.query(SAME, &values, &mut |row| {
            let entry = StoredEntry::from_row(row, 0, &archive)?.record();
            let total = |entry: &EntryRecord| entry.sequence.map(|sequence| sequence % WRAP);
            if entry.entry == other.entry && total(&entry) == total(other) {
                found = Some(entry);
            }
            Ok(())
        })?;
        Ok(found)
    }

    fn has_bookmark(&mut self, chain: Chain) -> Result<bool> {
        const BOOKMARK: &str = "SELECT 1 FROM bookmark WHERE chain = ?1";
        Ok(first(&mut *self.sql, BOOKMARK, &[Value::Int(chain.id)], |_| Ok(()))?.is_some())
    }

    /// Where a life is filed; `None` if no entry of it has told yet.
    fn filed(
        &mut self,
        chain: Chain,
        life: Life,
        entries: &[StoredEntry],
        tells_apart: bool,
    ) -> Result<Option<Filed>> {
        const KNOWN: &str = "SELECT joined, shift FROM alias WHERE chain = ?1 AND life = ?2";
        const NOTE: &str = "INSERT INTO alias (chain, life, joined, shift) VALUES (?1, ?2, ?3, ?4)";
        let bits = |life: Life| Value::Int(life.bits().cast_signed());
        let known = first(&mut *self.sql, KNOWN, &[Value::Int(chain.id), bits(life)], |row| {
            Ok(Filed { life: Life::from_bits(row.int(0)?.cast_unsigned()), shift: row.int(1)? })
        })?;
        if known.is_some() {
            return Ok(known);
        }
        if entries.is_empty() {
            return Ok(None);
        }
        let filed = match self.is_filed(chain, life)? {
            true => None,
            false => self.same_elsewhere(chain, entries, tells_apart)?,
        };
        let filed = filed.unwrap_or(Filed { life, shift: 0 });
        let values = [Value::Int(chain.id), bits(life), bits(filed.life), Value::Int(filed.shift)];
        self.sql.run(NOTE, &values)?;
        Ok(Some(filed))
    }

    /// Whether the recorder has entries of a life of this name.
    fn is_filed(&mut self, chain: Chain, life: Life) -> Result<bool> {
        const ANY: &str = "SELECT 1 FROM entry WHERE recorder = ?1 AND life = ?2 LIMIT 1";
        let values = [Value::Int(chain.recorder), Value::Int(life.bits().cast_signed())];
        Ok(first(&mut *self.sql, ANY, &values, |_| Ok(()))?.is_some())
    }

    /// The life that has the most of these entries and contradicts none; of several the one that was
    /// added to last. If lives are told apart, it is none that this collector itself has told from
    /// this one.
    fn same_elsewhere(
        &mut self,
        chain: Chain,
        entries: &[StoredEntry],
        tells_apart: bool,
    ) -> Result<Option<Filed>> {
        let mut found: BTreeMap<Filed, (usize, i64)> = BTreeMap::new();
        for entry in entries {
            for (filed, position) in self.with_entry(chain, entry, tells_apart)? {
                let (count, last) = found.entry(filed).or_default();
                (*count, *last) = (*count + 1, position.max(*last));
            }
        }
        let mut found: Vec<_> = found.into_iter().map(|(filed, most)| (most, filed)).collect();
        found.sort_unstable();
        for (_, filed) in found.into_iter().rev() {
            if self.agrees(chain, filed, entries)? {
                return Ok(Some(filed));
            }
        }
        Ok(None)
    }

    /// The lives that have this entry, and its position there.
    fn with_entry(
        &mut self,
        chain: Chain,
        entry: &StoredEntry,
        tells_apart: bool,
    ) -> Result<Vec<(Filed, i64)>> {
        let StoredEntry { sequence, entry: read, .. } = entry;
        let shown_us = shown(&read.time).map(Moment::us);
        let mut values = vec![Value::Int(chain.recorder), Value::Int(stamp_number(&read.time))];
        values.extend(shown_us.map(Value::Int));
        values.extend([
            Value::Int(read.changed.0.into()),
            Value::Int(read.state.0.into()),
            Value::Int((sequence % WRAP).cast_signed()),
            // No chain has this number.
            Value::Int(if tells_apart { chain.id } else { -1 }),
        ]);
        let statement = if shown_us.is_some() { LIVES } else { LIVES_WITHOUT_TIME };
        let mut found = Vec::new();
        self.sql.query(statement, &values, &mut |row| {
            let life = Life::from_bits(row.int(0)?.cast_unsigned());
            let shift = row.int(1)?.wrapping_sub(sequence.cast_signed());
            found.push((Filed { life, shift }, row.int(2)?));
            Ok(())
        })?;
        Ok(found)
    }

    /// Whether nothing that is filed there contradicts these entries.
    fn agrees(&mut self, chain: Chain, filed: Filed, entries: &[StoredEntry]) -> Result<bool> {
        const ENTRY: &str = "SELECT life, sequence, number, stamp, shown_us, changed, state, \
            known FROM entry WHERE recorder = ?1 AND life = ?2 AND sequence = ?3";
        let archive = self.sql.name().to_owned();
        for entry in entries {
            let Some(sequence) = entry.sequence.checked_add_signed(filed.shift) else {
                return Ok(false);
            };
            let values = [
                Value::Int(chain.recorder),
                Value::Int(filed.life.bits().cast_signed()),
                Value::Int(sequence.cast_signed()),
            ];
            let there = first(&mut *self.sql, ENTRY, &values, |row| {
                StoredEntry::from_row(row, 0, &archive)
            })?;
            if there.is_some_and(|there| !there.is_same(entry)) {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

/// The lives of which these records are, each once.
fn lives(records: &[Record]) -> Vec<Life> {
    let mut lives: Vec<Life> = Vec::new();
    for record in records {
        let life = crate::stored::StoredEvidence::kind_of(record).1;
        if life.is_known() && lives.last() != Some(&life) && !lives.contains(&life) {
            lives.push(life);
        }
    }
    lives
}

impl Names {
    fn renamed(&self, record: &Record, archive: &str) -> Result<Record> {
        let mut record = record.clone();
        match &mut record {
            Record::Entry(entry) => self.place(&mut entry.life, [&mut entry.sequence], archive)?,
            Record::Gap(gap) => self.gap(gap, archive)?,
            Record::Clock(seen) => self.of_place(&mut seen.place, archive)?,
            Record::Step(step) => self.of_place(&mut step.place, archive)?,
            Record::Life(life) => {
                self.place(&mut life.life, [], archive)?;
                if let Some(erased) = &mut life.erased {
                    self.place(erased, [], archive)?;
                }
            }
            Record::Watched(watched) => {
                let mut through = Some(watched.through);
                self.place(&mut watched.life, [&mut through], archive)?;
                watched.through = through.unwrap_or_default();
            }
            Record::Note(note) => {
                let mut sequence = Some(note.sequence);
                self.place(&mut note.life, [&mut sequence], archive)?;
                note.sequence = sequence.unwrap_or_default();
            }
            Record::Suppressed(_)
            | Record::Point(_)
            | Record::Recorder(_)
            | Record::Command(_)
            | Record::Site(_) => {}
        }
        Ok(record)
    }

    /// A gap at the beginning of a log stays there.
    fn gap(&self, gap: &mut ser_evidence::record::Gap, archive: &str) -> Result<()> {
        match gap.after {
            Some(0) => self.place(&mut gap.life, [], archive),
            _ => self.place(&mut gap.life, [&mut gap.after], archive),
        }
    }

    fn of_place(&self, place: &mut Place, archive: &str) -> Result<()> {
        let Place { life, after, before, .. } = place;
        self.place(life, [after, before], archive)
    }

    fn place<const N: usize>(
        &self,
        life: &mut Life,
        sequences: [&mut Option<u64>; N],
        archive: &str,
    ) -> Result<()> {
        let Some(filed) = self.0.get(life) else { return Ok(()) };
        *life = filed.life;
        for sequence in sequences.into_iter().filter_map(Option::as_mut) {
            let moved = sequence.checked_add_signed(filed.shift);
            *sequence = moved.ok_or_else(|| {
                Error::damaged(archive, "two names of one life do not count alike")
            })?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_entry_is_looked_for_by_its_time_and_not_among_all() {
        let connection = rusqlite::Connection::open_in_memory().unwrap();
        connection.execute_batch(include_str!("../migrations/sqlite/0001_first.sql")).unwrap();
        for statement in [LIVES, LIVES_WITHOUT_TIME] {
            let mut plan = connection.prepare(&format!("EXPLAIN QUERY PLAN {statement}")).unwrap();
            let values = rusqlite::params_from_iter(vec![1; plan.parameter_count()]);
            let steps = plan.query_map(values, |row| row.get::<_, String>(3)).unwrap();
            let steps: Vec<String> = steps.map(std::result::Result::unwrap).collect();
            let by = "SEARCH entry USING INDEX entry_by_shown (recorder=? AND shown_us=?)";
            assert!(steps.iter().any(|step| step == by), "{steps:?}");
        }
    }
}
