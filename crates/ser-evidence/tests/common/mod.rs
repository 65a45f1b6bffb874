//! Sites and logs in a few words.
#![allow(dead_code, reason = "each test uses some of it")]

use ser_evidence::history::{Collector, History};
use ser_evidence::record::{
    Boot, ClockObservation, EntryRecord, Gap, HostReading, How, Life, Lost, Place, Record,
    RecorderRecord, Reference, Suppressed, Why,
};
use ser_evidence::site::{self, Site};
use ser_evidence::time::{Bound, Moment, Shown, shown};
use ser_proto::{Entry, Inputs, TimeStamp};

/// A stamp as it is written: `2026-11-22T10:00:00.250`.
pub(crate) fn stamp(text: &str) -> TimeStamp {
    let number = |range: std::ops::Range<usize>| text[range].parse::<u16>().expect("a number");
    let byte = |range| u8::try_from(number(range)).expect("a byte");
    TimeStamp {
        year: u8::try_from(number(0..4) % 100).expect("two digits"),
        month: byte(5..7),
        day: byte(8..10),
        hour: byte(11..13),
        minute: byte(14..16),
        second: byte(17..19),
        millisecond: number(20..23),
    }
}

/// What a clock showed.
pub(crate) fn seen(text: &str) -> Moment<Shown> {
    shown(&stamp(text)).expect("a date")
}

/// The site that a text describes.
pub(crate) fn site(text: &str) -> Site {
    let head = "site = \"Northfield\"\ntime_zone = \"Europe/Berlin\"\n";
    site::read(&format!("{head}{text}")).unwrap_or_else(|errors| panic!("{errors:#?}"))
}

/// The log of one recorder.
pub(crate) struct Log {
    recorder: &'static str,
    life: Life,
    state: u32,
    records: Vec<Record>,
    sequence: u64,
    newest: Option<Entry>,
}

impl Log {
    /// An empty one. Nobody knows which life number 0 is.
    pub(crate) fn of(recorder: &'static str, life: u64) -> Log {
        let life = Life::from_bits(life);
        Log { recorder, life, state: 0, records: Vec::new(), sequence: 0, newest: None }
    }

    /// These inputs change.
    pub(crate) fn changes(&mut self, time: &str, inputs: &[u8]) -> &mut Log {
        let changed = inputs.iter().fold(0, |bits, input| bits | 1 << (input - 1));
        self.state ^= changed;
        self.sequence += 1;
        let entry =
            Entry { changed: Inputs(changed), state: Inputs(self.state), time: stamp(time) };
        self.newest = Some(entry);
        self.records.push(Record::Entry(EntryRecord {
            life: self.life,
            sequence: Some(self.sequence),
            number: u16::try_from(self.sequence).expect("a small log"),
            entry,
            known: EntryRecord::ALL_KNOWN,
        }));
        self
    }

    /// These inputs change, and the source does not say to what.
    pub(crate) fn moves(&mut self, time: &str, inputs: &[u8]) -> &mut Log {
        self.changes(time, inputs);
        if let Some(Record::Entry(record)) = self.records.last_mut() {
            record.known.0 &= !record.entry.changed.0;
            record.entry.state.0 &= record.known.0;
        }
        self
    }

    /// These inputs change and no entry says so.
    pub(crate) fn forgets(&mut self, inputs: &[u8]) -> &mut Log {
        self.state ^= inputs.iter().fold(0, |bits, input| bits | 1 << (input - 1));
        self
    }

    /// So many entries are overwritten before they are read.
    pub(crate) fn loses(&mut self, count: u64) -> &mut Log {
        self.sequence += count;
        self
    }

    /// Somebody who had read up to this entry has found so many overwritten.
    pub(crate) fn tells_overwritten(&mut self, after: u64, count: u32) -> &mut Log {
        let (life, after, lost) = (self.life, Some(after), Lost::Exactly(count));
        self.records.push(Record::Gap(Gap { life, after, lost, why: Why::Overwritten }));
        self
    }

    /// Somebody tells that so much is missing after this entry.
    pub(crate) fn tells(&mut self, after: u64, lost: Lost, why: Why) -> &mut Log {
        let (life, after) = (self.life, Some(after));
        self.records.push(Record::Gap(Gap { life, after, lost, why }));
        self
    }

    /// It is the list of another device, whose stamps are in UTC.
    pub(crate) fn is_list(&mut self) -> &mut Log {
        self.records.push(Record::Recorder(RecorderRecord { utc_offset_s: 0 }));
        self
    }

    /// Somebody looked at this time of the same host how many changes of inputs were left out. The
    /// recorder had been on for so many seconds.
    pub(crate) fn left_out(&mut self, utc: &str, on_for_s: u64, counts: &[(u8, u32)]) -> &mut Log {
        let at = |us: i64| HostReading {
            boot: Boot(1),
            monotonic: Moment::from_us(monotonic_us(utc) + us),
            utc: Moment::from_us(booted_us() + monotonic_us(utc) + us),
            utc_doubt_us: Some(1000),
        };
        self.records.push(Record::Suppressed(Suppressed {
            from: at(-5000),
            to: at(0),
            on_for_us: on_for_s * 1_000_000,
            left_out: counts.iter().copied().collect(),
        }));
        self
    }

    /// The clock began to show this between these two moments of a host that was booted at the
    /// beginning of 2026, and is as wrong as it says.
    pub(crate) fn observed(
        &mut self,
        how: How,
        showed: &str,
        bound_us: (i64, i64),
        utc_doubt_us: Option<u64>,
    ) -> &mut Log {
        let at = bound_us.1;
        let reading = HostReading {
            boot: Boot(1),
            monotonic: Moment::from_us(at),
            utc: Moment::from_us(booted_us() + at),
            utc_doubt_us,
        };
        let place = Place {
            life: self.life,
            after: Some(self.sequence),
            before: Some(self.sequence),
            newest: self.newest.filter(|_| !self.life.is_known()),
            fellow: None,
        };
        let at = Reference::Host { bound: Bound::from_us(bound_us.0, bound_us.1), reading };
        self.records.push(Record::Clock(ClockObservation { how, shown: seen(showed), at, place }));
        self
    }
}

/// When the host was booted, by its own UTC.
pub(crate) fn booted_us() -> i64 {
    seen("2026-01-01T00:00:00.000").us()
}

/// The monotonic clock of the host when its UTC shows this.
pub(crate) fn monotonic_us(utc: &str) -> i64 {
    seen(utc).us() - booted_us()
}

impl Log {
    /// What it has written down so far.
    pub(crate) fn records(&self) -> &[Record] {
        &self.records
    }
}

/// Everything that these logs say.
pub(crate) fn history(site: &Site, logs: &[&Log]) -> History {
    let mut collector = Collector::new();
    for log in logs {
        collector.begin_source();
        log.records.iter().for_each(|record| collector.add(log.recorder, record));
    }
    collector.finish(site)
}
