//! What a recorder must answer to the questions of our extension, worked out when they arrive.

use std::collections::VecDeque;

use ser_proto::{Capabilities, ClockReading, Counter, Counters, Identity, Mark, Model};

use super::ledger::Port;
use super::wrong::Wrong;

/// How many questions of each kind are remembered. Those that were not answered are among them.
const KEPT: usize = 64;

/// A question for the time.
#[derive(Clone, Debug)]
pub struct TimeQuestion {
    /// The port that it came by.
    pub port: Port,
    /// Its token.
    pub token: u16,
    /// What the clock showed in the millisecond of its arrival.
    pub clock_us: i64,
    /// How long the recorder had been on.
    pub tick_us: u64,
    /// How many events the log can have counted then: the places of its latest erase, and those up
    /// to now.
    pub events: Vec<std::ops::RangeInclusive<u64>>,
}

/// A question for counters.
#[derive(Clone, Copy, Debug)]
struct CountersQuestion {
    port: Port,
    first: Counter,
    left_out: [u32; 32],
}

/// How many questions were answered, and how.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Answers {
    /// Times, each true.
    pub times: u64,
    /// Times that told of a mark, each true.
    pub marks: u64,
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
    times: VecDeque<TimeQuestion>,
    counters: VecDeque<CountersQuestion>,
    /// Marks, the latest last, and none at power-up.
    marks: VecDeque<Option<Mark>>,
    /// How many true answers there were, in all lives.
    pub answers: Answers,
}

fn remember<T>(kept: &mut VecDeque<T>, new: T) {
    if kept.len() == KEPT {
        kept.pop_front();
    }
    kept.push_back(new);
}

impl Questions {
    /// The power comes on: nobody has asked.
    pub fn power_up(&mut self) {
        *self = Questions { answers: self.answers, marks: [None].into(), ..Questions::default() };
    }

    /// Somebody asks for the time.
    pub fn ask_time(&mut self, question: TimeQuestion) {
        remember(&mut self.times, question);
    }

    /// Somebody asks for counters, when so many changes had been left out.
    pub fn ask_counters(&mut self, port: Port, first: Counter, left_out: [u32; 32]) {
        remember(&mut self.counters, CountersQuestion { port, first, left_out });
    }

    /// A mark arrives.
    pub fn mark(&mut self, mark: Mark) {
        remember(&mut self.marks, Some(mark));
    }

    /// Checks an answer for the time.
    ///
    /// # Errors
    /// When it is not true.
    pub fn check_time(&mut self, port: Port, reading: &ClockReading) -> Result<(), String> {
        let is = |asked: &&TimeQuestion| (asked.port, asked.token) == (port, reading.token);
        let Some(asked) = self.times.iter().rev().find(is) else {
            return Err(format!("nobody has asked for this time: {reading:?}"));
        };
        let told = (reading.clock_us, reading.tick_us);
        let events = reading.next_sequence.wrapping_sub(1);
        if told != (asked.clock_us, asked.tick_us)
            || !asked.events.iter().any(|range| range.contains(&events))
        {
            return Wrong::new("the recorder tells another time than that of the question")
                .fact("told", format_args!("{reading:?}"))
                .fact("true", format_args!("{asked:?}"))
                .err();
        }
        if !self.marks.contains(&reading.last_mark) {
            return Wrong::new("the recorder tells of a mark that there was not")
                .fact("told", format_args!("{:?}", reading.last_mark))
                .fact("true", format_args!("{:?}", self.marks))
                .err();
        }
        self.answers.times += 1;
        self.answers.marks += u64::from(reading.last_mark.is_some());
        Ok(())
    }

    /// Checks a page of counters against the changes left out by now.
    ///
    /// # Errors
    /// When it tells more of them than there are, or fewer than when it was asked for.
    pub fn check_counters(
        &mut self,
        port: Port,
        page: &Counters,
        left_out: [u32; 32],
    ) -> Result<(), String> {
        let is =
            |asked: &&CountersQuestion| asked.port == port && asked.first.id() <= page.first.id();
        let Some(asked) = self.counters.iter().find(is) else {
            return Err(format!("nobody has asked for these counters: {page:?}"));
        };
        for (input, (least, most)) in (1..).zip(asked.left_out.into_iter().zip(left_out)) {
            let of_input =
                |(counter, _): &(Counter, u32)| Some(*counter) == Counter::suppressed(input);
            if let Some((_, told)) = page.counters().find(of_input)
                && !(least..=most).contains(&told)
            {
                return Err(format!(
                    "the recorder says that {told} changes of input {input} were left out, and there \
                     were {least} to {most}"
                ));
            }
        }
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
        lives: std::ops::RangeInclusive<u64>,
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
