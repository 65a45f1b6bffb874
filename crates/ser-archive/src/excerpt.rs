//! A part of what is kept of a recorder, with which as much can be said of that part as with all.
//!
//! Entries that are left out are no loss, so an excerpt says where it left any out. Where nothing
//! was left out between two entries, what their numbers skip is missing in the archive as well. So
//! an excerpt also has what surrounds it: the entry before and after each stretch of a log, the
//! first and the last entry of each life, and the entries on either side of a window.

use std::collections::BTreeMap;

use ser_evidence::record::{Life, Record};
use ser_evidence::time::Moment;

use crate::archive::Archive;
use crate::error::Result;
use crate::reading::Window;
use crate::sql::{Value, first};
use crate::stored::{StoredEntry, StoredEvidence, sequence};

/// Which entries of a recorder are wanted.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Wanted {
    /// Those that its clock showed to be in one of these windows; also all whose stamp is no time.
    pub windows: Vec<Window>,
    /// Those of these lives.
    pub lives: Vec<Life>,
    /// Those with these sequences, if they are there, and the ones right after them.
    pub places: Vec<(Life, u64)>,
}

/// Entries that were left out: those between two that are there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct LeftOut {
    /// The life of the log.
    pub life: Life,
    /// The sequence of the entry before them.
    pub after: u64,
    /// The sequence of the entry after them.
    pub before: u64,
}

/// The entries of an excerpt, by life and sequence.
type Entries = BTreeMap<(u64, u64), StoredEntry>;

impl Archive {
    /// Gives everything to `on` that a timeline needs to know of a recorder besides entries, in the
    /// order of the archive: neither notes nor versions of the site file.
    ///
    /// # Errors
    /// If the archive cannot be read, or `on` fails.
    pub fn evidence(
        &mut self,
        recorder: &str,
        on: &mut dyn FnMut(&Record) -> Result<()>,
    ) -> Result<()> {
        const EVIDENCE: &str = "SELECT position, line FROM evidence \
            JOIN recorder ON recorder.id = evidence.recorder \
            WHERE recorder.name = ?1 AND kind NOT IN ('note', 'site') ORDER BY position";
        let archive = self.sql.name().to_owned();
        self.sql.query(EVIDENCE, &[Value::from(recorder)], &mut |row| {
            on(&StoredEvidence::record(row.text(1)?, row.int(0)?, &archive)?)
        })
    }

    /// Gives all records of one kind to `on`, with the names of their recorders, in the order of
    /// the archive. A kind is what `record` in a line of JSON says; entries are none.
    ///
    /// # Errors
    /// If the archive cannot be read, or `on` fails.
    pub fn of_kind(
        &mut self,
        kind: &str,
        on: &mut dyn FnMut(&str, Record) -> Result<()>,
    ) -> Result<()> {
        const OF_KIND: &str = "SELECT position, line, recorder.name FROM evidence \
            JOIN recorder ON recorder.id = evidence.recorder WHERE kind = ?1 ORDER BY position";
        let archive = self.sql.name().to_owned();
        self.sql.query(OF_KIND, &[Value::from(kind)], &mut |row| {
            on(row.text(2)?, StoredEvidence::record(row.text(1)?, row.int(0)?, &archive)?)
        })
    }

    /// Gives the entries of a recorder that are wanted, and what surrounds them, to `on`, with all
    /// entries that contradict each other. Returns where entries were left out.
    ///
    /// # Errors
    /// If the archive cannot be read, or `on` fails.
    pub fn excerpt(
        &mut self,
        recorder: &str,
        wanted: &Wanted,
        on: &mut dyn FnMut(&Record) -> Result<()>,
    ) -> Result<Vec<LeftOut>> {
        self.in_snapshot(|archive| {
            const RECORDER: &str = "SELECT id FROM recorder WHERE name = ?1";
            let name = [Value::from(recorder)];
            let Some(id) = first(&mut *archive.sql, RECORDER, &name, |row| row.int(0))? else {
                return Ok(Vec::new());
            };
            let mut excerpt = Excerpt { archive, recorder: id, entries: Entries::new() };
            excerpt.add_wanted(wanted)?;
            excerpt.add_ends()?;
            let conflicts = excerpt.add_conflicts()?;
            let left_out = excerpt.add_neighbours()?;
            for entry in excerpt.entries.values().chain(&conflicts) {
                on(&Record::Entry(entry.record()))?;
            }
            Ok(left_out)
        })
    }

    /// The lives of a recorder's log of which there are entries.
    ///
    /// # Errors
    /// If the archive cannot be read.
    pub fn lives(&mut self, recorder: &str) -> Result<Vec<Life>> {
        const LIVES: &str = "WITH RECURSIVE own (id) AS (\
            SELECT id FROM recorder WHERE name = ?1), lives (life) AS (\
            SELECT min(life) FROM entry WHERE recorder = (SELECT id FROM own) UNION ALL \
            SELECT (SELECT min(entry.life) FROM entry \
            WHERE recorder = (SELECT id FROM own) AND entry.life > lives.life) \
            FROM lives WHERE lives.life IS NOT NULL) \
            SELECT life FROM lives WHERE life IS NOT NULL";
        let mut lives = Vec::new();
        self.sql.query(LIVES, &[Value::from(recorder)], &mut |row| {
            lives.push(Life::from_bits(row.int(0)?.cast_unsigned()));
            Ok(())
        })?;
        Ok(lives)
    }

    /// The last entries of a recorder in which one of these inputs (bit 0 is input 1) went on, or
    /// may have: the last one by what its clock showed, and of each life the last one that was
    /// added after that.
    ///
    /// # Errors
    /// If the archive cannot be read.
    pub fn last_on(&mut self, recorder: &str, inputs: u32) -> Result<Vec<(Life, u64)>> {
        const LAST: &str = "SELECT position, life, sequence FROM entry \
            WHERE recorder = (SELECT id FROM recorder WHERE name = ?1) \
            AND shown_us IS NOT NULL AND (changed & ?2 & (state | ~known)) <> 0 \
            ORDER BY shown_us DESC LIMIT 1";
        const LATER: &str = "SELECT life, max(sequence) FROM entry \
            WHERE position > ?3 AND recorder = (SELECT id FROM recorder WHERE name = ?1) \
            AND (changed & ?2 & (state | ~known)) <> 0 GROUP BY life";
        let life_at = |bits: i64| Life::from_bits(bits.cast_unsigned());
        self.in_snapshot(|archive| {
            let name = archive.sql.name().to_owned();
            let mut values = vec![Value::from(recorder), Value::Int(inputs.into())];
            let last = first(&mut *archive.sql, LAST, &values, |row| {
                Ok((row.int(0)?, life_at(row.int(1)?), sequence(row, 2, &name)?))
            })?;
            let mut found: Vec<(Life, u64)> =
                last.iter().map(|(_, life, sequence)| (*life, *sequence)).collect();
            values.push(Value::Int(last.map_or(0, |(position, ..)| position)));
            archive.sql.query(LATER, &values, &mut |row| {
                found.push((life_at(row.int(0)?), sequence(row, 1, &name)?));
                Ok(())
            })?;
            Ok(found)
        })
    }
}

/// An excerpt while it is made.
struct Excerpt<'a> {
    archive: &'a mut Archive,
    recorder: i64,
    entries: Entries,
}

impl Excerpt<'_> {
    /// Adds the entries that a statement finds, whose columns are those of the table from `life`
    /// on.
    fn add(&mut self, statement: &'static str, values: &[i64]) -> Result<()> {
        let name = self.archive.sql.name().to_owned();
        let values: Vec<Value> =
            [self.recorder].iter().chain(values).map(|&value| Value::Int(value)).collect();
        let entries = &mut self.entries;
        self.archive.sql.query(statement, &values, &mut |row| {
            let entry = StoredEntry::from_row(row, 0, &name)?;
            entries.insert((entry.life.bits(), entry.sequence), entry);
            Ok(())
        })
    }

    fn add_wanted(&mut self, wanted: &Wanted) -> Result<()> {
        const WITHOUT_TIME: &str = "SELECT life, sequence, number, stamp, shown_us, changed, state, \
            known FROM entry WHERE recorder = ?1 AND shown_us IS NULL";
        const IN_WINDOW: &str = "SELECT life, sequence, number, stamp, shown_us, changed, state, \
            known FROM entry WHERE recorder = ?1 AND shown_us BETWEEN ?2 AND ?3";
        const BEFORE: &str = "SELECT life, sequence, number, stamp, shown_us, changed, state, \
            known FROM entry WHERE recorder = ?1 AND shown_us < ?2 \
            ORDER BY shown_us DESC LIMIT 1";
        const AFTER: &str = "SELECT life, sequence, number, stamp, shown_us, changed, state, \
            known FROM entry WHERE recorder = ?1 AND shown_us > ?2 ORDER BY shown_us LIMIT 1";
        const OF_LIFE: &str = "SELECT life, sequence, number, stamp, shown_us, changed, state, \
            known FROM entry WHERE recorder = ?1 AND life = ?2";
        const PLACE: &str = "SELECT life, sequence, number, stamp, shown_us, changed, state, \
            known FROM entry WHERE recorder = ?1 AND life = ?2 AND sequence >= ?3 \
            ORDER BY sequence LIMIT 2";
        self.add(WITHOUT_TIME, &[])?;
        for window in &wanted.windows {
            let from = window.from.map_or(i64::MIN, Moment::us);
            let until = window.until.map_or(i64::MAX, Moment::us);
            self.add(IN_WINDOW, &[from, until])?;
            self.add(BEFORE, &[from])?;
            self.add(AFTER, &[until])?;
        }
        for life in &wanted.lives {
            self.add(OF_LIFE, &[life.bits().cast_signed()])?;
        }
        for (life, sequence) in &wanted.places {
            self.add(PLACE, &[life.bits().cast_signed(), sequence.cast_signed()])?;
        }
        Ok(())
    }

    /// Adds the first and the last entry of each life.
    fn add_ends(&mut self) -> Result<()> {
        // A database that is asked for all lives at once would look at every entry.
        const ENDS: &str = "WITH RECURSIVE lives (life) AS (\
            SELECT min(life) FROM entry WHERE recorder = ?1 UNION ALL \
            SELECT (SELECT min(entry.life) FROM entry \
            WHERE recorder = ?1 AND entry.life > lives.life) \
            FROM lives WHERE lives.life IS NOT NULL) \
            SELECT life, \
            (SELECT min(sequence) FROM entry WHERE recorder = ?1 AND entry.life = lives.life), \
            (SELECT max(sequence) FROM entry WHERE recorder = ?1 AND entry.life = lives.life) \
            FROM lives WHERE life IS NOT NULL";
        let mut ends = Vec::new();
        self.archive.sql.query(ENDS, &[Value::Int(self.recorder)], &mut |row| {
            ends.push((row.int(0)?, row.int(1)?));
            ends.push((row.int(0)?, row.int(2)?));
            Ok(())
        })?;
        ends.iter().try_for_each(|&(life, sequence)| self.add_at(life, sequence))
    }

    fn add_at(&mut self, life: i64, sequence: i64) -> Result<()> {
        const AT: &str = "SELECT life, sequence, number, stamp, shown_us, changed, state, known \
            FROM entry WHERE recorder = ?1 AND life = ?2 AND sequence = ?3";
        self.add(AT, &[life, sequence])
    }

    /// Adds the entries that others contradict, and returns those.
    fn add_conflicts(&mut self) -> Result<Vec<StoredEntry>> {
        const CONFLICTS: &str = "SELECT life, sequence, number, stamp, shown_us, changed, state, \
            known FROM conflict WHERE recorder = ?1 ORDER BY life, sequence, position";
        let name = self.archive.sql.name().to_owned();
        let mut conflicts = Vec::new();
        self.archive.sql.query(CONFLICTS, &[Value::Int(self.recorder)], &mut |row| {
            conflicts.push(StoredEntry::from_row(row, 0, &name)?);
            Ok(())
        })?;
        for conflict in &conflicts {
            let (life, sequence) = (conflict.life.bits(), conflict.sequence);
            self.add_at(life.cast_signed(), sequence.cast_signed())?;
        }
        Ok(conflicts)
    }

    /// Adds the entries next to those that are there, and returns where any are left out.
    fn add_neighbours(&mut self) -> Result<Vec<LeftOut>> {
        let places: Vec<(u64, u64)> = self.entries.keys().copied().collect();
        let mut left_out = Vec::new();
        for (&(life, one), &(next_life, next)) in places.iter().zip(places.iter().skip(1)) {
            if life != next_life || next == one + 1 {
                continue;
            }
            let (after, before) = self.between(life, (one, next))?;
            if after == next {
                continue;
            }
            self.add_at(life.cast_signed(), after.cast_signed())?;
            self.add_at(life.cast_signed(), before.cast_signed())?;
            if before > after + 1 {
                left_out.push(LeftOut { life: Life::from_bits(life), after, before });
            }
        }
        Ok(left_out)
    }

    /// The first and the last entry between two; the second and the first of these if there is
    /// none.
    fn between(&mut self, life: u64, (one, next): (u64, u64)) -> Result<(u64, u64)> {
        const AFTER: &str = "SELECT min(sequence) FROM entry \
            WHERE recorder = ?1 AND life = ?2 AND sequence > ?3";
        const BEFORE: &str = "SELECT max(sequence) FROM entry \
            WHERE recorder = ?1 AND life = ?2 AND sequence < ?3";
        let name = self.archive.sql.name().to_owned();
        let recorder = self.recorder;
        let mut at = |statement, from: u64| {
            let values = [recorder, life.cast_signed(), from.cast_signed()].map(Value::Int);
            first(&mut *self.archive.sql, statement, &values, |row| sequence(row, 0, &name))
        };
        Ok((at(AFTER, one)?.unwrap_or(next), at(BEFORE, next)?.unwrap_or(one)))
    }
}
