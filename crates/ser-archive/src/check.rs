//! Whether anything is missing that nobody has told, and what was told.
//!
//! Entries of a life are numbered. A number that is not there is a hole; it is explained by gaps that
//! were told of it, whoever told them, and proves a loss where it is not. What was watched up to an entry must be there up to
//! that entry.

use std::collections::BTreeMap;

use ser_evidence::record::{Gap, Life, LifeRecord, Lost, Record, Watched, Why};

use crate::archive::Archive;
use crate::error::Result;
use crate::numbers::Numbers;
use crate::sql::Value;
use crate::stored::{StoredEvidence, sequence};

/// What is there of all recorders, and what is missing.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Check {
    /// By name.
    pub recorders: Vec<RecorderCheck>,
}

/// What is there of a recorder, and what is missing.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecorderCheck {
    /// Its name.
    pub recorder: String,
    /// How many lives its log has had, of which anything is known.
    pub lives: u64,
    /// Entries that are there.
    pub entries: u64,
    /// Entries that contradict others.
    pub conflicts: u64,
    /// Entries that contradicted others and were let go since.
    pub expired_conflicts: u64,
    /// What is known to be missing, and why.
    pub told: Vec<Gap>,
    /// What is missing without anybody having told.
    pub holes: Vec<Hole>,
    /// From when to when nothing was missed.
    pub watched: Vec<Watched>,
}

/// Entries that must have been there, and of which nothing is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Hole {
    /// The life of the log.
    pub life: Life,
    /// The last entry before it; 0 at the beginning of the log.
    pub after: u64,
    /// How many are missing in all.
    pub missing: u64,
    /// How many of them were told.
    pub told: u64,
}

impl Check {
    /// Whether everything that is missing was told, and nothing contradicts or ever did.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let is_sound = |found: &RecorderCheck| {
            found.holes.is_empty() && found.conflicts == 0 && found.expired_conflicts == 0
        };
        self.recorders.iter().all(is_sound)
    }
}

/// What is known of a life besides its entries.
#[derive(Default)]
struct LifeNotes {
    is_exact: bool,
    /// The numbers that were told to be missing. Another collector may have found some of them.
    told: Numbers,
    /// Where more may be missing than was told: from the place of a gap to where it ends at least.
    open: Numbers,
    /// After which number the first entry was that was let go.
    first_expired: Option<u64>,
    watched_through: u64,
}

impl Archive {
    /// Looks whether anything is missing that nobody has told.
    ///
    /// # Errors
    /// If the archive cannot be read.
    pub fn check(&mut self) -> Result<Check> {
        self.in_snapshot(|archive| {
            let mut check = Check::default();
            for recorder in archive.recorders()? {
                check.recorders.push(archive.check_recorder(recorder)?);
            }
            Ok(check)
        })
    }

    fn check_recorder(&mut self, recorder: String) -> Result<RecorderCheck> {
        let mut found = RecorderCheck { recorder, ..RecorderCheck::default() };
        let mut lives = self.notes(&mut found)?;
        let name = [Value::from(found.recorder.as_str())];
        let mut ends: BTreeMap<Life, u64> = BTreeMap::new();
        const STRETCHES: &str = "SELECT life, sequence, previous FROM (SELECT life, sequence, \
            lag(sequence) OVER (PARTITION BY life ORDER BY sequence) AS previous \
            FROM entry JOIN recorder ON recorder.id = entry.recorder WHERE recorder.name = ?1) \
            AS neighbours WHERE previous IS NULL OR sequence <> previous + 1 \
            ORDER BY life, sequence";
        const ENDS: &str = "SELECT life, max(sequence), count(*) FROM entry \
            JOIN recorder ON recorder.id = entry.recorder WHERE recorder.name = ?1 GROUP BY life";
        const CONFLICTS: &str = "SELECT count(*) FROM conflict \
            JOIN recorder ON recorder.id = conflict.recorder WHERE recorder.name = ?1";
        // The newest checkpoint of a chain counts all.
        const EXPIRED: &str = "SELECT CAST(coalesce(sum(most), 0) AS BIGINT) FROM \
            (SELECT max(conflicts) AS most FROM checkpoint \
            JOIN chain ON chain.id = checkpoint.chain \
            JOIN recorder ON recorder.id = chain.recorder WHERE recorder.name = ?1 \
            GROUP BY chain.id) AS of_chains";
        let archive = self.sql.name().to_owned();
        let mut breaks = Vec::new();
        self.sql.query(STRETCHES, &name, &mut |row| {
            let life = Life::from_bits(row.int(0)?.cast_unsigned());
            breaks.push((life, sequence(row, 1, &archive)?, row.maybe_int(2)?));
            Ok(())
        })?;
        self.sql.query(ENDS, &name, &mut |row| {
            ends.insert(Life::from_bits(row.int(0)?.cast_unsigned()), row.int(1)?.cast_unsigned());
            found.entries += row.int(2)?.cast_unsigned();
            Ok(())
        })?;
        self.sql.query(CONFLICTS, &name, &mut |row| {
            found.conflicts = row.int(0)?.cast_unsigned();
            Ok(())
        })?;
        self.sql.query(EXPIRED, &name, &mut |row| {
            found.expired_conflicts = row.int(0)?.cast_unsigned();
            Ok(())
        })?;
        for life in ends.keys() {
            lives.entry(*life).or_default();
        }
        found.lives = lives.keys().filter(|life| life.is_known()).count() as u64;
        for (life, sequence, previous) in breaks {
            let notes = lives.entry(life).or_default();
            let after = match previous {
                Some(previous) => previous.cast_unsigned(),
                // Nobody knows where a log began whose total had wrapped when it was first seen.
                None if notes.is_exact => 0,
                None => continue,
            };
            found.holes.extend(notes.hole(life, after, sequence - 1));
        }
        for (life, notes) in &lives {
            let end = ends.get(life).copied().unwrap_or_else(|| notes.begin());
            if life.is_known() && notes.watched_through > end {
                found.holes.extend(notes.hole(*life, end, notes.watched_through));
            }
        }
        found.holes.sort_unstable();
        Ok(found)
    }

    /// What is known of the lives of a recorder besides entries.
    fn notes(&mut self, found: &mut RecorderCheck) -> Result<BTreeMap<Life, LifeNotes>> {
        const NOTES: &str = "SELECT position, line FROM evidence \
            JOIN recorder ON recorder.id = evidence.recorder \
            WHERE kind IN ('gap', 'life', 'watched') AND recorder.name = ?1 ORDER BY position";
        let mut lives: BTreeMap<Life, LifeNotes> = BTreeMap::new();
        let archive = self.sql.name().to_owned();
        let name = [Value::from(found.recorder.as_str())];
        self.sql.query(NOTES, &name, &mut |row| {
            match StoredEvidence::record(row.text(1)?, row.int(0)?, &archive)? {
                Record::Gap(gap) => {
                    lives.entry(gap.life).or_default().add(&gap);
                    found.told.push(gap);
                }
                Record::Life(LifeRecord { life, is_exact, .. }) => {
                    lives.entry(life).or_default().is_exact |= is_exact;
                }
                Record::Watched(watched) => {
                    let through = &mut lives.entry(watched.life).or_default().watched_through;
                    *through = watched.through.max(*through);
                    found.watched.push(watched);
                }
                _ => {}
            }
            Ok(())
        })?;
        Ok(lives)
    }
}

impl LifeNotes {
    fn add(&mut self, gap: &Gap) {
        // No log counts so far that this would wrap.
        let Some(after) = gap.after.filter(|after| *after < u64::MAX / 2) else { return };
        let count = match gap.lost {
            Lost::Exactly(count) | Lost::AtLeast(count) => u64::from(count),
            Lost::Unknown => 0,
        };
        if count > 0 {
            self.told.add(after + 1, after + count);
        }
        if !matches!(gap.lost, Lost::Exactly(_)) {
            self.open.add(after, after + count);
        }
        if gap.why == Why::Expired {
            let first = self.first_expired.get_or_insert(after);
            *first = after.min(*first);
        }
    }

    /// After which number a life begins of which no entry is left. Nobody knows how many there were
    /// before the first that was let go, if its total had wrapped when it was first seen.
    fn begin(&self) -> u64 {
        self.first_expired.filter(|_| !self.is_exact).unwrap_or(0)
    }

    /// What is missing after one entry up to another number, unless that was told.
    fn hole(&self, life: Life, after: u64, through: u64) -> Option<Hole> {
        let missing = through.checked_sub(after).filter(|&missing| missing > 0)?;
        let told = self.told.count(after + 1, through);
        let is_told = told == missing || self.open.count(after, through - 1) > 0;
        (!is_told).then_some(Hole { life, after, missing, told })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_told_is_no_hole() {
        let life = Life::from_bits(1);
        let gap = |after, lost| Gap { life, after: Some(after), lost, why: Why::Overwritten };
        let of = |gaps: &[Gap]| {
            let mut notes = LifeNotes::default();
            gaps.iter().for_each(|gap| notes.add(gap));
            notes.hole(life, 10, 20)
        };
        let hole = |told| Some(Hole { life, after: 10, missing: 10, told });
        assert_eq!(of(&[]), hole(0));
        assert_eq!(of(&[gap(10, Lost::Exactly(10))]), None);
        assert_eq!(of(&[gap(10, Lost::Exactly(4)), gap(14, Lost::Exactly(6))]), None);
        assert_eq!(of(&[gap(10, Lost::Exactly(9))]), hole(9));
        // Another collector has found some of what this one has told.
        assert_eq!(of(&[gap(8, Lost::Exactly(13))]), None);
        assert_eq!(of(&[gap(10, Lost::Exactly(6)), gap(14, Lost::Exactly(6))]), None);
        assert_eq!(of(&[gap(14, Lost::Exactly(6)), gap(10, Lost::Exactly(3))]), hole(9));
        assert_eq!(of(&[gap(10, Lost::AtLeast(3))]), None);
        assert_eq!(of(&[gap(10, Lost::Unknown)]), None);
        assert_eq!(of(&[gap(10, Lost::AtLeast(30))]), None);
        assert_eq!(of(&[gap(9, Lost::Exactly(1)), gap(20, Lost::Exactly(10))]), hole(0));
        assert_eq!(of(&[gap(9, Lost::Exactly(3)), gap(20, Lost::Unknown)]), hole(2));
    }
}
