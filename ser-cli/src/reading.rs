//! Reading a unit's log from where the last reading ended, in steps between which a command can stop.

use ser_client::{Cursor, Delivery, Disturbed, LogPosition, LogReader, RequestError, Summary, Unit};
use ser_proto::{Code, Command, Entry, Model, ReadReply, Reply};

use crate::error::Result;

/// How often a reading begins anew because the log was changed under it.
const MAX_RESYNCS: u32 = 4;

/// What a reply has brought.
pub(crate) struct Step<'a> {
    /// Events and losses, in order.
    pub(crate) deliveries: &'a [Delivery],
    /// Where the next reading has to begin once these are delivered.
    pub(crate) cursor: Option<Cursor>,
    /// How many more events the log is known to hold.
    pub(crate) pending: u32,
}

/// A log and how far it has been read.
pub(crate) struct LogFollower {
    size: u16,
    cursor: Option<Cursor>,
    position: Option<LogPosition>,
}

impl LogFollower {
    /// Begins behind `cursor`, or with the oldest event. `size` is how many entries the log holds.
    pub(crate) fn new(cursor: Option<Cursor>, size: u16) -> LogFollower {
        LogFollower { size, cursor, position: None }
    }

    /// How many entries the log holds, as far as is known.
    pub(crate) fn size(&self) -> u16 {
        self.size
    }

    /// Reads what is new and hands it to `take`, reply by reply. When `take` fails, the reading ends with that.
    pub(crate) fn read_new(
        &mut self,
        unit: &mut Unit,
        take: &mut dyn FnMut(&Step<'_>) -> Result<()>,
    ) -> Result<Summary> {
        for _ in 0..MAX_RESYNCS {
            match self.read_once(unit, take)? {
                Ok(summary) => return Ok(summary),
                // Somebody erased or resized the log: what is still there is sorted out from the cursor.
                Err(Disturbed::Changed | Disturbed::WrongSize) => self.learn_size(unit)?,
                Err(disturbed) => return Err(RequestError::Disturbed(disturbed).into()),
            }
        }
        self.read_once(unit, take)?.map_err(|disturbed| RequestError::Disturbed(disturbed).into())
    }

    fn read_once(
        &mut self,
        unit: &mut Unit,
        take: &mut dyn FnMut(&Step<'_>) -> Result<()>,
    ) -> Result<std::result::Result<Summary, Disturbed>> {
        let mut reader = LogReader::new(self.cursor, self.size);
        if let Some(position) = self.position.take() {
            reader = reader.starting_near(position);
        }
        while let Some(request) = reader.request() {
            let Reply::Read(reply) = unit.request(&Command::from(request))? else {
                return Err(RequestError::UnexpectedReply { command: Code::Read }.into());
            };
            let mut deliveries = Vec::new();
            let taken = reader.take(&reply, &mut |delivery| deliveries.push(delivery));
            let (cursor, pending) = (reader.cursor(), reader.pending());
            take(&Step { deliveries: &deliveries, cursor, pending })?;
            self.cursor = cursor;
            if let Err(disturbed) = taken {
                return Ok(Err(disturbed));
            }
        }
        let summary = reader.summary();
        self.position = Some(summary.position);
        Ok(Ok(summary))
    }

    /// Asks for the size again; original units do not tell, then it stays what it was said to be.
    fn learn_size(&mut self, unit: &mut Unit) -> Result<()> {
        match unit.configuration() {
            Ok(configuration) => self.size = configuration.size,
            Err(RequestError::NoReply { .. }) => {}
            Err(error) => return Err(error.into()),
        }
        Ok(())
    }

    /// Takes events out of an auto report, if they are the very next ones. `None`: only a reading can tell.
    pub(crate) fn continue_with(&mut self, report: &ReadReply) -> Option<(Vec<Delivery>, Cursor)> {
        let mut cursor = self.cursor?;
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
    (report.start..).zip(&report.entries).filter_map(move |(number, entry)| Some((number, *entry, model?)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::testing::entry;

    fn report(start: u16, total: u16, next_slot: u16, count: usize) -> ReadReply {
        let entries = std::iter::repeat_n(entry("00.250", &[1], &[1]), count).collect();
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
        assert_eq!(numbers(follower(4, 8).continue_with(&report(5, 6, 6, 2))), Some((vec![5, 6], 6)));
        // More has happened since the entries were chosen.
        assert_eq!(numbers(follower(4, 8).continue_with(&report(5, 9, 1, 2))), Some((vec![5, 6], 6)));
        // Over the end of the ring and of the total.
        assert_eq!(
            numbers(follower(65_534, 8).continue_with(&report(8, 65_535, 0, 1))),
            Some((vec![8], 65_535))
        );
        assert_eq!(numbers(follower(65_535, 8).continue_with(&report(1, 0, 1, 1))), Some((vec![1], 0)));
    }

    #[test]
    fn everything_else_needs_a_reading() {
        for (what, taken) in [
            ("a gap", follower(3, 8).continue_with(&report(5, 6, 6, 2))),
            ("known events", follower(5, 8).continue_with(&report(5, 6, 6, 2))),
            ("no events", follower(4, 8).continue_with(&report(5, 4, 4, 0))),
            ("another size", follower(4, 5).continue_with(&report(5, 6, 6, 2))),
            ("no cursor", LogFollower::new(None, 8).continue_with(&report(1, 1, 1, 1))),
        ] {
            assert_eq!(numbers(taken), None, "{what}");
        }
    }

    #[test]
    fn reports_follow_each_other() {
        let mut follower = follower(0, 2);
        for (start, total) in [(1, 1), (2, 2), (1, 3), (2, 4)] {
            assert!(follower.continue_with(&report(start, total, start % 2, 1)).is_some(), "{total}");
        }
    }
}
