//! What readings prove beyond the entries themselves: what the recorder's clock showed meanwhile, and
//! for which time nothing is missing.
//!
//! An entry that was not in the log at one look, and is there at the next, was recorded in between.
//! So the recorder's clock showed its stamp in between, too. That tells far less than setting the
//! clock does, and it works with a clock that nobody may set.

use std::time::Duration;

use ser_client::Cursor;
use ser_evidence::record::{ClockObservation, HostReading, Life, LifeRecord, Record, Watched};
use ser_evidence::time::{Host, Moment};
use ser_observer::{host_reading, seen_at};
use ser_proto::Model;

use crate::delivery::{NewEntries, Outlet};
use crate::error::Result;
use crate::kept::KeptRecords;

/// How often entries are taken for observations of the clock.
const OBSERVE_EVERY_US: i64 = 60_000_000;

/// How often a reading without end says that nothing is missing so far.
const VOUCH_EVERY_US: i64 = 60_000_000;

/// Watches over the readings of a log.
pub(crate) struct Witness {
    kept: Option<KeptRecords>,
    began: HostReading,
    /// When the log was last known to hold nothing that had not been delivered.
    complete_at: Option<Moment<Host>>,
    /// The newest entry then.
    through: Option<(Life, u64)>,
    model: Option<Model>,
    /// Which life went before one that was begun by command.
    erased: Vec<(Life, Life)>,
    /// What was last told of the life.
    life_told: Option<LifeRecord>,
    /// What was last kept of a life.
    life_kept: Option<LifeRecord>,
    observed_at: Option<Moment<Host>>,
    vouched_at: Moment<Host>,
    unkept: Vec<Record>,
}

impl Witness {
    /// Begins now. `kept` is what earlier runs have left, if this one remembers; `before` is how far
    /// they had read. What is seen may be as old as `delay` says.
    pub(crate) fn begin(
        kept: Option<KeptRecords>,
        before: Option<(Life, Cursor)>,
        delay: Duration,
    ) -> Witness {
        let now = host_reading::now();
        let delay_us = i64::try_from(delay.as_micros()).unwrap_or(i64::MAX);
        let began = HostReading {
            monotonic: now.monotonic.after(-delay_us),
            utc: now.utc.after(-delay_us),
            ..now
        };
        let records = kept.as_ref().map(KeptRecords::load).unwrap_or_default();
        let life_kept = records.iter().rev().find_map(life);
        Witness {
            kept,
            began,
            complete_at: last_look(&records, &now, before),
            through: None,
            model: life_kept.and_then(|life| life.model),
            erased: records.iter().filter_map(erased).collect(),
            life_told: None,
            life_kept,
            observed_at: None,
            vouched_at: began.monotonic,
            unkept: Vec::new(),
        }
    }

    /// Whether what it says is written or kept.
    pub(crate) fn is_wanted(&self, outlet: &Outlet) -> bool {
        self.kept.is_some() || outlet.holds_evidence()
    }

    /// Takes note of a reading, or a part of one, that has just ended. `complete_at` is by when the
    /// log is known to have held nothing else.
    pub(crate) fn read(
        &mut self,
        outlet: &mut Outlet,
        cursor: Option<Cursor>,
        size: u16,
        complete_at: Option<Duration>,
    ) -> Result<()> {
        let new = outlet.take_new();
        self.model = new.model.or(self.model);
        self.observe(&new, outlet)?;
        let Some(cursor) = cursor else { return Ok(()) };
        self.tell_life(cursor, size, outlet)?;
        if let Some(complete_at) = complete_at {
            self.complete_at = Some(host_reading::moment(complete_at));
            self.through = Some((outlet.life(), cursor.sequence));
        }
        Ok(())
    }

    /// Takes note of what the clock showed when it was asked.
    pub(crate) fn asked(
        &mut self,
        outlet: &mut Outlet,
        observation: ClockObservation,
    ) -> Result<()> {
        self.tell(Record::Clock(observation), outlet)
    }

    /// Says now and then that nothing is missing so far; returns whether it was said.
    pub(crate) fn vouch_if_due(&mut self, outlet: &mut Outlet) -> Result<bool> {
        let is_due = |now: Moment<Host>| now.since(self.vouched_at) >= VOUCH_EVERY_US;
        let is_due = self.complete_at.is_some_and(is_due);
        if is_due {
            self.vouch(outlet)?;
        }
        Ok(is_due)
    }

    /// Says for which time nothing is missing.
    pub(crate) fn vouch(&mut self, outlet: &mut Outlet) -> Result<()> {
        let (Some(complete_at), Some((life, through))) = (self.complete_at, self.through) else {
            return Ok(());
        };
        self.vouched_at = complete_at;
        let us = u64::try_from(complete_at.us()).unwrap_or_default();
        let to = host_reading::at(Duration::from_micros(us));
        let watched = Watched { life, from: self.began, to, through };
        self.tell(Record::Watched(watched), outlet)
    }

    /// Keeps what was told since the last time.
    pub(crate) fn keep(&mut self) {
        let records = std::mem::take(&mut self.unkept);
        if let Some(kept) = &self.kept {
            kept.add(&records);
        }
    }

    fn tell(&mut self, record: Record, outlet: &mut Outlet) -> Result<()> {
        outlet.evidence(&record)?;
        self.unkept.push(record);
        Ok(())
    }

    /// The first and the last entry of a reading bound the clock as well as all of them do.
    fn observe(&mut self, new: &NewEntries, outlet: &mut Outlet) -> Result<()> {
        let Some(complete_at) = self.complete_at else { return Ok(()) };
        let is_recent =
            |at: Moment<Host>| host_reading::now().monotonic.since(at) < OBSERVE_EVERY_US;
        if self.observed_at.is_some_and(is_recent) {
            return Ok(());
        }
        let last = new.last.filter(|last| new.first != Some(*last));
        for arrived in new.first.into_iter().chain(last) {
            let Some(observation) = seen_at(&arrived.record, complete_at, arrived.at) else {
                continue;
            };
            self.observed_at = Some(host_reading::moment(arrived.at));
            self.tell(Record::Clock(observation), outlet)?;
        }
        Ok(())
    }

    fn tell_life(&mut self, cursor: Cursor, size: u16, outlet: &mut Outlet) -> Result<()> {
        let life = outlet.life();
        let before = self.erased.iter().rev().find(|(next, _)| *next == life);
        let record = LifeRecord {
            life,
            is_exact: cursor.is_exact,
            model: self.model,
            size: Some(size),
            erased: before.map(|&(_, before)| before),
        };
        if self.life_told != Some(record) {
            self.life_told = Some(record);
            outlet.evidence(&Record::Life(record))?;
        }
        // A run that sees no entry knows less of the recorder than one before.
        if self.life_kept != Some(record) && record.model.is_some() {
            self.life_kept = Some(record);
            self.unkept.push(Record::Life(record));
        }
        Ok(())
    }
}

/// When the log was last seen at the place where this run begins.
fn last_look(
    records: &[Record],
    now: &HostReading,
    before: Option<(Life, Cursor)>,
) -> Option<Moment<Host>> {
    let (life, cursor) = before?;
    let watched = records.iter().rev().find_map(|record| match record {
        Record::Watched(watched) => Some(watched),
        _ => None,
    })?;
    let is_here = (watched.life, watched.through) == (life, cursor.sequence);
    let is_this_boot = watched.to.boot == now.boot && watched.to.monotonic <= now.monotonic;
    (is_here && is_this_boot).then_some(watched.to.monotonic)
}

fn erased(record: &Record) -> Option<(Life, Life)> {
    let Record::Life(LifeRecord { life, erased: Some(before), .. }) = record else { return None };
    Some((*life, *before))
}

fn life(record: &Record) -> Option<LifeRecord> {
    let Record::Life(life) = record else { return None };
    Some(*life)
}
