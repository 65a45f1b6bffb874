//! What is done for a recorder besides reading its log: looking at its clock and setting it, asking
//! what its filters left out, and saying for which time nothing is missing.

use std::time::{Duration, Instant};

use jiff::civil;
use jiff::tz::TimeZone;
use ser_client::{Cursor, RequestError, Unit};
use ser_evidence::record::{EntryRecord, HostReading, Life, Record, Suppressed, Watched};
use ser_evidence::time::{Host, Moment};
use ser_observer::{
    ClockSetting, LogIdentity, LogLook,
    clock_look::{self, NowAndThen},
    host_reading, left_out, nothing_after, seen_at,
    setting::{self, set_clock},
};
use tracing::{info, warn};

use super::Task;
use super::filing::{Arrivals, Filing};
use crate::options::DailyTime;
use crate::trouble::Trouble;

/// No two times of the day are further apart, however a zone moves: 25 hours and a bit.
const LONGEST_DAY_US: i64 = 26 * 3_600_000_000;

/// What is done besides reading.
pub(super) struct Duties<'t> {
    task: &'t Task,
    /// From when on this visit has watched the log.
    began: HostReading,
    /// When the log was last known to hold nothing that was not archived, and how far it was then.
    complete: Option<(Moment<Host>, Life, u64)>,
    /// Up to where that has been told.
    vouched: Option<Moment<Host>>,
    vouch_due: Instant,
    /// The questions about the clock, if the recorder can be asked.
    clock: Option<NowAndThen>,
    arrival_due: Instant,
    /// When the last entry came of an incident that is not over.
    moved_at: Option<Instant>,
    left_out: Option<Suppressed>,
    left_out_due: Instant,
    set_due: Option<i64>,
    unsaid: Vec<Record>,
}

impl<'t> Duties<'t> {
    pub(super) fn new(
        task: &'t Task,
        unit: &Unit,
        log: Option<LogIdentity>,
        (left_out, set_due): (Option<Suppressed>, Option<i64>),
    ) -> Duties<'t> {
        let times = &task.shared.options.times;
        let (now, reading) = (Instant::now(), host_reading::now());
        // What is seen may have been on the line for so long.
        let delay_us = i64::try_from(unit.report_delay().as_micros()).unwrap_or(i64::MAX);
        let began = HostReading {
            monotonic: reading.monotonic.after(-delay_us),
            utc: reading.utc.after(-delay_us),
            ..reading
        };
        let mut duties = Duties {
            task,
            began,
            complete: None,
            vouched: None,
            vouch_due: now + times.vouch,
            clock: log.map(|log| NowAndThen::every(log.life, times.look_at_clock)),
            arrival_due: now,
            moved_at: None,
            left_out,
            left_out_due: now,
            set_due,
            unsaid: Vec::new(),
        };
        duties.set_due = duties.set_due.or_else(|| duties.next_setting());
        duties
    }

    /// What the recorder's filters had left out when it was last asked.
    pub(super) fn left_out(&mut self) -> Option<Suppressed> {
        self.left_out.take()
    }

    /// When the clock is to be set next, in microseconds of UTC.
    pub(super) const fn set_due(&self) -> Option<i64> {
        self.set_due
    }

    /// Takes note of a reading that has just ended. `complete_at` is by when the log is known to
    /// have held nothing else.
    pub(super) fn read(&mut self, filing: &mut Filing<'_>, complete_at: Option<Duration>) {
        let arrivals = filing.take_arrivals();
        if arrivals.last.is_some() {
            self.moved_at = Some(Instant::now());
        }
        self.take_arrivals(arrivals);
        if let (Some(at), Some((life, cursor))) = (complete_at, filing.place()) {
            self.complete = Some((host_reading::moment(at), life, cursor.sequence));
        }
    }

    /// Does what is due now, and adds what came of it to `records`, also where something fails
    /// afterwards. The recorder has been quiet in the last step if `is_idle` says so.
    pub(super) fn due(
        &mut self,
        unit: &mut Unit,
        filing: &Filing<'_>,
        is_idle: bool,
        records: &mut Vec<Record>,
    ) -> Result<(), Trouble> {
        records.append(&mut self.unsaid);
        let Some(place) = filing.place().filter(|_| is_idle) else { return Ok(()) };
        let is_over = self.is_incident_over();
        if is_over && let Some(clock) = &mut self.clock {
            clock.soon();
        }
        if let Some(clock) = &mut self.clock {
            records.extend(clock.step(unit, place)?.map(Record::Clock));
        }
        if Instant::now() >= self.left_out_due {
            records.extend(self.look_at_left_out(unit)?);
        }
        if self.is_setting_due() {
            records.extend(self.set_clock(unit, filing)?);
        }
        if is_over || Instant::now() >= self.vouch_due {
            self.look_at_end(unit, place)?;
            records.extend(self.vouch());
        }
        Ok(())
    }

    /// Looks whether the log holds nothing else right now. A reading proves that for a time as long
    /// ago as a report may have been on the line, which may be before the end of an incident.
    fn look_at_end(
        &mut self,
        unit: &mut Unit,
        (life, cursor): (Life, Cursor),
    ) -> Result<(), RequestError> {
        if let Some(at) = nothing_after(unit, cursor)? {
            self.complete = Some((host_reading::moment(at), life, cursor.sequence));
        }
        Ok(())
    }

    /// The last looks before the end. No failure is one here.
    pub(super) fn last(&mut self, unit: &mut Unit, filing: &Filing<'_>) -> Vec<Record> {
        let mut records = std::mem::take(&mut self.unsaid);
        if let (Some(log), Some((life, cursor))) = (filing.log(), filing.place()) {
            let looks = clock_look::take(unit).ok().flatten();
            let seen = looks
                .and_then(|looks| looks.observation(looks.place(life, cursor, Some(log.life))?));
            records.extend(seen.map(Record::Clock));
            records.extend(self.look_at_left_out(unit).ok().flatten());
        }
        if let Some(place) = filing.place() {
            // Then it is what was known before.
            _ = self.look_at_end(unit, place);
        }
        records.extend(self.vouch());
        records
    }

    /// For which time nothing is missing, if that is more than was said before.
    pub(super) fn vouch(&mut self) -> Option<Record> {
        self.vouch_due = Instant::now() + self.task.shared.options.times.vouch;
        let (at, life, through) = self.complete?;
        if self.vouched == Some(at) {
            return None;
        }
        self.vouched = Some(at);
        let to = host_reading::at(Duration::from_micros(u64::try_from(at.us()).unwrap_or(0)));
        Some(Record::Watched(Watched { life, from: self.began, to, through }))
    }

    /// Whether the recorder has just become quiet after an incident.
    fn is_incident_over(&mut self) -> bool {
        let quiet_us = self.task.shared.options.site.incident.quiet_us;
        let quiet = Duration::from_micros(u64::try_from(quiet_us).unwrap_or(0));
        self.moved_at.take_if(|at| at.elapsed() >= quiet).is_some()
    }

    /// An original recorder's clock cannot be asked. It showed the stamp of an entry at some time
    /// between two readings.
    fn take_arrivals(&mut self, arrivals: Arrivals) {
        let Some((complete_at, ..)) = self.complete.filter(|_| self.clock.is_none()) else {
            return;
        };
        if Instant::now() < self.arrival_due {
            return;
        }
        let of = |record: &EntryRecord| (record.life, record.sequence);
        let first = arrivals.first;
        let last = arrivals
            .last
            .filter(|last| first.is_none_or(|first| of(&first.record) != of(&last.record)));
        for arrived in first.into_iter().chain(last) {
            let seen = seen_at(&arrived.record, complete_at, arrived.at);
            self.unsaid.extend(seen.map(Record::Clock));
            self.arrival_due = Instant::now() + self.task.shared.options.times.take_arrival;
        }
    }

    /// What filters left out, if that is news.
    fn look_at_left_out(&mut self, unit: &mut Unit) -> Result<Option<Record>, RequestError> {
        self.left_out_due = Instant::now() + self.task.shared.options.times.look_at_left_out;
        let looked = match left_out(unit) {
            Ok(looked) => looked,
            // Its answer may have been lost, and the next look comes.
            Err(RequestError::NoReply { .. }) => None,
            Err(error) => return Err(error),
        };
        let Some(look) = looked else { return Ok(None) };
        let is_news = match &self.left_out {
            None => true,
            Some(before) => !look.continues(before) || !look.since(Some(before)).is_empty(),
        };
        if is_news {
            self.left_out = Some(look.clone());
        }
        Ok(is_news.then_some(Record::Suppressed(look)))
    }

    /// The next time at which the clock is to be set, in microseconds of UTC.
    fn next_setting(&self) -> Option<i64> {
        let options = &self.task.shared.options;
        let now_us = host_reading::now().utc.us();
        next_daily(options.set_clocks?, now_us, &options.site.time_zone)
    }

    /// Not in the middle of an incident: its entries would be on both sides of a step.
    fn is_setting_due(&mut self) -> bool {
        let now_us = host_reading::now().utc.us();
        if self.set_due.is_some_and(|due| due > now_us.saturating_add(LONGEST_DAY_US)) {
            // The clock of this computer was ahead when that was reckoned.
            self.set_due = self.next_setting();
        }
        self.moved_at.is_none() && self.set_due.is_some_and(|due| due <= now_us)
    }

    fn set_clock(
        &mut self,
        unit: &mut Unit,
        filing: &Filing<'_>,
    ) -> Result<Vec<Record>, RequestError> {
        let (recorder, site) = (&self.task.recorder, &self.task.shared.options.site);
        let setting = ClockSetting::of(recorder.clock, site);
        // A setting that fails before it begins is due still.
        let look = LogLook::take(unit)?;
        self.set_due = self.next_setting();
        let last_read = filing.place().and_then(|(life, cursor)| {
            Some(EntryRecord {
                life,
                sequence: Some(cursor.sequence),
                number: 0,
                entry: cursor.anchor?,
                known: EntryRecord::ALL_KNOWN,
            })
        });
        let life = filing.place().map_or(Life::UNKNOWN, |(life, _)| life);
        let before = look.named(|| life, || last_read);
        let time_at = &mut |ahead| setting.time_in(ahead).unwrap_or(setting::NO_TIME);
        let number = filing.log().map(|log| log.life);
        let set = set_clock(unit, &before, number, time_at);
        match set.sent {
            Ok(sent) => info!("{}: its clock was set to {sent} ({setting})", recorder.name),
            Err(error) => {
                warn!("{}: whether its clock was set is not known: {error}", recorder.name);
            }
        }
        Ok(set.records)
    }
}

/// The next such time of the day after a moment, both in microseconds of UTC. In a night in which
/// the clocks go forward it may be an hour later.
fn next_daily(time: DailyTime, now_us: i64, zone: &TimeZone) -> Option<i64> {
    let now = jiff::Timestamp::from_microsecond(now_us).ok()?;
    let (hour, minute) = time.of_day();
    let time = civil::Time::new(hour, minute, 0, 0).ok()?;
    let today = zone.to_datetime(now).date();
    let days = [Some(today), today.tomorrow().ok(), today.tomorrow().ok()?.tomorrow().ok()];
    days.into_iter().flatten().find_map(|day| {
        let at = zone.to_timestamp(day.to_datetime(time)).ok()?;
        (at > now).then(|| at.as_microsecond())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_is_set_at_the_same_local_time_each_day() {
        let zone = TimeZone::get("Europe/Berlin").unwrap();
        let us = |text: &str| text.parse::<jiff::Timestamp>().unwrap().as_microsecond();
        let next = |now: &str, at: &str| next_daily(at.parse().unwrap(), us(now), &zone);
        assert_eq!(next("2026-11-22T01:00:00Z", "03:30"), Some(us("2026-11-22T02:30:00Z")));
        assert_eq!(next("2026-11-22T02:30:00Z", "03:30"), Some(us("2026-11-23T02:30:00Z")));
        assert_eq!(next("2026-07-01T12:00:00Z", "00:00"), Some(us("2026-07-01T22:00:00Z")));
        // 02:30 is left out that night.
        assert_eq!(next("2026-03-29T00:00:00Z", "02:30"), Some(us("2026-03-29T01:30:00Z")));
    }
}
