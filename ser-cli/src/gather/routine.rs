//! Which of the readings that a collector makes all the time are needed for a report.
//!
//! A clock that is asked each day for years tells no more of one incident than when it is asked
//! each day for the weeks around it, and now and then before and after. So routine readings that
//! are far away are thinned out. What was set, by whomever, is always needed.

use std::collections::{BTreeMap, BTreeSet};

use ser_evidence::record::{ClockObservation, How, Record, Reference};

/// How far from the time that is wanted all readings are needed, in microseconds: 45 days.
const NEAR_US: i64 = 45 * 86_400_000_000;

/// Beyond that, the first and the last of a life in such a time are, in microseconds: ten days.
const BUCKET_US: i64 = 10 * 86_400_000_000;

/// The records that are needed for a time, given in microseconds of UTC; without one, of all times
/// a part.
pub(super) fn needed(records: &[Record], span: Option<(i64, i64)>) -> Vec<&Record> {
    let mut kept: BTreeSet<usize> = BTreeSet::new();
    let mut far: BTreeMap<(bool, u64, i64), (usize, usize)> = BTreeMap::new();
    let mut last_watched: Option<(i64, usize)> = None;
    for (index, record) in records.iter().enumerate() {
        let Some((is_clock, life, at)) = routine(record) else {
            kept.insert(index);
            continue;
        };
        let is_near = span.is_some_and(|(from, until)| {
            from.saturating_sub(NEAR_US) <= at && at <= until.saturating_add(NEAR_US)
        });
        if is_near {
            kept.insert(index);
        }
        if !is_clock {
            last_watched = last_watched.max(Some((at, index)));
        }
        let bucket = (is_clock, life, at.div_euclid(BUCKET_US));
        far.entry(bucket).or_insert((index, index)).1 = index;
    }
    kept.extend(far.into_values().flat_map(|(first, last)| [first, last]));
    kept.extend(last_watched.map(|(_, index)| index));
    kept.into_iter().filter_map(|index| records.get(index)).collect()
}

/// Whether it is of a clock, its life and its time, in microseconds of UTC, of a record that a
/// reading makes each time; `None` of others.
fn routine(record: &Record) -> Option<(bool, u64, i64)> {
    match record {
        Record::Watched(watched) => Some((false, watched.life.bits(), watched.to.utc.us())),
        Record::Clock(ClockObservation {
            how: How::Query | How::Event,
            at: Reference::Host { reading, .. },
            place,
            ..
        }) => Some((true, place.life.bits(), reading.utc.us())),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use ser_evidence::record::{Boot, HostReading, Life, Watched};
    use ser_evidence::time::Moment;

    use super::*;

    const DAY_US: i64 = 86_400_000_000;

    #[test]
    fn what_is_near_and_the_ends_of_each_stretch_are_needed() {
        let watched = |day: i64| {
            let at = HostReading {
                boot: Boot(1),
                monotonic: Moment::from_us(day * DAY_US),
                utc: Moment::from_us(day * DAY_US),
                utc_doubt_us: None,
            };
            Record::Watched(Watched { life: Life::from_bits(7), from: at, to: at, through: 1 })
        };
        let records: Vec<Record> = (0..400).map(watched).collect();
        let days = |span| -> Vec<i64> {
            let of = |record: &&Record| routine(record).map(|(.., at)| at / DAY_US);
            needed(&records, span).iter().filter_map(of).collect()
        };
        let around = days(Some((200 * DAY_US, 201 * DAY_US)));
        assert!((155..=246).all(|day| around.contains(&day)));
        assert_eq!(around[..4], [0, 9, 10, 19]);
        assert_eq!(around.last(), Some(&399));
        assert_eq!(days(None).len(), 80);
    }
}
