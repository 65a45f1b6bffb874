//! Reads the recorders of a site, all at once.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use ser_client::{Clock, Cursor, Delivery, LogFollower, RealTime, Unit};
use ser_evidence::history::Collector;
use ser_evidence::record::{
    ClockObservation, EntryRecord, Gap, How, Life, LifeRecord, Place, Record, Reference, Watched,
};
use ser_evidence::site::{Recorder, Site};
use ser_evidence::time::{Bound, shown};
use ser_files::NotReached;
use ser_observer::{LogIdentity, clock_look, host_reading, nothing_after};

use crate::buses::Buses;
use crate::connection::{self, ConnectionArgs};
use crate::error::{Failure, Result, inform, warn};
use crate::interrupt::Caught;
use crate::keeper::StateArgs;
use crate::kept::KeptRecords;
use crate::original::Originals;
use crate::output::Loss;
use crate::state::{Delivered, StateFile};

/// Reads all recorders that have a port. Returns those that could not be read.
pub(super) fn read(
    site: &Site,
    connection: &ConnectionArgs,
    state: &StateArgs,
    collector: &mut Collector,
) -> Result<Vec<NotReached>> {
    let caught = Caught::for_now()?;
    let stop = caught.flag();
    let is_meant = |recorder: &&Recorder| {
        connection.recorder.as_ref().is_none_or(|name| *name == recorder.name)
    };
    let recorders = site.recorders.iter().filter(is_meant);
    let with_port = recorders.filter(|recorder| recorder.port.is_some());
    let names: Vec<&str> = with_port.clone().map(|recorder| recorder.name.as_str()).collect();
    if names.is_empty() {
        return Err(Failure::usage("no recorder of the site has a port, so none can be read")
            .hint("add port = \"…\" to a [[recorder]] of the site file")
            .hint("or give files with --input FILE…"));
    }
    inform(format_args!("reading {} …", names.join(", ")));
    let buses = Buses::default();
    let one = |recorder: &Recorder| {
        let port = recorder.port.as_deref().unwrap_or_default();
        let baud = connection.baud.or(recorder.baud);
        let connection = ConnectionArgs { baud, ..connection::at_port(connection, port) };
        read_one(recorder, &connection, state, &buses, stop)
    };
    let results: Vec<(&Recorder, Result<Vec<Record>>)> = thread::scope(|scope| {
        let running: Vec<_> =
            with_port.map(|recorder| (recorder, scope.spawn(move || one(recorder)))).collect();
        running
            .into_iter()
            .map(|(recorder, thread)| {
                let panicked = |panic| std::panic::resume_unwind(panic);
                (recorder, thread.join().unwrap_or_else(panicked))
            })
            .collect()
    });
    let mut not_reached = Vec::new();
    for (recorder, result) in results {
        collector.begin_source();
        match result {
            Ok(records) => {
                records.iter().for_each(|record| collector.add(&recorder.name, record));
            }
            Err(Failure::Interrupted) => return Err(interrupted()),
            Err(failure) => {
                let why = failure.message();
                warn(format_args!("{}: {why}", recorder.name));
                not_reached.push(NotReached { recorder: recorder.name.clone(), why });
                // What is known from before is better than nothing.
                if let Ok(kept) = kept(recorder, connection, state) {
                    kept.load().iter().for_each(|record| collector.add(&recorder.name, record));
                }
            }
        }
    }
    Ok(not_reached)
}

/// Unlike a command that goes on until Ctrl-C, the one that reads here has not done its work.
fn interrupted() -> Failure {
    Failure::new("interrupted before everything was read, and nothing is written")
        .hint("nothing is marked as delivered; run the command again")
}

fn kept(
    recorder: &Recorder,
    connection: &ConnectionArgs,
    state: &StateArgs,
) -> Result<KeptRecords> {
    let port = recorder.port.as_deref().unwrap_or_default();
    let unit = connection::unit_name(&connection::at_port(connection, port))?;
    KeptRecords::of_unit(&unit, recorder.name.clone(), state.directory())
}

/// Everything that a recorder has, and what is remembered of its clock. Nothing is marked as
/// delivered.
fn read_one(
    recorder: &Recorder,
    connection: &ConnectionArgs,
    state: &StateArgs,
    buses: &Buses,
    stop: &AtomicBool,
) -> Result<Vec<Record>> {
    let unit_name = connection::unit_name(connection)?;
    let mut state_file = StateFile::of_unit(&unit_name, state.directory())?;
    let remembered = state_file.load()?;
    let from = host_reading::now();
    let mut unit = buses.open(connection)?;
    let known_size = remembered.map(|delivered| delivered.size).filter(|&size| size > 0);
    let size = connection::log_size(&mut unit, recorder.log_size, known_size)?;
    let originals = Originals::of(state, connection)?.said(recorder.is_original);
    // What is remembered of another log names nothing in this one.
    let log = originals.identity(&mut unit)?.as_ref().map(LogIdentity::from);
    let is_of_this = |delivered: &Delivered| match (delivered.log, log) {
        (Some(read), Some(log)) => read == log,
        _ => true,
    };
    let remembered = remembered.filter(is_of_this);
    let mut follower = LogFollower::new(None, size);
    let mut deliveries: Vec<Delivery> = Vec::new();
    follower.read_new(&mut unit, &mut |step| -> Result<()> {
        deliveries.extend_from_slice(step.deliveries);
        match stop.load(Ordering::Relaxed) {
            true => Err(Failure::Interrupted),
            false => Ok(()),
        }
    })?;
    let read_at = RealTime.now();
    let named = remembered.map_or(Named::NOBODY, |delivered| Named::of(&delivered, &deliveries));
    let mut records: Vec<Record> =
        deliveries.iter().map(|delivery| named.record(delivery)).collect();
    if let Some(cursor) = follower.cursor() {
        let life = LifeRecord {
            life: named.life,
            is_exact: named.is_exact || cursor.is_exact,
            model: recorder.model,
            size: Some(size),
            erased: None,
        };
        records.push(Record::Life(life));
        let through = named.sequence(cursor.sequence);
        let looked_at = nothing_after(&mut unit, cursor)?;
        if let Some(complete_at) = looked_at.max(follower.complete_at()) {
            let to = host_reading::at(complete_at);
            records.push(Record::Watched(Watched { life: named.life, from, to, through }));
        }
    }
    records.extend(newest(&records, read_at));
    let kept = kept(recorder, connection, state)?;
    let cursor = follower.cursor().map(|cursor| named.cursor(cursor));
    if let Some(looked) =
        cursor.and_then(|cursor| look(&mut unit, &originals, (named.life, cursor), log))
    {
        kept.add(std::slice::from_ref(&looked));
        records.push(looked);
    }
    // The entries are there, whatever becomes of this.
    records.extend(ser_observer::left_out(&mut unit).ok().flatten().map(Record::Suppressed));
    records.extend(kept.load());
    Ok(records)
}

/// What the clock shows right after a reading, if the recorder can be asked. The reading is whole
/// without it, so no failure is one here.
fn look(
    unit: &mut Unit,
    originals: &Originals,
    (life, cursor): (Life, Cursor),
    log: Option<LogIdentity>,
) -> Option<Record> {
    originals.identity(unit).ok()??;
    let looks = clock_look::take(unit).ok()??;
    let place = looks.place(life, cursor, log.map(|log| log.life))?;
    looks.observation(place).map(Record::Clock)
}

/// The newest entry had happened when it was read.
fn newest(records: &[Record], read_at: std::time::Duration) -> Option<Record> {
    let entry = records.iter().rev().find_map(|record| match record {
        Record::Entry(entry) => Some(entry),
        _ => None,
    })?;
    let bound = Bound::new(None, Some(host_reading::moment(read_at)));
    let place = Place {
        life: entry.life,
        after: entry.sequence,
        before: entry.sequence,
        newest: Some(entry.entry),
        fellow: None,
    };
    Some(Record::Clock(ClockObservation {
        how: How::Event,
        shown: shown(&entry.entry.time)?,
        at: Reference::Host { bound, reading: host_reading::at(read_at) },
        place,
    }))
}

/// By which life, and from where on, the entries of a reading are counted: as earlier runs did, if
/// this is still the log that they read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Named {
    life: Life,
    shift: u64,
    is_exact: bool,
}

impl Named {
    const NOBODY: Named = Named { life: Life::UNKNOWN, shift: 0, is_exact: false };

    fn of(delivered: &Delivered, deliveries: &[Delivery]) -> Named {
        let (Some(life), Some(cursor)) = (delivered.life, delivered.cursor) else {
            return Named::NOBODY;
        };
        let is_last = |delivery: &&Delivery| match (*delivery, cursor) {
            (&Delivery::Event { sequence: Some(sequence), entry, .. }, cursor) => {
                Some(entry) == cursor.anchor && same_total(sequence, cursor)
            }
            _ => false,
        };
        let named = |sequence: u64| Named {
            life,
            shift: cursor.sequence - sequence,
            is_exact: cursor.is_exact,
        };
        match deliveries.iter().find(is_last) {
            Some(&Delivery::Event { sequence: Some(sequence), .. })
                if sequence <= cursor.sequence =>
            {
                named(sequence)
            }
            // The log was empty when somebody looked, and has begun since.
            _ if cursor.sequence == 0 && cursor.anchor.is_none() => named(0),
            // The log that was read is gone, and the next one had a name before it had an entry.
            _ if begins(deliveries) => delivered.next_life.map_or(Named::NOBODY, |life| Named {
                life,
                shift: 0,
                is_exact: true,
            }),
            _ => Named::NOBODY,
        }
    }

    fn sequence(&self, sequence: u64) -> u64 {
        sequence.saturating_add(self.shift)
    }

    fn cursor(&self, cursor: Cursor) -> Cursor {
        let is_exact = self.is_exact || cursor.is_exact;
        Cursor { sequence: self.sequence(cursor.sequence), is_exact, ..cursor }
    }

    fn record(&self, delivery: &Delivery) -> Record {
        match *delivery {
            Delivery::Event { entry_number, sequence, entry, .. } => Record::Entry(EntryRecord {
                life: self.life,
                sequence: sequence.map(|sequence| self.sequence(sequence)),
                number: entry_number,
                entry,
                known: EntryRecord::ALL_KNOWN,
            }),
            Delivery::Lost { after, lost } => {
                let after = after.map(|after| if after == 0 { 0 } else { self.sequence(after) });
                Record::Gap(Gap::from(&Loss { after, life: self.life, lost }))
            }
        }
    }
}

/// Whether these are all entries of a log from its beginning.
fn begins(deliveries: &[Delivery]) -> bool {
    matches!(deliveries.first(), Some(Delivery::Event { sequence: Some(1), .. }))
}

fn same_total(sequence: u64, cursor: Cursor) -> bool {
    sequence % 65_536 == cursor.sequence % 65_536
}
