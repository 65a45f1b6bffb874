//! What a recorder must answer to the questions of our extension, worked out when they arrive.

use std::collections::VecDeque;
use std::ops::RangeInclusive;

use ser_proto::{
    Capabilities, ClockReading, ClockSource, Counter, Counters, Filters, Identity, Mark, Model,
};

use super::counts::Bounds;
use super::filter_orders::{FilterOrder, FilterTable, FiltersQuestion};
use super::port::Port;
use super::wrong::Wrong;

/// How long an answer may be on its way over the bus, where not every question gets one.
const ANSWERED_WITHIN_MS: u64 = 120_000;

/// A question for the time.
#[derive(Clone, Debug)]
pub struct TimeQuestion {
    /// Its token.
    pub token: u16,
    /// What the clock showed in the millisecond of its arrival.
    pub clock_us: i64,
    /// Where the clock had its time from then, and for how many seconds.
    pub source: (ClockSource, u32),
    /// How long the recorder had been on.
    pub tick_us: u64,
    /// Which lives of the log it can have been.
    pub lives: RangeInclusive<u64>,
    /// How many events the log can have counted then, by the places that its latest erase can have.
    pub events: Vec<RangeInclusive<u64>>,
}

impl TimeQuestion {
    /// Whether an answer is true but for the last mark, which is that of a later moment.
    fn is_answered_by(&self, reading: &ClockReading) -> bool {
        let ClockReading { token, clock_us, source, age_s, tick_us, life, .. } = *reading;
        let events = reading.next_sequence.wrapping_sub(1);
        (token, clock_us, tick_us) == (self.token, self.clock_us, self.tick_us)
            && (source, age_s) == self.source
            && (reading.doubt_us, reading.drift_ppb) == (None, None)
            && self.lives.contains(&life.into())
            && self.events.iter().any(|range| range.contains(&events))
    }
}

/// Questions of one kind, the oldest first, with the port that each came by and when.
///
/// On the line each is answered, in order. On the bus questions and answers get lost.
#[derive(Clone, Debug)]
struct Asked<T>(VecDeque<(Port, u64, T)>);

impl<T> Default for Asked<T> {
    fn default() -> Asked<T> {
        Asked(VecDeque::new())
    }
}

impl<T> Asked<T> {
    fn ask(&mut self, port: Port, at_ms: u64, question: T) {
        let is_over =
            |of: &Port, asked_ms: &u64| *of == Port::Bus && asked_ms + ANSWERED_WITHIN_MS < at_ms;
        self.0.retain(|(of, asked_ms, _)| !is_over(of, asked_ms));
        self.0.push_back((port, at_ms, question));
    }

    /// The questions that an answer that is seen now can belong to.
    fn open(&self, port: Port, now_ms: u64) -> impl Iterator<Item = &T> {
        self.all_open(port, now_ms).take(if port == Port::Line { 1 } else { usize::MAX })
    }

    /// The questions that have not been answered for certain, nor are too old for it.
    fn all_open(&self, port: Port, now_ms: u64) -> impl Iterator<Item = &T> {
        let is_open = move |of: Port, at_ms: u64| {
            of == port && (port == Port::Line || at_ms + ANSWERED_WITHIN_MS >= now_ms)
        };
        let open = self.0.iter().filter(move |(of, at_ms, _)| is_open(*of, *at_ms));
        open.map(|(.., question)| question)
    }

    /// An answer was seen.
    fn close(&mut self, port: Port) {
        if port == Port::Line
            && let Some(first) = self.0.iter().position(|(of, ..)| *of == port)
        {
            self.0.remove(first);
        }
    }
}

/// How many questions were answered, and how.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Answers {
    /// Times, each true.
    pub times: u64,
    /// Times that told of a mark, each true.
    pub marks: u64,
    /// Times of a clock that a host had set.
    pub set_times: u64,
    /// Identities.
    pub identities: u64,
    /// Pages of counters.
    pub counters: u64,
    /// Pages of filters.
    pub filters: u64,
}

/// The questions since power-up, and what all answers of a recorder have in common.
#[derive(Clone, Debug, Default)]
pub struct Questions {
    /// Each with the number of marks before.
    times: Asked<(usize, TimeQuestion)>,
    counters: Asked<(Counter, Bounds)>,
    filters: Asked<FiltersQuestion>,
    /// Marks, the latest last, and none at power-up.
    marks: Vec<Option<Mark>>,
    /// How many true answers there were, in all lives.
    pub answers: Answers,
}

impl Questions {
    /// The power comes on: nobody has asked.
    pub fn power_up(&mut self) {
        *self = Questions { answers: self.answers, marks: vec![None], ..Questions::default() };
    }

    /// Somebody asks for the time.
    pub fn ask_time(&mut self, port: Port, now_ms: u64, question: TimeQuestion) {
        self.times.ask(port, now_ms, (self.marks.len() - 1, question));
    }

    /// Somebody asks for counters, when they are within these bounds.
    pub fn ask_counters(&mut self, port: Port, now_ms: u64, first: Counter, bounds: Bounds) {
        self.counters.ask(port, now_ms, (first, bounds));
    }

    /// Somebody asks for filters, or orders one.
    pub fn ask_filters(&mut self, port: Port, now_ms: u64, question: FiltersQuestion) {
        self.filters.ask(port, now_ms, question);
    }

    /// The orders that the recorder may still carry out.
    pub fn filters_ordered(&self, now_ms: u64) -> impl Iterator<Item = &FilterOrder> {
        let open = [Port::Line, Port::Bus];
        let open = open.into_iter().flat_map(move |port| self.filters.all_open(port, now_ms));
        open.filter_map(|question| question.order.as_ref())
    }

    /// Checks an answer that tells filters. `tables` are all that were in force since power-up.
    ///
    /// # Errors
    /// When the recorder tells others.
    pub fn check_filters(
        &mut self,
        port: Port,
        now_ms: u64,
        page: &Filters,
        tables: &[FilterTable],
        inputs: u8,
    ) -> Result<(), String> {
        let is_true = |asked: &&FiltersQuestion| asked.is_answered_by(page, tables, inputs);
        if self.filters.open(port, now_ms).find(is_true).is_none() {
            let asked: Vec<_> = self.filters.open(port, now_ms).collect();
            return Wrong::new("the recorder tells of filters that are not in force")
                .fact("told", format_args!("{page:?}"))
                .fact("in force", format_args!("{:?}", tables.last()))
                .fact("asked", format_args!("{asked:?}"))
                .err();
        }
        self.filters.close(port);
        self.answers.filters += 1;
        Ok(())
    }

    /// A mark arrives.
    pub fn mark(&mut self, mark: Mark) {
        self.marks.push(Some(mark));
    }

    /// Checks an answer for the time.
    ///
    /// # Errors
    /// When it is not true.
    pub fn check_time(
        &mut self,
        port: Port,
        now_ms: u64,
        reading: &ClockReading,
    ) -> Result<(), String> {
        let Questions { times, marks, answers, .. } = self;
        let is_true = |(mark, asked): &&(usize, TimeQuestion)| {
            // The last mark is that of the moment at which the answer is made.
            asked.is_answered_by(reading) && marks[*mark..].contains(&reading.last_mark)
        };
        if times.open(port, now_ms).find(is_true).is_none() {
            let asked: Vec<_> = times.open(port, now_ms).collect();
            return Wrong::new("the recorder tells another time than that of the question")
                .fact("told", format_args!("{reading:?}"))
                .fact("true", format_args!("{asked:?}"))
                .fact("marks", format_args!("{marks:?}"))
                .err();
        }
        times.close(port);
        answers.times += 1;
        answers.marks += u64::from(reading.last_mark.is_some());
        let is_set =
            matches!(reading.source, ClockSource::HostOverRs232 | ClockSource::HostOverGenius);
        answers.set_times += u64::from(is_set);
        Ok(())
    }

    /// Checks a page of counters, which are at most so many by now.
    ///
    /// # Errors
    /// When it tells more, or fewer than when it was asked for.
    pub fn check_counters(
        &mut self,
        port: Port,
        now_ms: u64,
        page: &Counters,
        bounds: &Bounds,
    ) -> Result<(), String> {
        let mut wrong = Err(format!("nobody has asked for these counters: {page:?}"));
        for (first, least) in self.counters.open(port, now_ms) {
            wrong = least.check(*first, page, bounds);
            if wrong.is_ok() {
                break;
            }
        }
        wrong?;
        self.counters.close(port);
        self.answers.counters += 1;
        Ok(())
    }

    /// Checks who a recorder says that it is.
    ///
    /// # Errors
    /// When it is another.
    pub fn check_identity(
        &mut self,
        identity: &Identity,
        model: Model,
        power_ups: u64,
        lives: RangeInclusive<u64>,
    ) -> Result<(), String> {
        let all = Capabilities::TIME
            .with(Capabilities::FILTERS)
            .with(Capabilities::DIAGNOSTICS)
            .with(Capabilities::LASTING_COUNTS);
        let is_it = identity.model == model
            && identity.capabilities == all
            && u64::from(identity.power_ups) == power_ups
            && lives.contains(&identity.life.into());
        if !is_it {
            return Wrong::new("the recorder says that it is another")
                .fact("told", format_args!("{identity:?}"))
                .fact("true", format_args!("{model:?}, power-up {power_ups}, a life of {lives:?}"))
                .err();
        }
        self.answers.identities += 1;
        Ok(())
    }
}
