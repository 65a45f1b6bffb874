//! Following a log without end: when to read it, and whether the recorder is to report by itself.
//!
//! A report is the quickest way to hear of an event. But it makes the same entries go over the line
//! twice: once in the report and once in the reading that it causes. If events come faster than the
//! line carries them twice, the recorder is told not to report and is read as fast as it goes.
//! After a quiet time it may report again. Each change of this setting is stored in the recorder.
//! So a recorder that is busy again and again stays without reports for longer each time.

use std::time::Duration;

use ser_proto::Configure;

use super::follower::{LogFollower, Step};
use crate::reading::cursor::Cursor;
use crate::reading::summary::Summary;
use crate::session::unsolicited::Unsolicited;
use crate::transport::line_rate::LineRate;
use crate::unit::Unit;
use crate::unit::request_error::RequestError;

/// If readings follow each other without a pause for this long, the line cannot carry the reports
/// as well.
const BUSY_FOR: Duration = Duration::from_secs(3);

/// The shortest time between two readings that counts as a pause.
const PAUSE: Duration = Duration::from_millis(5);

/// A ring is in danger when more than this fraction of it is unread: one in so many entries.
const DANGER: u32 = 4;

/// Fewer unread events than this are a burst and not a danger, except in a small ring.
const BURST: u32 = 20;

/// How often a busy recorder is read. A reply then holds many events, and none is old.
const BUSY_POLL: Duration = Duration::from_millis(200);

/// As many events as a full reply holds: there may be more.
const FULL_REPLY: u32 = 10;

/// A busy recorder with fewer events than this in a reading counts as quiet.
const QUIET: u32 = 3;

/// How long a recorder must be quiet before it reports again: the first time, and at most.
const CALM: [Duration; 2] = [Duration::from_secs(30), Duration::from_secs(3600)];

/// Fewest bytes that an event takes on the line: 12 bytes in hexadecimal digits.
const EVENT_LEN: usize = 24;

/// Stands for the unknown rate of a line, as with a terminal server: the highest rate of recorders.
const HIGHEST_RATE: LineRate = LineRate::BitsPerSecond(19_200);

/// How to make a recorder report to this host, and how to make it stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReportSwitch {
    /// The setting with auto report.
    pub on: Configure,
    /// The setting without.
    pub off: Configure,
    /// Whether it reports now.
    pub is_on: bool,
}

/// A log that is followed without end; see the [module documentation](self).
#[derive(Debug)]
pub struct LogWatcher {
    follower: LogFollower,
    interval: Duration,
    /// Whether the log may be read more often than every `interval`.
    may_shorten: bool,
    switch: Option<ReportSwitch>,
    has_switched: bool,
    /// When the log is read next.
    due: Duration,
    has_read: bool,
    /// When the last reading ended.
    read_until: Duration,
    /// Since when there has been no pause between readings.
    busy_since: Option<Duration>,
    /// Whether so much is unread that events may soon be lost.
    endangered: bool,
    /// Since when the recorder has been quiet.
    quiet_since: Duration,
    /// How long it must be quiet before it reports again.
    calm: Duration,
}

impl LogWatcher {
    /// Reads a log every `interval`, from where `follower` stands. With `may_shorten` it reads more
    /// often if the ring could overflow in that time.
    #[must_use]
    pub fn polling(follower: LogFollower, interval: Duration, may_shorten: bool) -> LogWatcher {
        LogWatcher {
            follower,
            interval,
            may_shorten,
            switch: None,
            has_switched: false,
            due: Duration::ZERO,
            has_read: false,
            read_until: Duration::ZERO,
            busy_since: None,
            endangered: false,
            quiet_since: Duration::ZERO,
            calm: Duration::ZERO,
        }
    }

    /// Reads a log when the recorder reports, and every `interval` in case a report gets lost.
    #[must_use]
    pub fn reporting(
        follower: LogFollower,
        interval: Duration,
        switch: ReportSwitch,
    ) -> LogWatcher {
        LogWatcher { switch: Some(switch), ..LogWatcher::polling(follower, interval, true) }
    }

    /// Whether the recorder's report setting was changed and may have to be restored.
    #[must_use]
    pub fn has_switched(&self) -> bool {
        self.has_switched
    }

    /// Where the next reading begins.
    #[must_use]
    pub fn cursor(&self) -> Option<Cursor> {
        self.follower.cursor()
    }

    /// How many entries the log holds, as far as is known.
    #[must_use]
    pub fn log_size(&self) -> u16 {
        self.follower.size()
    }

    /// When the log was last known to hold nothing else, as
    /// [`LogFollower::complete_at`].
    #[must_use]
    pub fn complete_at(&self) -> Option<Duration> {
        self.follower.complete_at()
    }

    /// Makes the next step read the log, for example after a failure.
    pub fn read_next(&mut self) {
        self.due = Duration::ZERO;
    }

    /// Does what is due: reads, or switches the recorder's reports. Otherwise it waits for that or
    /// for a report, at most for `patience`. What a reading brings goes to `take`, as with
    /// [`LogFollower::read_new`]. If events come too fast, a reading may go on for ever.
    ///
    /// # Errors
    /// As for [`LogFollower::read_new`], and if the recorder refuses the setting.
    pub fn step<E: From<RequestError>>(
        &mut self,
        unit: &mut Unit,
        patience: Duration,
        take: &mut dyn FnMut(&Step<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        let now = unit.now();
        if let Some(on) = self.switch_due(now) {
            return Ok(self.report(unit, on)?);
        }
        if self.due <= now {
            return self.read(unit, take);
        }
        match unit.wait_event(patience.min(self.due - now))? {
            // Only a reading shows whether it is still the same log, and one reading covers all
            // reports.
            Some(Unsolicited::Report(_)) => self.due = unit.now(),
            // A printed line tells nothing that the log does not.
            Some(Unsolicited::Line(_)) | None => {}
        }
        Ok(())
    }

    fn is_reporting(&self) -> bool {
        self.switch.is_some_and(|switch| switch.is_on)
    }

    /// The setting that is due for the recorder's reports, if any.
    fn switch_due(&self, now: Duration) -> Option<bool> {
        let ReportSwitch { is_on, .. } = self.switch.filter(|_| self.has_read)?;
        let is_busy =
            self.endangered || self.busy_since.is_some_and(|since| now >= since + BUSY_FOR);
        let is_calm = now >= self.quiet_since + self.calm;
        match is_on {
            true => is_busy.then_some(false),
            false => is_calm.then_some(true),
        }
    }

    fn report(&mut self, unit: &mut Unit, on: bool) -> Result<(), RequestError> {
        let Some(switch) = &mut self.switch else { return Ok(()) };
        // The recorder may have carried out the command even if it did not answer.
        self.has_switched = true;
        unit.configure(if on { switch.on } else { switch.off })?;
        switch.is_on = on;
        let now = unit.now();
        if !on {
            self.calm = (2 * self.calm).clamp(CALM[0], CALM[1]);
        }
        (self.endangered, self.busy_since, self.quiet_since, self.due) = (false, None, now, now);
        Ok(())
    }

    fn read<E: From<RequestError>>(
        &mut self,
        unit: &mut Unit,
        take: &mut dyn FnMut(&Step<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        let began = unit.now();
        self.busy_since = match self.busy_since {
            _ if began > self.read_until + PAUSE => None,
            since => since.or(Some(began)),
        };
        // The first reading ends when it has passed what there was, and then the caller can ask
        // whether that was the log that it is said to be.
        self.follower.set_keeps_up(self.has_read && !self.is_reporting());
        let mut unread = 0;
        let summary = self.follower.read_new(unit, &mut |step| {
            unread = unread.max(step.pending);
            take(step)
        })?;
        let now = unit.now();
        let in_danger = unread > BURST.min(self.size() / 2) && unread > self.size() / DANGER;
        // What the first reading found says nothing about the present pace.
        self.endangered = self.has_read && (in_danger || summary.lost > 0);
        self.has_read = true;
        self.read_until = now;
        if summary.delivered >= QUIET {
            self.quiet_since = now;
        }
        self.due = now + self.pause(&summary, unit);
        Ok(())
    }

    /// How long to wait after a reading.
    fn pause(&self, summary: &Summary, unit: &Unit) -> Duration {
        if self.is_reporting() {
            return self.interval;
        }
        let may_overflow_in = line_rate(unit).time_for(EVENT_LEN) * self.size() / 2;
        match self.switch {
            Some(_) if summary.delivered >= FULL_REPLY => Duration::ZERO,
            Some(_) => BUSY_POLL.min(may_overflow_in),
            None if self.may_shorten && summary.delivered > self.size() / DANGER => Duration::ZERO,
            None if self.may_shorten => self.interval.min(may_overflow_in),
            None => self.interval,
        }
    }

    fn size(&self) -> u32 {
        self.follower.size().into()
    }
}

fn line_rate(unit: &Unit) -> LineRate {
    match LineRate::from(unit.bits_per_second()) {
        LineRate::Instant => HIGHEST_RATE,
        known @ LineRate::BitsPerSecond(_) => known,
    }
}
