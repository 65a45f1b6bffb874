//! Changes that chatter filters leave out, told while a log is read: no entry tells of them, and an
//! input that chattered must not be taken for a quiet one.
//!
//! A recorder counts them from its power-up on. What earlier runs saw is kept with the records of
//! its clock, so that a reading of what is new tells what is new of this, too.

use std::time::{Duration, Instant};

use ser_client::{RequestError, Unit};
use ser_evidence::record::{Record, Suppressed};
use ser_observer::left_out;

use crate::error::{advise, warn};
use crate::filter_text;
use crate::kept::KeptRecords;
use crate::output::Points;

/// How often a reading without end looks.
const LOOK_EVERY: Duration = Duration::from_secs(60);

/// A look must not take a larger part of the line than one in so many, however slow that is.
const PART_OF_LINE: u32 = 30;

/// Looks during the readings of one log.
pub(crate) struct LeftOut {
    kept: Option<KeptRecords>,
    before: Option<Suppressed>,
    points: Points,
    /// The recorder's name, where several are told of.
    recorder: Option<String>,
    due: Instant,
    has_looked: bool,
}

impl LeftOut {
    /// Nobody has looked in this run. `kept` is what earlier runs have left, if this one remembers.
    pub(crate) fn new(kept: Option<KeptRecords>, points: Points) -> LeftOut {
        let records = kept.as_ref().map(KeptRecords::load).unwrap_or_default();
        let before = records.into_iter().rev().find_map(|record| match record {
            Record::Suppressed(look) => Some(look),
            _ => None,
        });
        let due = Instant::now();
        LeftOut { kept, before, points, recorder: None, due, has_looked: false }
    }

    /// The same of one of several recorders.
    pub(crate) fn of(self, recorder: &str) -> LeftOut {
        LeftOut { recorder: Some(recorder.to_owned()), ..self }
    }

    /// Looks now and then. Returns a look that says something new.
    pub(crate) fn look_if_due(&mut self, unit: &mut Unit) -> Option<Record> {
        let began = Instant::now();
        if began < self.due {
            return None;
        }
        let (is_first, before) = (!self.has_looked, self.before.clone());
        // What fails now may be an outage, of which others tell; the next look comes soon.
        let record = left_out(unit).ok().flatten().map(|look| self.take(look));
        self.due = Instant::now() + LOOK_EVERY.max(began.elapsed() * PART_OF_LINE);
        record.filter(|record| match record {
            Record::Suppressed(look) => is_first || !look.since(before.as_ref()).is_empty(),
            _ => false,
        })
    }

    /// Looks and tells what is new. The entries are what the recorder was read for, so a look that
    /// fails ends nothing.
    pub(crate) fn look(&mut self, unit: &mut Unit) -> Option<Record> {
        match left_out(unit) {
            Ok(look) => look.map(|look| self.take(look)),
            Err(error) => {
                self.tell_failure(&error);
                None
            }
        }
    }

    /// Tells what is new and keeps it.
    fn take(&mut self, look: Suppressed) -> Record {
        self.tell(&look);
        self.has_looked = true;
        let record = Record::Suppressed(look.clone());
        // Of recorders that leave nothing out, nothing need be kept.
        if let Some(kept) = self.kept.as_ref().filter(|_| !look.left_out.is_empty()) {
            kept.add(std::slice::from_ref(&record));
        }
        self.before = Some(look);
        record
    }

    /// Says that nothing is known of this. Of a line or a board that fails, the reading tells.
    fn tell_failure(&self, error: &RequestError) {
        if matches!(error, RequestError::NoReply { .. }) {
            let of = self.recorder.as_ref().map(|recorder| format!("{recorder}: "));
            let of = of.unwrap_or_default();
            warn(format_args!("{of}how many changes its filters left out is not known: {error}"));
        }
    }

    fn tell(&self, look: &Suppressed) {
        let since = look.since(self.before.as_ref());
        let is_from_power_up = self.before.as_ref().is_none_or(|before| !look.continues(before));
        let lines = lines(since, is_from_power_up, &self.points);
        if lines.is_empty() {
            return;
        }
        for line in lines {
            match &self.recorder {
                Some(recorder) => warn(format_args!("{recorder}: {line}")),
                None => warn(line),
            }
        }
        if !self.has_looked {
            advise("only their number is known: ser-cli filter shows what is filtered out");
        }
    }
}

/// A line for each input of which changes were left out.
fn lines(
    since: impl IntoIterator<Item = (u8, u32)>,
    is_from_power_up: bool,
    points: &Points,
) -> Vec<String> {
    let line = |(input, count): (u8, u32)| {
        let input = filter_text::inputs(&[input], points);
        let changes = match (count, is_from_power_up) {
            (1, true) => "1 change".to_owned(),
            (1, false) => "1 more change".to_owned(),
            (_, true) => format!("{} changes", filter_text::count(count.into())),
            (_, false) => format!("{} more changes", filter_text::count(count.into())),
        };
        let since = if is_from_power_up { " since its power-up" } else { "" };
        format!("{input}: {changes} left out by its chatter filter{since}")
    };
    since.into_iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::testing::points;

    #[test]
    fn an_input_is_told_with_its_name_and_since_when() {
        assert_eq!(
            lines([(3, 1234), (4, 1)], true, &points()),
            [
                "input 3 (52-1 closed): 1,234 changes left out by its chatter filter since its \
                 power-up",
                "input 4: 1 change left out by its chatter filter since its power-up",
            ]
        );
        assert_eq!(
            lines([(3, 2), (4, 1)], false, &points()),
            [
                "input 3 (52-1 closed): 2 more changes left out by its chatter filter",
                "input 4: 1 more change left out by its chatter filter",
            ]
        );
        assert!(lines([], true, &points()).is_empty());
    }
}
