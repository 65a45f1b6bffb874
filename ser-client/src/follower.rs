//! Following a log: reading after reading from where the last one ended, and auto reports where they fit.
//!
//! A report says which events it brings by their place and the total, and nothing else shows that the log is still the same: after
//! an erase both begin anew, and the second event may then look like the one that follows. The report of the first event would
//! show it, so reports are believed only as long as none can have been lost. After any damage on the line a reading is due, which
//! looks at the last event that was delivered.

use ser_proto::{Entry, Model, ReadReply};

use crate::{Counters, Cursor, Delivery, Disturbed, LogPosition, LogReader, RequestError, Summary, Unit};

/// How often a reading begins anew because the log was changed under it.
const MAX_RESYNCS: u32 = 4;

/// What a reply has brought.
#[derive(Clone, Copy, Debug)]
pub struct Step<'a> {
    /// Events and losses, in order.
    pub deliveries: &'a [Delivery],
    /// Where the next reading has to begin once these are delivered.
    pub cursor: Option<Cursor>,
    /// How many more events the log is known to hold.
    pub pending: u32,
    /// How many entries the log holds, as far as is known by now.
    pub size: u16,
}

/// A log and how far it has been read.
#[derive(Clone, Debug)]
pub struct LogFollower {
    size: u16,
    cursor: Option<Cursor>,
    position: Option<LogPosition>,
    /// [`Counters::damages`] when the latest reading began, or the latest report was taken.
    damages: Option<u64>,
}

impl LogFollower {
    /// Begins behind `cursor`, or with the oldest event. `size` is how many entries the log holds.
    #[must_use]
    pub fn new(cursor: Option<Cursor>, size: u16) -> LogFollower {
        LogFollower { size, cursor, position: None, damages: None }
    }

    /// How many entries the log holds, as far as is known.
    #[must_use]
    pub fn size(&self) -> u16 {
        self.size
    }

    /// Where the next reading begins.
    #[must_use]
    pub fn cursor(&self) -> Option<Cursor> {
        self.cursor
    }

    /// The same, when the log was last seen at `position`: if nothing has happened since, the next reading is shorter.
    #[must_use]
    pub fn starting_near(mut self, position: Option<LogPosition>) -> LogFollower {
        self.position = position;
        self
    }

    /// The same, where the line had shown this by the time of the cursor. If that is not said, it shows it with the first
    /// report.
    #[must_use]
    pub fn since(mut self, seen: &Counters) -> LogFollower {
        self.damages = Some(seen.damages());
        self
    }

    /// Where the log stood at the end of the last reading.
    #[must_use]
    pub fn position(&self) -> Option<LogPosition> {
        self.position
    }

    /// Reads what is new and hands it to `take`, reply by reply; each event comes once and in order, and what was lost is
    /// told. Auto reports that came before the first reply are forgotten: the reading brings what they have to tell. When `take` fails, the reading ends with its error, and the next one begins before what it was given.
    ///
    /// # Errors
    /// Those of `take`; no reply, a line that fails, or a log that is changed again and again while it is read.
    pub fn read_new<E: From<RequestError>>(
        &mut self,
        unit: &mut Unit,
        take: &mut dyn FnMut(&Step<'_>) -> Result<(), E>,
    ) -> Result<Summary, E> {
        let (mut delivered, mut lost, mut restarted) = (0_u32, 0_u32, false);
        let mut resyncs = 0;
        loop {
            let (summary, end) = self.read_once(unit, take)?;
            delivered = delivered.saturating_add(summary.delivered);
            lost = lost.saturating_add(summary.lost);
            restarted |= summary.restarted;
            match end {
                Ok(()) => return Ok(Summary { delivered, lost, restarted, ..summary }),
                // Somebody erased or resized the log: what is still there is sorted out from the cursor.
                Err(Disturbed::Changed | Disturbed::WrongSize) if resyncs < MAX_RESYNCS => {
                    resyncs += 1;
                    self.learn_size(unit)?;
                }
                Err(disturbed) => return Err(RequestError::Disturbed(disturbed).into()),
            }
        }
    }

    fn read_once<E: From<RequestError>>(
        &mut self,
        unit: &mut Unit,
        take: &mut dyn FnMut(&Step<'_>) -> Result<(), E>,
    ) -> Result<(Summary, Result<(), Disturbed>), E> {
        let mut reader = LogReader::new(self.cursor, self.size);
        if let Some(position) = self.position.take() {
            reader = reader.starting_near(position);
        }
        self.damages = Some(unit.counters().damages());
        let mut deliveries = Vec::new();
        let mut first = true;
        unit.cancel();
        unit.ask(&mut || reader.request())?;
        while reader.is_waiting() {
            let reply = unit.next_reply()?;
            if first {
                // What they tell is in the log that is read now, or was erased since.
                unit.forget_earlier_reports();
                first = false;
            }
            deliveries.clear();
            let taken = reader.take(&reply, &mut |delivery| deliveries.push(delivery));
            let (cursor, pending) = (reader.cursor(), reader.pending());
            // Before anything is done with this: the line shall not have to wait for it.
            let asked = if taken.is_ok() { unit.ask(&mut || reader.request()) } else { Ok(()) };
            take(&Step { deliveries: &deliveries, cursor, pending, size: self.size })?;
            self.cursor = cursor;
            if taken.is_err() {
                return Ok((reader.summary(), taken));
            }
            asked?;
        }
        let summary = reader.summary();
        self.position = Some(summary.position);
        Ok((summary, Ok(())))
    }

    /// Asks for the size again; original units do not tell, then it stays what it was said to be.
    fn learn_size(&mut self, unit: &mut Unit) -> Result<(), RequestError> {
        match unit.configuration() {
            Ok(configuration) => self.size = configuration.size,
            Err(RequestError::NoReply { .. }) => {}
            Err(error) => return Err(error),
        }
        Ok(())
    }

    /// Takes events out of an auto report, if they are the very next ones, and `seen` says that no report can have been lost since
    /// the cursor. `None`: only a reading can tell.
    pub fn continue_with(&mut self, report: &ReadReply, seen: &Counters) -> Option<(Vec<Delivery>, Cursor)> {
        let mut cursor = self.cursor?;
        let damages = seen.damages();
        if self.damages.is_some_and(|known| known != damages) {
            return None;
        }
        let mut deliveries = Vec::new();
        for (entry_number, entry, model) in numbered(report) {
            let total = self.total_after(report, entry_number)?;
            if total != cursor.total.wrapping_add(1) {
                return None;
            }
            cursor = Cursor { total, anchor: Some(entry) };
            deliveries.push(Delivery::Event { entry_number, entry, model });
        }
        if deliveries.is_empty() {
            return None;
        }
        self.cursor = Some(cursor);
        self.damages = Some(damages);
        self.position = Some(LogPosition { total: report.total, next_slot: report.next_slot });
        Some((deliveries, cursor))
    }

    /// What the unit's total was right after the event in entry `number`, from where the log stands now.
    fn total_after(&self, report: &ReadReply, number: u16) -> Option<u16> {
        let (size, next) = (i32::from(self.size), i32::from(report.next_slot));
        if next >= size || i32::from(number) > size {
            return None;
        }
        // The newest event is in the slot before the next, and slot `n - 1` holds entry `n`.
        let newer = (next - i32::from(number)).rem_euclid(size);
        Some(report.total.wrapping_sub(u16::try_from(newer).ok()?))
    }
}

fn numbered(report: &ReadReply) -> impl Iterator<Item = (u16, Entry, Model)> {
    let model = report.model;
    // Inclusive: a report can begin with the largest number that there is.
    (report.start..=u16::MAX)
        .zip(&report.entries)
        .filter_map(move |(number, entry)| Some((number, *entry, model?)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ser_proto::{Inputs, TimeStamp};

    const CLEAN: Counters = Counters {
        bytes: 0,
        frames: 0,
        not_understood: 0,
        bad_checksums: 0,
        broken_frames: 0,
        reports: 0,
        stray_replies: 0,
        lines: 0,
        noise: 0,
    };

    fn report(start: u16, total: u16, next_slot: u16, count: usize) -> ReadReply {
        let time =
            TimeStamp { year: 26, month: 11, day: 22, hour: 10, minute: 0, second: 0, millisecond: 250 };
        let entry = Entry { changed: Inputs(1), state: Inputs(1), time };
        let entries = std::iter::repeat_n(entry, count).collect();
        ReadReply { start, total, next_slot, model: Some(Model::Ser160), entries }
    }

    fn numbers(taken: Option<(Vec<Delivery>, Cursor)>) -> Option<(Vec<u16>, u16)> {
        let (deliveries, cursor) = taken?;
        let number = |delivery: &Delivery| match delivery {
            Delivery::Event { entry_number, .. } => *entry_number,
            Delivery::Lost(_) => 0,
        };
        Some((deliveries.iter().map(number).collect(), cursor.total))
    }

    fn follower(total: u16, size: u16) -> LogFollower {
        LogFollower::new(Some(Cursor { total, anchor: None }), size)
    }

    #[test]
    fn a_report_with_the_next_events_is_as_good_as_a_reading() {
        assert_eq!(numbers(follower(4, 8).continue_with(&report(5, 6, 6, 2), &CLEAN)), Some((vec![5, 6], 6)));
        // More has happened since the entries were chosen.
        assert_eq!(numbers(follower(4, 8).continue_with(&report(5, 9, 1, 2), &CLEAN)), Some((vec![5, 6], 6)));
        // Over the end of the ring and of the total.
        assert_eq!(
            numbers(follower(65_534, 8).continue_with(&report(8, 65_535, 0, 1), &CLEAN)),
            Some((vec![8], 65_535))
        );
        assert_eq!(
            numbers(follower(65_535, 8).continue_with(&report(1, 0, 1, 1), &CLEAN)),
            Some((vec![1], 0))
        );
    }

    #[test]
    fn everything_else_needs_a_reading() {
        for (what, taken) in [
            ("a gap", follower(3, 8).continue_with(&report(5, 6, 6, 2), &CLEAN)),
            ("known events", follower(5, 8).continue_with(&report(5, 6, 6, 2), &CLEAN)),
            ("no events", follower(4, 8).continue_with(&report(5, 4, 4, 0), &CLEAN)),
            ("another size", follower(4, 5).continue_with(&report(5, 6, 6, 2), &CLEAN)),
            ("no cursor", LogFollower::new(None, 8).continue_with(&report(1, 1, 1, 1), &CLEAN)),
            ("numbers that no log has", follower(4, 8).continue_with(&report(u16::MAX, 5, 5, 10), &CLEAN)),
        ] {
            assert_eq!(numbers(taken), None, "{what}");
        }
    }

    #[test]
    fn reports_follow_each_other() {
        let mut follower = follower(0, 2);
        for (start, total) in [(1, 1), (2, 2), (1, 3), (2, 4)] {
            assert!(follower.continue_with(&report(start, total, start % 2, 1), &CLEAN).is_some(), "{total}");
        }
    }

    #[test]
    fn a_report_behind_damage_is_not_believed() {
        // Entry 2 with total 2 follows the first event, or is the second one after an erase whose first report is the damage.
        let damaged = [
            Counters { bad_checksums: 1, ..CLEAN },
            Counters { broken_frames: 1, ..CLEAN },
            Counters { not_understood: 1, ..CLEAN },
            Counters { noise: 1, ..CLEAN },
        ];
        for seen in damaged {
            let mut follower = follower(1, 8).since(&CLEAN);
            assert_eq!(numbers(follower.continue_with(&report(2, 2, 2, 1), &seen)), None, "{seen:?}");
            assert_eq!(
                numbers(follower.since(&seen).continue_with(&report(2, 2, 2, 1), &seen)),
                Some((vec![2], 2))
            );
        }
        // What is no damage changes nothing.
        let seen = Counters { bytes: 9, frames: 9, reports: 9, stray_replies: 9, lines: 9, ..CLEAN };
        assert!(follower(1, 8).since(&CLEAN).continue_with(&report(2, 2, 2, 1), &seen).is_some());
    }
}
