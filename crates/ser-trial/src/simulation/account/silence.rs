//! Why events may be gone with the log without a report. Each reason is a limit that
//! `docs/guarantees.md` names, or the end of the run. For any other reason, silence is wrong.

/// What a reader has to go by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Known {
    /// It has never read the log.
    Nothing,
    /// It found the log empty when it last looked, so it knows no event that could be missing.
    EmptyLog,
    /// It knows the last event that it was given.
    Event,
}

/// Why events are gone without a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Silence {
    /// The reader had never read the log before.
    FirstReading,
    /// The log was empty when the reader last looked.
    EmptyLog,
    /// The log has had as many events since as it holds, so all this looks like overwriting.
    FullAgain,
}

/// Events that are gone without a report, counted by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Unreported {
    /// Gone before the reader's first reading, which finds nothing missing.
    pub first_reading: u64,
    /// Came and went while the reader knew only that the log was empty.
    pub empty_log: u64,
    /// Gone from a log that was full again at the next look. The number reported as overwritten
    /// there is the difference of two unrelated totals.
    pub full_again: u64,
    /// Gone with the power at the end of a life after which this reader has not read.
    pub not_read_since: u64,
}

impl Unreported {
    /// The sum of all reasons.
    #[must_use]
    pub fn all(&self) -> u64 {
        self.first_reading + self.empty_log + self.full_again + self.not_read_since
    }

    /// Counts events for this reason.
    pub(super) fn count(&mut self, events: u64, silence: Silence) {
        *match silence {
            Silence::FirstReading => &mut self.first_reading,
            Silence::EmptyLog => &mut self.empty_log,
            Silence::FullAgain => &mut self.full_again,
        } += events;
    }
}

impl Known {
    /// Why a reader that knows this finds no trace of an erase, depending on whether the log is
    /// full again; `None` if it must find one.
    pub(super) fn silence(self, full_again: bool) -> Option<Silence> {
        match self {
            Known::Nothing => Some(Silence::FirstReading),
            Known::EmptyLog => Some(Silence::EmptyLog),
            Known::Event => full_again.then_some(Silence::FullAgain),
        }
    }
}
