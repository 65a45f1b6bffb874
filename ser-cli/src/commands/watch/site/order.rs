//! The order of what several recorders have recorded, by what is known of their clocks.

use std::collections::HashMap;
use std::time::{Duration, Instant};

use ser_evidence::history::Collector;
use ser_evidence::record::{self, EntryRecord, Life};
use ser_evidence::site::Site;
use ser_evidence::timeline::{EventId, Order, Timeline};

use crate::kept::KeptRecords;
use crate::output::{Record, RowOrder};

/// How often what is remembered of clocks is read anew: somebody may have set one.
const RELOAD_EVERY: Duration = Duration::from_secs(30);

/// How many of the last entries of a recorder are kept in mind. A clock that was set is placed by
/// the entry right before.
const RECENT: usize = 64;

/// What is known of the clocks while events come.
pub(super) struct Evidence {
    site: Site,
    recorders: Vec<Known>,
    loaded_at: Option<Instant>,
    /// The event in the last row so far.
    last: Option<Key>,
}

/// A record at its place in the list.
pub(super) struct Row {
    /// The recorder's place among the recorders.
    pub(super) recorder: usize,
    pub(super) record: Record,
    /// Whether the event in the row before came first, as far as is known. What arrives late may
    /// have come before rows that are shown.
    pub(super) order: RowOrder,
}

/// What an entry is: the name of its recorder, its life and its sequence.
type Key = (String, Life, u64);

/// What is known of one recorder.
struct Known {
    name: String,
    kept: Option<KeptRecords>,
    records: Vec<record::Record>,
    recent: Vec<EntryRecord>,
}

impl Evidence {
    /// Of these recorders, in this order, each with what is remembered of it and the entry that was
    /// delivered last.
    pub(super) fn new(
        site: Site,
        recorders: impl IntoIterator<Item = (String, Option<KeptRecords>, Option<EntryRecord>)>,
    ) -> Evidence {
        let known = |(name, kept, last): (String, Option<KeptRecords>, Option<EntryRecord>)| {
            Known { name, kept, records: Vec::new(), recent: last.into_iter().collect() }
        };
        let recorders = recorders.into_iter().map(known).collect();
        Evidence { site, recorders, loaded_at: None, last: None }
    }

    /// Puts records in order. Those of one recorder stay in theirs, and a loss stays ahead of the
    /// event that follows it.
    pub(super) fn ordered(&mut self, of_recorders: Vec<Vec<Record>>) -> Vec<Row> {
        self.load_if_due();
        let history = self.collect(&of_recorders).finish(&self.site);
        let timeline = Timeline::new(&self.site, &history);
        let ranks = ranks(&timeline);
        let mut all: Vec<(usize, usize, Record)> = Vec::new();
        for (recorder, records) in of_recorders.into_iter().enumerate() {
            let of_records = self.places(&ranks, recorder, &records);
            all.extend(
                of_records.into_iter().zip(records).map(|(at, record)| (at, recorder, record)),
            );
        }
        // A stable sort: what stands together stays together by recorder.
        all.sort_by_key(|(at, ..)| *at);
        let mut rows = Vec::with_capacity(all.len());
        for (_, recorder, record) in all {
            let key = self.key(recorder, &record);
            let of = |key: &Option<Key>| Some(ranks.get(key.as_ref()?)?.1);
            let order = match (of(&self.last), of(&key)) {
                (Some(last), Some(this)) if last.recorder != this.recorder => {
                    match timeline.order(last, this) {
                        Order::Before | Order::Same => RowOrder::AsShown,
                        Order::After => RowOrder::Earlier,
                        Order::Unknown => RowOrder::Unknown,
                    }
                }
                _ => RowOrder::AsShown,
            };
            self.last = key.or_else(|| self.last.take());
            rows.push(Row { recorder, record, order });
        }
        rows
    }

    fn load_if_due(&mut self) {
        if self.loaded_at.is_some_and(|at| at.elapsed() < RELOAD_EVERY) {
            return;
        }
        for known in &mut self.recorders {
            known.records = known.kept.as_ref().map(KeptRecords::load).unwrap_or_default();
        }
        self.loaded_at = Some(Instant::now());
    }

    /// All that is known, and these records.
    fn collect(&mut self, of_recorders: &[Vec<Record>]) -> Collector {
        let mut collector = Collector::new();
        for (known, records) in self.recorders.iter_mut().zip(of_recorders) {
            collector.begin_source();
            for record in &known.records {
                collector.add(&known.name, record);
            }
            known.recent.extend(records.iter().filter_map(entry));
            for entry in &known.recent {
                collector.add(&known.name, &record::Record::Entry(*entry));
            }
            let too_many = known.recent.len().saturating_sub(RECENT);
            known.recent.drain(..too_many);
        }
        collector
    }

    fn key(&self, recorder: usize, record: &Record) -> Option<Key> {
        let entry = entry(record)?;
        Some((self.recorders.get(recorder)?.name.clone(), entry.life, entry.sequence?))
    }

    /// A place for each record of a recorder, which never goes back.
    fn places(&self, ranks: &Ranks, recorder: usize, records: &[Record]) -> Vec<usize> {
        let rank = |record: &Record| Some(ranks.get(&self.key(recorder, record)?)?.0);
        let mut places: Vec<usize> = Vec::with_capacity(records.len());
        let mut latest = 0;
        for record in records {
            latest = latest.max(rank(record).unwrap_or(latest));
            places.push(latest);
        }
        // A loss is where the event after it is.
        let mut next = latest;
        for (place, record) in places.iter_mut().zip(records).rev() {
            if matches!(record, Record::Loss(_)) {
                *place = next;
            }
            next = *place;
        }
        places
    }
}

/// Where each entry is in a timeline, and what it is called there.
type Ranks = HashMap<Key, (usize, EventId)>;

fn ranks(timeline: &Timeline<'_>) -> Ranks {
    let rank = |(rank, event)| {
        let name = timeline.recorder(event)?.recorder.name.clone();
        let life = timeline.life(event)?.name();
        Some(((name, life, timeline.held(event)?.sequence), (rank, event)))
    };
    timeline.entries().enumerate().filter_map(rank).collect()
}

fn entry(record: &Record) -> Option<EntryRecord> {
    match record {
        Record::Event(event) => Some(event.into()),
        Record::Loss(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use ser_evidence::record::{ClockObservation, How, Place, Reference};
    use ser_evidence::time::{Bound, Moment, shown};

    use super::*;
    use crate::output::testing::{entry, event, four_lost};
    use ser_observer::host_reading;

    fn at(number: u16, time: &str) -> Record {
        let mut event = event(number, entry(time, &[1], &[1]));
        event.sequence = Some(number.into());
        Record::Event(event)
    }

    fn evidence() -> Evidence {
        let names = ["U1", "U2"].map(|name| (name.to_owned(), None, None));
        Evidence::new(Site::unknown(), names)
    }

    /// The numbers of the events in their order; 0 for a loss.
    fn ordered(evidence: &mut Evidence, of_recorders: Vec<Vec<Record>>) -> Vec<(usize, u16)> {
        let number = |record: &Record| match record {
            Record::Event(event) => event.number,
            Record::Loss(_) => 0,
        };
        let ordered = evidence.ordered(of_recorders);
        ordered.iter().map(|row| (row.recorder, number(&row.record))).collect()
    }

    #[test]
    fn without_anything_known_the_clocks_are_believed() {
        assert_eq!(
            ordered(
                &mut evidence(),
                vec![vec![at(1, "00.250"), at(2, "00.300")], vec![at(1, "00.260")]]
            ),
            [(0, 1), (1, 1), (0, 2)]
        );
    }

    /// What is known of two clocks: U2 shows ten seconds less than U1 at the same moment.
    fn evidence_of_clocks() -> Evidence {
        let mut evidence = evidence();
        for (known, time) in evidence.recorders.iter_mut().zip(["10.000", "00.000"]) {
            let shown = shown(&entry(time, &[], &[]).time).expect("a date");
            let reading = host_reading::now();
            let bound = Bound::new(
                Some(reading.monotonic),
                Some(Moment::from_us(reading.monotonic.us() + 1000)),
            );
            let life = crate::output::testing::life();
            let place = Place { life, after: Some(0), before: Some(0), newest: None, fellow: None };
            let at = Reference::Host { bound, reading };
            let how = How::Set { broadcast: None };
            let observation = ClockObservation { how, shown, at, place };
            known.records.push(record::Record::Clock(observation));
        }
        evidence.loaded_at = Some(Instant::now());
        evidence
    }

    #[test]
    fn a_clock_that_is_known_to_be_late_is_put_right() {
        assert_eq!(
            ordered(
                &mut evidence_of_clocks(),
                vec![vec![at(1, "15.000")], vec![at(1, "04.000"), at(2, "06.000")]]
            ),
            [(1, 1), (0, 1), (1, 2)]
        );
    }

    /// How each row stands to the one before.
    fn marks(evidence: &mut Evidence, of_recorders: Vec<Vec<Record>>) -> Vec<RowOrder> {
        evidence.ordered(of_recorders).iter().map(|row| row.order).collect()
    }

    #[test]
    fn a_row_that_may_have_come_before_the_one_ahead_of_it_is_marked() {
        use RowOrder::{AsShown, Unknown};
        let mut known = evidence_of_clocks();
        let first = vec![vec![at(1, "15.000")], vec![at(1, "05.001"), at(2, "06.000")]];
        assert_eq!(marks(&mut known, first), [AsShown, Unknown, AsShown]);
        let later = vec![vec![at(2, "16.001"), at(3, "19.000")], vec![at(3, "09.500")]];
        assert_eq!(
            marks(&mut known, later),
            [Unknown, AsShown, AsShown],
            "of the row shown before"
        );
        let without = vec![vec![at(1, "00.250")], vec![at(1, "50.000")]];
        assert_eq!(marks(&mut evidence(), without), [AsShown, Unknown]);
    }

    #[test]
    fn a_row_that_arrives_late_and_is_proven_to_be_earlier_says_so() {
        use RowOrder::{AsShown, Earlier};
        let mut known = evidence_of_clocks();
        let first = vec![vec![at(1, "15.000"), at(2, "16.000")], vec![]];
        assert_eq!(marks(&mut known, first), [AsShown, AsShown]);
        let late = vec![vec![at(3, "19.000")], vec![at(1, "04.000"), at(2, "05.500")]];
        assert_eq!(marks(&mut known, late), [Earlier, AsShown, AsShown]);
    }

    #[test]
    fn one_recorder_stays_in_its_order_where_its_clock_goes_back() {
        let of = ordered(
            &mut evidence(),
            vec![vec![at(1, "05.000"), at(2, "01.000")], vec![at(1, "03.000")]],
        );
        let first = of.iter().position(|row| *row == (0, 1));
        assert!(first < of.iter().position(|row| *row == (0, 2)), "{of:?}");
    }

    #[test]
    fn a_loss_stays_before_what_follows_it() {
        assert_eq!(
            ordered(
                &mut evidence(),
                vec![
                    vec![at(1, "01.000"), Record::Loss(four_lost()), at(6, "05.000")],
                    vec![at(1, "03.000"), Record::Loss(four_lost())],
                ]
            ),
            [(0, 1), (1, 1), (1, 0), (0, 0), (0, 6)]
        );
    }
}
