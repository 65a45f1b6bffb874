//! What a recorder's clock shows, by asking it several times in a row.
//!
//! Each answer says between which two times of this computer the clock showed something. All of
//! them are about one clock that runs at a steady rate, so the truth is in what they have in
//! common. Only recorders with our extension can be asked.

use std::thread;
use std::time::Duration;

use ser_client::{ClockLook, Cursor, RequestError, Unit};
use ser_evidence::record::{ClockObservation, How, Life, Place, Reference};
use ser_evidence::time::{Bound, Host, Moment, Shown, stamp};
use ser_proto::ClockReading;

use crate::clock_setting::ClockSetting;
use crate::host_reading;

/// How many answers are wanted.
const ROUNDS: u32 = 4;

/// How many questions are asked at most, where answers are lost or the clock is set meanwhile.
const MAX_QUESTIONS: u32 = 3 * ROUNDS;

/// How long after a change these recorders may write its entry: they hold it back for up to 320 ms.
/// What is not in the log at the end of the questions came after their beginning.
const HOLD_BACK: Duration = Duration::from_millis(400);

/// How often the clock of a recorder is asked for that is watched.
const LOOK_EVERY: Duration = Duration::from_secs(300);

/// How much faster or slower than this computer a clock may run, in parts per million. Crystals are
/// better than that.
const RATE_PPM: u64 = 200;

/// What recorders count in.
const MS_US: i64 = 1000;

/// Questions about a clock, one after the other.
#[derive(Debug, Default)]
pub struct Questions {
    asked: u32,
    last_asked: Option<Duration>,
    looks: Vec<ClockLook>,
    is_over: bool,
}

/// Answers about one clock that was not set between them, in their order; at least one.
#[derive(Clone, Debug)]
pub struct Looks(Vec<ClockLook>);

/// Asks until enough is known; `None` where the recorder cannot be asked or does not answer.
pub fn take(unit: &mut Unit) -> Result<Option<Looks>, RequestError> {
    let mut questions = Questions::default();
    while !questions.is_over() {
        thread::sleep(questions.wait(unit.now()));
        questions.ask(unit)?;
    }
    Ok(questions.answers())
}

/// Asks now and then, a question at a time, so that nothing else waits.
#[derive(Debug)]
pub struct NowAndThen {
    /// The questions under way, and how far the log had been read before the first of them.
    under_way: Option<(Questions, (Life, Cursor))>,
    /// When the next ones begin.
    due: Duration,
    every: Duration,
    /// The number that the recorder gives to the life of the log that is read, as it said last.
    said: u32,
    /// How that life is called, once there was an answer in it.
    called: Option<Life>,
}

impl NowAndThen {
    /// Begins at once, in the life of which the recorder `said` this number.
    pub const fn new(said: u32) -> NowAndThen {
        NowAndThen::every(said, LOOK_EVERY)
    }

    /// The same, so often.
    #[must_use]
    pub const fn every(said: u32, every: Duration) -> NowAndThen {
        NowAndThen { under_way: None, due: Duration::ZERO, every, said, called: None }
    }

    /// Asks at the next step.
    pub const fn soon(&mut self) {
        self.due = Duration::ZERO;
    }

    /// Asks if it is time to; the log has been read as far as `place` says. Returns what was
    /// observed in the end.
    pub fn step(
        &mut self,
        unit: &mut Unit,
        (life, cursor): (Life, Cursor),
    ) -> Result<Option<ClockObservation>, RequestError> {
        let now = unit.now();
        if self.under_way.is_none() && now < self.due {
            return Ok(None);
        }
        let (questions, _) =
            self.under_way.get_or_insert_with(|| (Questions::default(), (life, cursor)));
        if questions.wait(now).is_zero() {
            self.due = now + self.every;
            let asked = questions.ask(unit);
            if asked.is_err() {
                self.under_way = None;
                asked?;
            }
        }
        let over = self.under_way.take_if(|(questions, _)| questions.is_over());
        let observed = over.filter(|(_, (before, _))| *before == life).and_then(
            |(questions, (life, cursor))| {
                let looks = questions.answers()?;
                let said = self.number_of(life, &looks)?;
                looks.observation(looks.place(life, cursor, Some(said))?)
            },
        );
        Ok(observed)
    }

    /// The number of the life that is called so. A log that was found to have begun anew has the
    /// number of the first answer after that.
    fn number_of(&mut self, life: Life, looks: &Looks) -> Option<u32> {
        if self.called.is_some_and(|called| called != life) {
            self.said = looks.last()?.life;
        }
        self.called = Some(life);
        Some(self.said)
    }
}

impl Questions {
    /// Whether nothing more is asked.
    pub const fn is_over(&self) -> bool {
        self.is_over
    }

    /// How long to wait until the next question, so that the last one comes late enough.
    pub fn wait(&self, now: Duration) -> Duration {
        let pause = HOLD_BACK / (ROUNDS - 1);
        let due = self.last_asked.map_or(Duration::ZERO, |asked| asked + pause);
        due.saturating_sub(now)
    }

    /// Asks once.
    pub fn ask(&mut self, unit: &mut Unit) -> Result<(), RequestError> {
        self.last_asked = Some(unit.now());
        self.asked += 1;
        match unit.clock_look() {
            Ok(Some(look)) => self.take(look),
            Ok(None) => self.is_over = true,
            // One may have been lost. Nobody waits for more than two.
            Err(RequestError::NoReply { .. }) => {
                self.is_over = self.asked > 1;
            }
            Err(error) => return Err(error),
        }
        self.is_over |= self.asked >= MAX_QUESTIONS;
        Ok(())
    }

    fn take(&mut self, look: ClockLook) {
        if self.looks.first().is_some_and(|first| !is_same_clock(&first.reading, &look.reading)) {
            self.looks.clear();
        }
        self.looks.push(look);
        let first = self.looks.first().map_or(look.between.0, |first| first.between.0);
        let lasted = look.between.0.saturating_sub(first);
        self.is_over = self.looks.len() >= ROUNDS as usize && lasted >= HOLD_BACK;
    }

    /// What was answered.
    pub fn answers(self) -> Option<Looks> {
        (!self.looks.is_empty()).then_some(Looks(self.looks))
    }
}

/// Whether the clock was not set between two readings, and the log not begun anew. Against the
/// counter that nobody sets, a clock moves only by what disciplines it.
fn is_same_clock(one: &ClockReading, other: &ClockReading) -> bool {
    let ahead = |reading: &ClockReading| i128::from(reading.clock_us) - i128::from(reading.tick_us);
    let moved = (ahead(one) - ahead(other)).unsigned_abs();
    let room = u128::from(rate_us(one.tick_us.abs_diff(other.tick_us)));
    (one.life, one.source) == (other.life, other.source) && moved <= room
}

/// By how much a clock may gain or lose in this time.
const fn rate_us(elapsed_us: u64) -> u64 {
    elapsed_us.div_ceil(1_000_000 / RATE_PPM)
}

impl Looks {
    /// The first answer, of whose moment the others tell more.
    pub fn first(&self) -> Option<&ClockReading> {
        self.0.first().map(|look| &look.reading)
    }

    /// The last answer.
    pub fn last(&self) -> Option<&ClockReading> {
        self.0.last().map(|look| &look.reading)
    }

    /// The recorder's total in this life when it answered last, as other replies show it. `None` if
    /// the log is another one by then, or if that was so soon that changes from before the first
    /// answer may not have been in the log yet.
    pub fn last_total(&self, life: u32) -> Option<u16> {
        // Modulo 65536 is what totals are.
        let last = self.last().filter(|_| self.lasted() >= HOLD_BACK)?;
        if last.life != life {
            return None;
        }
        Some(total(last.next_sequence))
    }

    /// From the first question to the last.
    fn lasted(&self) -> Duration {
        let (Some(first), Some(last)) = (self.0.first(), self.0.last()) else {
            return Duration::ZERO;
        };
        last.between.0.saturating_sub(first.between.0)
    }

    /// The millisecond that the clock showed at the first answer, and when it began to show it.
    /// `None` if a stamp cannot express it.
    pub fn shown(&self) -> Option<(Moment<Shown>, Bound<Host>)> {
        let first = self.first()?;
        let into_ms = first.clock_us.rem_euclid(MS_US);
        let shown = Moment::from_us(first.clock_us.checked_sub(into_ms)?);
        stamp(shown)?;
        let mut each = self.0.iter().map(|look| beginning(look, shown));
        let first = each.next()?;
        let (common, hull) = each.fold((first, first), |(common, hull), bound| {
            (common.intersection(bound), hull.hull(bound))
        });
        // If two of them cannot both be right, any of them may be.
        Some((shown, if common.is_empty() { hull } else { common }))
    }

    /// How many answers there are.
    pub fn rounds(&self) -> usize {
        self.0.len()
    }

    /// How far the clock was ahead of this computer's monotonic one at each answer, at least and at
    /// most, and when that was; in microseconds.
    pub fn ahead(&self) -> impl Iterator<Item = (i64, (i64, i64))> {
        self.0.iter().map(|look| {
            let us = |time: Duration| host_reading::moment(time).us();
            let (from, to) = (us(look.between.0), us(look.between.1).saturating_add(1));
            let clock_us = look.reading.clock_us;
            let most = clock_us.saturating_add(unit_us(&look.reading)).saturating_sub(from);
            (from.midpoint(to), (clock_us.saturating_sub(to), most))
        })
    }

    /// How far the clock was ahead of what it should show when it was asked last, at least and at
    /// most, in microseconds. `None` where that cannot be told.
    pub fn ahead_of(&self, setting: &ClockSetting) -> Option<(i64, i64)> {
        let (asked_us, last) = self.ahead().last()?;
        let known = |(least, most): (i64, i64)| Bound::<Host>::from_us(least, most);
        let each = self.ahead().map(|(at_us, (least, most))| {
            let room = i64::try_from(rate_us(asked_us.abs_diff(at_us))).unwrap_or(i64::MAX);
            known((least.saturating_sub(room), most.saturating_add(room)))
        });
        let (common, hull) = each.fold((known(last), known(last)), |(common, hull), bound| {
            (common.intersection(bound), hull.hull(bound))
        });
        let bound = if common.is_empty() { hull } else { common };
        let (least, most) = (bound.lo()?.us(), bound.hi()?.us());
        let asked = Duration::from_micros(u64::try_from(asked_us).ok()?);
        // From this computer's monotonic clock to what the recorder's should show.
        let zone_us = setting.shown_us(host_reading::at(asked).utc.us())?.checked_sub(asked_us)?;
        Some((least.checked_sub(zone_us)?, most.checked_sub(zone_us)?))
    }

    /// With later answers; without these, if the clock was set in between.
    pub fn and(mut self, later: Looks) -> Looks {
        let is_same = match (self.last(), later.first()) {
            (Some(last), Some(first)) => is_same_clock(last, first),
            _ => false,
        };
        if !is_same {
            return later;
        }
        self.0.extend(later.0);
        self
    }

    /// The observation that they are, at this place.
    pub fn observation(&self, place: Place) -> Option<ClockObservation> {
        let (shown, bound) = self.shown()?;
        let asked = self.0.first()?.between.1;
        let at = Reference::Host { bound, reading: host_reading::at(asked) };
        Some(ClockObservation { how: How::Query, shown, at, place })
    }

    /// Where in a log they were made that had been read up to `cursor` a moment before. The
    /// recorder had `said` which life that is.
    ///
    /// `None` if this may be another log, where nothing tells which log it is, or if the last
    /// answer came too soon: an entry from before the first one may then have been held back beyond
    /// it.
    pub fn place(&self, life: Life, cursor: Cursor, said: Option<u32>) -> Option<Place> {
        let (first, last) = (self.first()?, self.last()?);
        if self.lasted() < HOLD_BACK {
            return None;
        }
        // Erased and filled again, a log can look like more of the same.
        if said.is_some_and(|said| said != first.life) {
            return None;
        }
        let is_earlier = first.next_sequence <= cursor.sequence;
        let ahead = |reading: &ClockReading| {
            u64::from(total(reading.next_sequence).wrapping_sub(cursor.total()))
        };
        if (cursor.is_exact && is_earlier) || ahead(last) > MAX_AHEAD || ahead(first) > ahead(last)
        {
            return None;
        }
        if !life.is_known() && cursor.anchor.is_none() {
            return None;
        }
        let after = cursor.sequence;
        Some(Place {
            life,
            after: Some(after),
            before: Some(after.saturating_add(ahead(last))),
            newest: cursor.anchor,
            fellow: None,
        })
    }
}

/// How many entries may have come since the log was read. More are another log, or a busy time.
const MAX_AHEAD: u64 = 1000;

/// The total before the next entry.
#[expect(clippy::cast_possible_truncation, reason = "the low 16 bits are what is wanted")]
const fn total(next_sequence: u64) -> u16 {
    next_sequence.wrapping_sub(1) as u16
}

/// When the clock began to show a millisecond, by one answer.
fn beginning(look: &ClockLook, shown: Moment<Shown>) -> Bound<Host> {
    let ClockLook { reading, between } = look;
    let since_us = reading.clock_us.saturating_sub(shown.us());
    let rate_us = i64::try_from(rate_us(since_us.unsigned_abs())).unwrap_or(i64::MAX);
    let unit_us = unit_us(reading);
    let moment = |time: Duration| host_reading::moment(time).after(-since_us);
    let (from, to) = (moment(between.0), moment(between.1));
    // Half microseconds of this computer are cut off.
    Bound::new(Some(from.after(-unit_us - rate_us)), Some(to.after(1 + rate_us)))
}

/// On a bus, and where nothing counts finer, the moment of arrival is known to the millisecond.
const fn unit_us(reading: &ClockReading) -> i64 {
    if reading.clock_us % MS_US == 0 { MS_US } else { 1 }
}

#[cfg(test)]
mod tests {
    use oorandom::Rand64;
    use ser_evidence::site::{ClockRule, Site};
    use ser_proto::ClockSource;

    use super::*;

    const NOON: i64 = 1_795_348_800_000_000;

    fn look(from_us: u64, to_us: u64, clock_us: i64, tick_us: u64) -> ClockLook {
        let reading = ClockReading {
            token: 0,
            clock_us,
            source: ClockSource::HostOverRs232,
            age_s: 1,
            doubt_us: None,
            drift_ppb: None,
            tick_us,
            life: 7,
            next_sequence: 5,
            last_mark: None,
        };
        ClockLook {
            reading,
            between: (Duration::from_micros(from_us), Duration::from_micros(to_us)),
        }
    }

    fn bound(looks: &[ClockLook]) -> Bound<Host> {
        Looks(looks.to_vec()).shown().unwrap().1
    }

    #[test]
    fn what_several_answers_have_in_common_holds_the_truth_and_is_narrower_than_each() {
        let mut chance = Rand64::new(7);
        let mut below = |limit: u64| chance.rand_range(0..limit);
        for _ in 0..2000 {
            let (offset_us, counts_ms) = (NOON + below(1000) as i64, below(2) == 0);
            // In parts per million of this computer's time.
            let rate_ppm = below(2 * RATE_PPM - 1) as i64 - (RATE_PPM as i64 - 1);
            let clock = |at_us: u64| offset_us + at_us as i64 + at_us as i64 * rate_ppm / 1_000_000;
            let mut at_us = 0;
            let looks: Vec<ClockLook> = (0..ROUNDS)
                .map(|_| {
                    at_us += 1000 + below(200_000);
                    let clock_us = clock(at_us);
                    let told_us = if counts_ms { clock_us - clock_us % 1000 } else { clock_us };
                    look(at_us - below(1000), at_us + below(100_000), told_us, at_us)
                })
                .collect();
            let (shown, bound) = Looks(looks.clone()).shown().unwrap();
            // The clock began to show it when it had this much less to go.
            let truth =
                (0..200_001 + 1000_u64).rev().find(|at| clock(*at) < shown.us()).map(|at| at + 1);
            let truth = truth.unwrap_or_default();
            assert!(
                truth == 0 || bound.contains(Moment::from_us(truth as i64)),
                "{truth} {bound:?} {looks:?}"
            );
            let alone = looks.iter().map(|look| beginning(look, shown).width_us().unwrap()).min();
            assert!(bound.width_us() <= alone);
        }
    }

    #[test]
    fn a_clock_that_shows_whole_milliseconds_is_known_to_one() {
        assert_eq!(bound(&[look(5000, 6000, NOON, 0)]), Bound::from_us(4000, 6001));
        // It showed its 250th microsecond then.
        assert_eq!(bound(&[look(5000, 6000, NOON + 250, 0)]), Bound::from_us(4748, 5752));
    }

    #[test]
    fn a_clock_is_ahead_by_what_all_answers_allow() {
        let utc = ClockSetting::of(ClockRule::Utc, &Site::unknown());
        let here = host_reading::now();
        let (asked_us, utc_us) = (here.monotonic.us(), here.utc.us());
        let seen = |from: i64, to: i64| {
            let us = |offset: i64| u64::try_from(asked_us + offset).unwrap();
            // It counts microseconds, and is five milliseconds fast.
            let clock_us = (utc_us + from + 5000) / 2 * 2 + 1;
            look(us(from), us(to), clock_us, us(from))
        };
        let looks = Looks(vec![seen(-30_000, -10_000), seen(-8000, -7600), seen(-1000, 0)]);
        let (least, most) = looks.ahead_of(&utc).unwrap();
        // The second answer says most. This computer's clocks may part by some microseconds.
        assert!((4500..=4650).contains(&least) && (4990..=5100).contains(&most), "{least} {most}");
        let never = ClockReading { clock_us: i64::MIN, ..*looks.last().unwrap() };
        let between = (Duration::ZERO, Duration::ZERO);
        assert_eq!(Looks(vec![ClockLook { reading: never, between }]).ahead_of(&utc), None);
    }

    #[test]
    fn a_clock_at_the_end_of_its_range_shows_nothing_and_is_no_observation() {
        for clock_us in [i64::MIN, i64::MIN + 1, i64::MAX] {
            let looks = Looks(vec![look(5000, 6000, clock_us, 0)]);
            assert_eq!(looks.shown(), None, "{clock_us}");
            assert_eq!(looks.ahead().count(), 1);
            assert_eq!(looks.observation(Place::UNKNOWN), None);
        }
    }

    #[test]
    fn answers_that_cannot_both_be_right_are_both_allowed_for() {
        let looks = [look(5000, 6000, NOON, 0), look(9000, 9100, NOON + 1000, 1000)];
        assert_eq!(bound(&looks), Bound::from_us(4000, 8102));
    }

    #[test]
    fn a_clock_that_was_set_between_two_answers_is_another_one() {
        let (before, after) = (look(0, 100, NOON, 0), look(200, 300, NOON + 200, 200));
        let mut questions = Questions::default();
        questions.take(before);
        questions.take(after);
        assert_eq!(questions.looks.len(), 2);
        let set = look(400, 500, NOON + 900, 400);
        let erased = ClockReading { life: 8, ..look(0, 0, NOON + 1100, 600).reading };
        for other in [set, ClockLook { reading: erased, ..set }] {
            questions.take(other);
            assert_eq!(questions.looks, [other]);
        }
    }

    #[test]
    fn the_place_is_between_the_log_that_was_read_and_that_at_the_last_answer() {
        let at = |ms: u64, next_sequence| {
            let mut look = look(ms * 1000, ms * 1000 + 100, NOON, 0);
            look.reading.next_sequence = next_sequence;
            look
        };
        let life = Life::from_bits(9);
        let looks = |last_ms, [first, last]: [u64; 2]| Looks(vec![at(0, first), at(last_ms, last)]);
        let place = |next, sequence, is_exact| {
            let cursor = Cursor { sequence, is_exact, anchor: None };
            let place = looks(400, next).place(life, cursor, Some(7))?;
            Some((place.after?, place.before?))
        };
        assert_eq!(place([5, 5], 4, true), Some((4, 4)));
        assert_eq!(place([5, 7], 4, true), Some((4, 6)));
        assert_eq!(place([65_541, 65_541], 4, false), Some((4, 4)), "only a host has lost count");
        assert_eq!(place([4, 4], 4, true), None, "another log");
        assert_eq!(place([1, 1], 70_000, true), None, "another log");
        assert_eq!(place([5, 2000], 4, true), None, "nobody has read what came between");
        let nowhere = Cursor { sequence: 4, is_exact: true, anchor: None };
        assert_eq!(looks(400, [5, 5]).place(Life::UNKNOWN, nowhere, None), None);
        let again = |said| looks(400, [7, 7]).place(life, nowhere, said).is_some();
        assert!(again(Some(7)) && again(None));
        assert!(!again(Some(6)), "erased and filled again since it was read");
        // A change from before the first answer may be held back beyond the last one.
        assert_eq!(looks(399, [5, 7]).place(life, nowhere, None), None);
        assert_eq!(
            (looks(399, [5, 7]).last_total(7), looks(400, [5, 7]).last_total(7)),
            (None, Some(6))
        );
        assert_eq!(looks(400, [5, 7]).last_total(6), None, "another log");
    }

    #[test]
    fn an_answer_from_a_life_that_nobody_has_read_is_of_no_life_that_is_watched() {
        let answered = |number| {
            let mut look = look(0, 100, NOON, 0);
            look.reading.life = number;
            Looks(vec![look])
        };
        let (read, next) = (Life::from_bits(1), Life::from_bits(2));
        let mut watched = NowAndThen::new(7);
        assert_eq!(watched.number_of(read, &answered(7)), Some(7));
        assert_eq!(watched.number_of(read, &answered(8)), Some(7), "erased, and not read yet");
        assert_eq!(watched.number_of(next, &answered(8)), Some(8), "found to have begun anew");
        assert_eq!(watched.number_of(next, &answered(9)), Some(8));
    }
}
