//! One recorder's clock, asked for.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use ser_client::Unit;
use ser_evidence::record::{ClockObservation, How, Place, Record, Reference};
use ser_evidence::time::Moment;
use ser_observer::{
    ClockSetting, LogLook,
    clock_look::{self, Looks},
    host_reading,
};
use ser_proto::{Capabilities, ClockReading, ClockSource, Identity};

use super::drift::{self, Rate, Sight};
use crate::buses::Buses;
use crate::connection::{ConnectionArgs, HEARTBEAT};
use crate::error::Result;
use crate::keeper::StateArgs;
use crate::kept::KeptRecords;
use crate::log_identity;
use crate::original::Originals;

/// How often a clock is asked for that is looked at for a while.
const SAMPLE_EVERY: Duration = Duration::from_secs(1);

/// How to ask.
pub(super) struct Asking<'a> {
    pub(super) state: &'a StateArgs,
    pub(super) buses: &'a Buses,
    /// For how long.
    pub(super) time: Duration,
    pub(super) stop: &'a AtomicBool,
}

/// What came of it.
pub(super) enum Answer {
    Told(Box<Told>),
    /// It is there and does not know the question.
    Original,
    /// It knows the question and does not answer it.
    Silent,
}

/// A clock that was asked for.
pub(super) struct Told {
    /// The last answer.
    pub(super) reading: ClockReading,
    /// When that was, by the clock of this computer that shows UTC, in microseconds.
    pub(super) utc_us: i64,
    /// In what zone the clock is said to be.
    pub(super) setting: ClockSetting,
    /// How far it is ahead of this computer's clock in that zone, at least and at most.
    pub(super) ahead_us: (i64, i64),
    /// How fast it runs, if that is known.
    pub(super) rate: Option<Rate>,
    /// How many answers this is from.
    pub(super) answers: usize,
    /// What is kept of it.
    pub(super) records: Vec<Record>,
}

impl Asking<'_> {
    /// Asks the recorder of a connection.
    pub(super) fn ask(&self, connection: &ConnectionArgs) -> Result<Answer> {
        let mut unit = self.buses.open(connection)?;
        // The user wants to know what it can tell now. It says which life this is before the look
        // at the log and with each answer after it.
        let identity = Originals::of(self.state, connection)?.ask(&mut unit)?;
        let tells = |identity: &Identity| identity.capabilities.contains(Capabilities::TIME);
        let Some(identity) = identity.filter(tells) else { return Ok(Answer::Original) };
        let look = LogLook::take(&mut unit)?;
        let place = log_identity::named(look, &mut unit, Some(&identity), (self.state, connection));
        let Some(looks) = self.looks(&mut unit)? else { return Ok(Answer::Silent) };
        let kept = KeptRecords::of(self.state, connection)?;
        let earlier = kept.load();
        let place = looks.last_total(identity.life).and_then(|total| place.place_before(total));
        let seen = place.and_then(|place| looks.observation(place)).map(Record::Clock);
        let records: Vec<Record> = seen.into_iter().collect();
        kept.add(&records);
        let place = place.unwrap_or(Place::UNKNOWN);
        let setting = connection.clock_setting().unwrap_or_else(ClockSetting::of_this_computer);
        Ok(told(&looks, (&earlier, &place), setting, records)
            .map_or(Answer::Silent, |told| Answer::Told(Box::new(told))))
    }

    /// Asks for as long as is wanted, until the user interrupts it.
    fn looks(&self, unit: &mut Unit) -> Result<Option<Looks>> {
        let began = unit.now();
        let mut all = clock_look::take(unit)?;
        while all.is_some() && unit.now().saturating_sub(began) < self.time {
            let next = unit.now() + SAMPLE_EVERY;
            while unit.now() < next && !self.stop.load(Ordering::Relaxed) {
                thread::sleep(HEARTBEAT);
            }
            if self.stop.load(Ordering::Relaxed) {
                break;
            }
            if let (Some(before), Some(more)) = (all.take(), clock_look::take(unit)?) {
                all = Some(before.and(more));
            } else {
                break;
            }
        }
        Ok(all)
    }
}

fn told(
    looks: &Looks,
    earlier: (&[Record], &Place),
    setting: ClockSetting,
    records: Vec<Record>,
) -> Option<Told> {
    let reading = *looks.last()?;
    let now: Vec<Sight> = looks
        .ahead()
        .map(|(at_us, (least_us, most_us))| Sight { at_us, least_us, most_us })
        .collect();
    let at_us = now.last()?.at_us;
    let mut sights = remembered(earlier, &reading, at_us);
    sights.extend(&now);
    // What is remembered may be of a clock that somebody has set since.
    if drift::rate(&sights).is_none() {
        sights.clone_from(&now);
    }
    let (least_us, most_us) = drift::ahead(&sights, at_us)?;
    let host = host_reading::at(Duration::from_micros(u64::try_from(at_us).ok()?));
    let utc_us = host.utc.us();
    // From this computer's monotonic clock to the zone's.
    let zone_us = setting.shown_us(utc_us)?.saturating_sub(at_us);
    let ahead_us = (least_us.saturating_sub(zone_us), most_us.saturating_sub(zone_us));
    let (rate, answers) = (drift::rate(&sights), looks.rounds());
    Some(Told { reading, utc_us, setting, ahead_us, rate, answers, records })
}

/// Earlier sights of the clock since it was last set, by this boot of this computer. What was seen
/// at another log may be of another recorder, if somebody has exchanged them.
fn remembered(
    (earlier, here): (&[Record], &Place),
    reading: &ClockReading,
    at_us: i64,
) -> Vec<Sight> {
    // One that is disciplined has no rate of its own.
    if matches!(reading.source, ClockSource::Pps | ClockSource::IrigB) {
        return Vec::new();
    }
    let age_us = i64::from(reading.age_s).saturating_add(1).saturating_mul(1_000_000);
    let tick_us = i64::try_from(reading.tick_us).unwrap_or(i64::MAX);
    let since = Moment::from_us(at_us.saturating_sub(age_us.min(tick_us)));
    let boot = host_reading::now().boot;
    let is_step = |record: &Record| match record {
        Record::Step(_) => true,
        Record::Clock(ClockObservation { how, .. }) => how.is_set(),
        _ => false,
    };
    let last_step = earlier.iter().rposition(is_step).unwrap_or_default();
    let sight = |record: &Record| {
        let Record::Clock(ClockObservation { how, shown, at, place }) = record else { return None };
        let is_another = !is_same_log(place, here);
        let Reference::Host { bound, reading } = at else { return None };
        let (lo, hi) = (bound.lo()?, bound.hi()?);
        let is_known = !is_another && reading.boot == boot && lo > since && *how != How::Event;
        is_known.then(|| Sight {
            at_us: lo.us().midpoint(hi.us()),
            least_us: shown.us().saturating_sub(hi.us()),
            most_us: shown.us().saturating_sub(lo.us()),
        })
    };
    earlier.iter().skip(last_step).filter_map(sight).collect()
}

/// Whether two places are in the same log. Where nobody has named its life, that is known only as
/// long as nothing has come to it.
fn is_same_log(one: &Place, other: &Place) -> bool {
    match one.life.is_known() && other.life.is_known() {
        true => one.life == other.life,
        false => (one.newest, one.after) == (other.newest, other.after),
    }
}

#[cfg(test)]
mod tests {
    use ser_evidence::record::Life;
    use ser_evidence::time::Bound;

    use super::*;

    #[test]
    fn what_was_seen_before_the_clock_was_set_does_not_count() {
        let now = host_reading::now();
        let at_us = 10_000_000_000;
        let seen = |how, ago_us: i64| {
            let to = at_us - ago_us;
            let bound = Bound::from_us(to - 100, to);
            let at = Reference::Host { bound, reading: now };
            let shown = Moment::from_us(to + 5_000);
            Record::Clock(ClockObservation { how, shown, at, place: Place::UNKNOWN })
        };
        let reading = |source, age_s| ClockReading {
            token: 0,
            clock_us: 0,
            source,
            age_s,
            doubt_us: None,
            drift_ppb: None,
            tick_us: 9_000_000_000,
            life: 1,
            next_sequence: 1,
            last_mark: None,
        };
        let set = How::Set { broadcast: None };
        let earlier = [
            seen(How::Query, 60_500_000),
            seen(set, 60_000_000),
            seen(How::Query, 50_000_000),
            seen(How::Event, 40_000_000),
        ];
        let ages = |source, age_s| -> Vec<i64> {
            let sights = remembered((&earlier, &Place::UNKNOWN), &reading(source, age_s), at_us);
            assert!(sights.iter().all(|sight| (sight.least_us, sight.most_us) == (5_000, 5_100)));
            sights.iter().map(|sight| (at_us - sight.at_us) / 1_000_000).collect()
        };
        assert_eq!(ages(ClockSource::HostOverRs232, 60), [60, 50]);
        assert_eq!(ages(ClockSource::HostOverRs232, 55), [50], "somebody else has set it");
        assert_eq!(ages(ClockSource::HostOverRs232, 30), [0_i64; 0]);
        assert_eq!(ages(ClockSource::Pps, 60), [0_i64; 0]);
        let reading = reading(ClockSource::HostOverRs232, 60);
        let in_life = |bits| Place { life: Life::from_bits(bits), ..Place::UNKNOWN };
        let seen = [4, 5].map(|bits| match seen(How::Query, 50_000_000) {
            Record::Clock(seen) => Record::Clock(ClockObservation { place: in_life(bits), ..seen }),
            other => other,
        });
        for (life, count) in [(4, 1), (5, 1), (6, 0)] {
            let sights = remembered((&seen, &in_life(life)), &reading, at_us);
            assert_eq!(sights.len(), count, "life {life}");
        }
        let unnamed = Place { after: Some(5), ..Place::UNKNOWN };
        assert!(remembered((&seen, &unnamed), &reading, at_us).is_empty(), "of which log?");
        assert!(is_same_log(&unnamed, &unnamed));
        assert!(!is_same_log(&unnamed, &Place { after: Some(6), ..unnamed }));
    }
}
