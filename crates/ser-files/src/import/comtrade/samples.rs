//! Rows of states become a list of changes.

use super::cfg::{Configuration, Layout, Rate};
use super::decimal::nanoseconds;
use crate::import::list::{Change, Found, List, Row, To, When};
use crate::import::notes::{Notes, Refusal};

/// Takes samples one after the other.
pub(super) struct Samples {
    /// The places of the channels' names.
    points: Vec<usize>,
    states: Vec<bool>,
    list: List,
    rates: Vec<Rate>,
    first: When,
    unit_ns: f64,
    announced: u64,
    /// The first sample's number, and the last one's.
    numbers: Option<(u64, u64)>,
    /// Samples so far.
    count: u64,
    /// Samples were passed over, and nobody knows what changed in them.
    is_torn: bool,
    /// Stamps and rate contradict each other.
    is_off_rate: bool,
}

/// One sample as it is in the data.
pub(super) struct Sample<'s> {
    /// Its line or row in the file.
    pub(super) line: u64,
    /// Its own number.
    pub(super) number: u64,
    /// Its stamp, if it has one.
    pub(super) stamp: Option<u64>,
    pub(super) states: &'s [bool],
}

impl Samples {
    pub(super) fn new(
        configuration: &Configuration,
        found: &mut Found,
    ) -> Result<Samples, Refusal> {
        let points = configuration.names.iter().map(|name| found.point(name));
        Ok(Samples {
            points: points.collect::<Result<_, _>>()?,
            states: Vec::new(),
            list: List {
                other_dates: vec![configuration.first.date],
                usual_dates: configuration.dates,
                is_sampled: true,
                ..List::default()
            },
            rates: configuration.rates.clone(),
            first: configuration.first,
            unit_ns: configuration.unit_ns,
            announced: configuration.samples,
            numbers: None,
            count: 0,
            is_torn: false,
            is_off_rate: false,
        })
    }

    /// Notes that a sample cannot be read.
    pub(super) fn tear(&mut self) {
        self.count += 1;
        self.is_torn = true;
    }

    /// Whether all samples that were announced have been there.
    pub(super) const fn is_full(&self) -> bool {
        self.announced > 0 && self.count >= self.announced
    }

    /// Takes a sample. An error says why it is left out.
    pub(super) fn add(
        &mut self,
        sample: &Sample<'_>,
        found: &mut Found,
        notes: &mut Notes,
    ) -> Result<Result<(), String>, Refusal> {
        let (first, last) = self.numbers.unwrap_or((sample.number, sample.number.wrapping_sub(1)));
        if self.numbers.is_some() && sample.number <= last {
            return Ok(Err(format!("sample {} comes after sample {last}", sample.number)));
        }
        let Some(later_ns) = self.later_ns(sample, sample.number - first) else {
            return Ok(Err("this sample has neither a time nor a rate".to_owned()));
        };
        let skipped = sample.number.wrapping_sub(last).wrapping_sub(1);
        let is_torn = std::mem::take(&mut self.is_torn) || skipped > 0;
        self.numbers = Some((first, sample.number));
        self.count += 1;
        if self.states.is_empty() || is_torn {
            // Whatever changed meanwhile, nobody knows when.
            return self.begin_anew(sample, (last, skipped), found, notes).map(Ok);
        }
        let moved: Vec<Change> = self
            .points
            .iter()
            .zip(self.states.iter().zip(sample.states))
            .filter(|(_, (before, now))| before != now)
            .map(|(point, (_, now))| Change { point: *point, to: To::State(*now) })
            .collect();
        if moved.is_empty() {
            return Ok(Ok(()));
        }
        found.count(moved.len())?;
        self.states.copy_from_slice(sample.states);
        let pending = self.list.rows.pop_if(|row| row.changes.is_empty());
        let place = match &pending {
            Some(pending) => pending.place,
            None => self.list.rows.last().map_or(1, |row| row.place + 1),
        };
        let (torn, learnt) = pending.map_or((None, Vec::new()), |row| (row.torn, row.learnt));
        self.list.rows.push(Row {
            line: sample.line,
            when: When { later_ns, ..self.first },
            place,
            forgets: false,
            torn,
            learnt,
            changes: moved,
        });
        Ok(Ok(()))
    }

    /// Keeps what a sample shows for the next change. `last` is the sample before, and so many are
    /// not there in between.
    fn begin_anew(
        &mut self,
        sample: &Sample<'_>,
        (last, skipped): (u64, u64),
        found: &mut Found,
        notes: &mut Notes,
    ) -> Result<(), Refusal> {
        let pending = self.list.rows.pop_if(|row| row.changes.is_empty());
        let is_first = self.states.is_empty();
        let shown = self.points.iter().copied().zip(sample.states.iter().copied());
        let news: Vec<(usize, bool)> = match is_first {
            true => shown.collect(),
            false => shown
                .zip(&self.states)
                .filter(|((_, now), before)| now != *before)
                .map(|(news, _)| news)
                .collect(),
        };
        found.count(news.len())?;
        self.states = sample.states.to_vec();
        // What was passed over is a place of its own if something changed in it.
        let is_missing = u64::from(!is_first && !news.is_empty());
        let place = self.list.rows.last().map_or(1, |row| row.place + 1);
        let (mut learnt, mut torn) = (Vec::new(), None);
        let place = pending.map_or(place, |pending| {
            (learnt, torn) = (pending.learnt, pending.torn);
            pending.place
        });
        if !is_first {
            let moved: Vec<usize> = news.iter().map(|(point, _)| *point).collect();
            notes.lose(sample.line, lost(sample.number, (last, skipped), &moved, found));
            torn.get_or_insert_with(Vec::new).extend(moved);
        }
        learnt.extend(news);
        self.list.rows.push(Row {
            line: sample.line,
            when: self.first,
            place: place + is_missing,
            forgets: false,
            torn,
            learnt,
            changes: Vec::new(),
        });
        Ok(())
    }

    /// How much later than the first sample it is.
    fn later_ns(&mut self, sample: &Sample<'_>, after: u64) -> Option<i64> {
        #[allow(clippy::cast_precision_loss)]
        let stamped = sample.stamp.and_then(|stamp| nanoseconds(stamp as f64 * self.unit_ns));
        if self.rates.is_empty() {
            return stamped;
        }
        let (later, period) = self.by_rate(after)?;
        self.is_off_rate |= stamped.is_some_and(|stamped| stamped.abs_diff(later) > period);
        Some(later)
    }

    /// The time of a sample by the rates, and how far it is from the one before, in nanoseconds.
    fn by_rate(&self, after: u64) -> Option<(i64, u64)> {
        let (mut from, mut ns) = (0_u64, 0.0_f64);
        let last = self.rates.len().checked_sub(1)?;
        for (place, rate) in self.rates.iter().enumerate() {
            let until = if place == last { u64::MAX } else { rate.until.saturating_sub(1) };
            let here = after.min(until).saturating_sub(from);
            #[allow(clippy::cast_precision_loss)]
            let here_ns = here as f64 * 1e9 / rate.hz;
            ns += here_ns;
            if after <= until {
                let period = nanoseconds(1e9 / rate.hz)?;
                return Some((nanoseconds(ns)?, period.unsigned_abs()));
            }
            from = until;
        }
        None
    }

    /// Hands over what was found.
    pub(super) fn finish(mut self, found: &mut Found, notes: &mut Notes) {
        // What no change follows is lost behind the last one.
        let pending = self.list.rows.pop_if(|row| row.changes.is_empty());
        self.list.torn_at_end = pending.and_then(|row| row.torn);
        if self.is_torn && !self.states.is_empty() {
            self.list.torn_at_end.get_or_insert_default();
        }
        // Those that are skipped in between have been told where they are missing.
        let (first, last) = self.numbers.unwrap_or((1, 0));
        let until_last = last.wrapping_sub(first).wrapping_add(1).max(self.count);
        if until_last < self.announced {
            self.list.torn_at_end.get_or_insert_default();
            notes.lose_at_end(format!(
                "{} samples are announced, and the data ends after {}: whatever changed after that \
                 is lost",
                self.announced, self.count
            ));
        }
        if self.is_off_rate {
            notes.remark(None, "the stamps do not fit the sampling rate; the rate counts");
        }
        let slowest = self.rates.iter().map(|rate| rate.hz).fold(f64::INFINITY, f64::min);
        if slowest < 1000.0 {
            let ms = 1000.0 / slowest;
            notes.remark(
                None,
                format!(
                    "samples are {ms:.1} ms apart, so contacts moved up to that much before the \
                     stamp: give the recorder delay_ms = {{ closing = [0, {ms:.1}], opening = \
                     [0, {ms:.1}] }} in the site file"
                ),
            );
        }
        found.lists.push(self.list);
    }
}

/// What is lost before a sample, in words.
fn lost(number: u64, (last, skipped): (u64, u64), moved: &[usize], found: &Found) -> String {
    /// Channels that are named; of others their number is told.
    const NAMED: usize = 8;
    let between = match skipped {
        0 => format!("something may be lost before sample {number}"),
        1 => format!("there is no sample {}", last.wrapping_add(1)),
        _ => format!("there are no samples {} to {}", last.wrapping_add(1), number - 1),
    };
    let names: Vec<&str> = moved.iter().take(NAMED).map(|point| found.points.get(*point)).collect();
    let more = match moved.len().saturating_sub(NAMED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    match names.is_empty() {
        true => between,
        false => format!("{between}, and meanwhile these changed: {}{more}", names.join(", ")),
    }
}

impl Layout {
    /// How many bytes a sample has.
    pub(super) fn row_len(self, configuration: &Configuration) -> usize {
        let analog_len = match self {
            Layout::Ascii => 0,
            Layout::Binary { analog_len } => analog_len,
        };
        8 + configuration.analogs * analog_len + configuration.names.len().div_ceil(16) * 2
    }
}
