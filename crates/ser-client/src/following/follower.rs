//! Following a log: reading after reading, each from where the last one ended.
//!
//! An auto report causes a reading, and nothing else. It names its events by their place in the
//! ring and by the total, and both begin anew after an erase. A report thus does not show whether
//! it belongs to the log that was read last. Earlier reports might have shown it, but they may be
//! lost or were never sent. A reading begins with the last event that was delivered. It takes one
//! request if no more than nine events have happened since.

use std::time::Duration;

use crate::reading::cursor::Cursor;
use crate::reading::delivery::Delivery;
use crate::reading::disturbed::Disturbed;
use crate::reading::log_position::LogPosition;
use crate::reading::reader::LogReader;
use crate::reading::summary::Summary;
use crate::unit::Unit;
use crate::unit::request_error::RequestError;

/// How often a reading begins anew because the log was changed under it.
const MAX_RESYNCS: u32 = 4;

/// The content of one reply, as a reading hands it out.
#[derive(Clone, Copy, Debug)]
pub struct Step<'a> {
    /// Events and losses, in order.
    pub deliveries: &'a [Delivery],
    /// Where the next reading must begin after these are delivered.
    pub cursor: Option<Cursor>,
    /// How many more events the log is known to hold.
    pub pending: u32,
    /// How many entries the log holds, as far as is known.
    pub size: u16,
}

/// A log and how far it has been read.
#[derive(Clone, Debug)]
pub struct LogFollower {
    size: u16,
    cursor: Option<Cursor>,
    position: Option<LogPosition>,
    keeps_up: bool,
    complete_at: Option<Duration>,
    is_another_log: bool,
}

impl LogFollower {
    /// Begins after `cursor`, or with the oldest event. `size` is how many entries the log holds.
    #[must_use]
    pub fn new(cursor: Option<Cursor>, size: u16) -> LogFollower {
        LogFollower {
            size,
            cursor,
            position: None,
            keeps_up: false,
            complete_at: None,
            is_another_log: false,
        }
    }

    /// The same follower, of which the recorder itself has told that its log is another one than that
    /// at the cursor. That counts until something of the new log is delivered.
    #[must_use]
    pub fn of_another_log(self) -> LogFollower {
        LogFollower { is_another_log: true, position: None, ..self }
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

    /// The same follower, with the position at which the log was last seen. If nothing has happened
    /// since, the next reading is shorter.
    #[must_use]
    pub fn starting_near(mut self, position: Option<LogPosition>) -> LogFollower {
        self.position = position;
        self
    }

    /// Whether a reading continues as long as a full reply is available. Otherwise it ends when it
    /// has passed what had happened when it began.
    pub fn set_keeps_up(&mut self, keeps_up: bool) {
        self.keeps_up = keeps_up;
    }

    /// Where the log stood at the end of the last reading.
    #[must_use]
    pub fn position(&self) -> Option<LogPosition> {
        self.position
    }

    /// A time, by the host's clock, at which the log held nothing that has not been delivered or told
    /// as lost; the latest that the readings so far prove. An event that is delivered later had not
    /// been written to the log by then.
    #[must_use]
    pub fn complete_at(&self) -> Option<Duration> {
        self.complete_at
    }

    /// Reads what is new and hands it to `take`, reply by reply. Each event comes once and in
    /// order, and losses are reported. Auto reports from before the first reply are forgotten,
    /// because the reading delivers their events. When `take` fails, the reading ends with its
    /// error, and the next reading delivers the same again.
    ///
    /// # Errors
    /// Those of `take`. Also if no reply comes, the line fails, or the log is changed again and
    /// again while it is read.
    pub fn read_new<E: From<RequestError>>(
        &mut self,
        unit: &mut Unit,
        take: &mut dyn FnMut(&Step<'_>) -> Result<(), E>,
    ) -> Result<Summary, E> {
        let (mut delivered, mut lost, mut unrecorded, mut restarted) = (0_u32, 0_u32, 0_u32, false);
        let mut resyncs = 0;
        loop {
            let (summary, end) = self.read_once(unit, take)?;
            delivered = delivered.saturating_add(summary.delivered);
            lost = lost.saturating_add(summary.lost);
            unrecorded = unrecorded.saturating_add(summary.unrecorded);
            restarted |= summary.restarted;
            if self.keeps_up && summary.delivered > 0 {
                // The reading may last for days.
                resyncs = 0;
            }
            match end {
                Ok(()) => return Ok(Summary { delivered, lost, unrecorded, restarted, ..summary }),
                // Another host erased or resized the log. The next reading finds out what is left,
                // from the cursor.
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
        let mut reader = LogReader::new(self.cursor, self.size).keeping_up(self.keeps_up);
        let position = self.position.take();
        if self.is_another_log {
            reader = reader.of_another_log();
        } else if let Some(position) = position {
            reader = reader.starting_near(position);
        }
        let mut deliveries = Vec::new();
        let mut first = true;
        let began = unit.now();
        unit.cancel();
        unit.ask(&mut || reader.request())?;
        while reader.is_waiting() {
            let reply = unit.next_reply()?;
            if first {
                // Their events are in the log that is being read, or were erased since.
                unit.forget_earlier_reports();
                first = false;
            }
            deliveries.clear();
            let taken = reader.take(&reply, &mut |delivery| deliveries.push(delivery));
            let (cursor, pending) = (reader.cursor(), reader.pending());
            // The next request is sent first, so that the line does not wait for `take`.
            let asked = if taken.is_ok() { unit.ask(&mut || reader.request()) } else { Ok(()) };
            take(&Step { deliveries: &deliveries, cursor, pending, size: self.size })?;
            self.is_another_log &= deliveries.is_empty();
            self.cursor = cursor;
            if taken.is_err() {
                return Ok((reader.summary(), taken));
            }
            asked?;
        }
        let summary = reader.summary();
        self.position = Some(summary.position);
        self.complete_at = Some(complete_at(unit, began, self.cursor, summary.position));
        Ok((summary, Ok(())))
    }

    /// Asks for the size again. Original recorders do not tell it; the given size then stays.
    fn learn_size(&mut self, unit: &mut Unit) -> Result<(), RequestError> {
        match unit.configuration() {
            Ok(configuration) => self.size = configuration.size,
            Err(RequestError::NoReply { .. }) => {}
            Err(error) => return Err(error),
        }
        Ok(())
    }
}

/// When the log held nothing beyond `cursor`, by a reading that began at `began` and ended with the
/// log at `position`.
fn complete_at(
    unit: &Unit,
    began: Duration,
    cursor: Option<Cursor>,
    position: LogPosition,
) -> Duration {
    let is_all = cursor.is_some_and(|cursor| cursor.total() == position.total);
    let asked_at = match unit.last_exchange().filter(|_| is_all) {
        Some(last) => last.carried_out().0,
        // Events were added meanwhile. A reading passes everything that happened before it.
        None => began,
    };
    // The answer may have been a report from a moment before.
    asked_at.saturating_sub(unit.report_delay())
}
