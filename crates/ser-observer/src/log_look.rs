//! Where a log stands, so that something that is not in it can be given its place.

use std::time::Duration;

use ser_client::{Clock, Cursor, RealTime, RequestError, Unit};
use ser_evidence::record::{EntryRecord, Life, Place};
use ser_proto::{Code, Command, Entry, Reply};

/// How often the newest entry is asked for while events keep coming.
const TRIES: u32 = 3;

/// The log at one moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogLook {
    /// Events since the log was erased, modulo 65536.
    total: u16,
    /// The newest entry, if there is one and it could be had.
    pub newest: Option<Entry>,
    /// The life of the log, where somebody has named it.
    life: Life,
    /// The sequence of the newest entry in that life, if it is known beyond 65536.
    sequence: Option<u64>,
}

/// What recorders count modulo.
const WRAP: u64 = 1 << 16;

/// By when the log is known to have held nothing after `cursor`; `None` if it holds more.
///
/// A report that was on its way may pass for the answer to one look. It has a total of its own, so
/// of two looks at the same total at least one was answered.
pub fn nothing_after(unit: &mut Unit, cursor: Cursor) -> Result<Option<Duration>, RequestError> {
    let asked_at = RealTime.now();
    let looks = [unit.log_position()?.total, unit.log_position()?.total];
    Ok((looks == [cursor.total(); 2]).then_some(asked_at))
}

impl LogLook {
    /// Looks now.
    pub fn take(unit: &mut Unit) -> Result<LogLook, RequestError> {
        let mut position = unit.log_position()?;
        for _ in 0..TRIES {
            // The newest entry is before the next one. Before the first comes the last, and only
            // recorders of ours say which that is.
            if position.next_slot == 0 {
                break;
            }
            let question = Command::Read { start: position.next_slot, count: 1 };
            let Reply::Read(reply) = unit.request(&question)? else {
                return Err(RequestError::UnexpectedReply { command: Code::Read });
            };
            let now = (&reply).into();
            if now == position {
                let newest = reply.entries.first().copied();
                return Ok(LogLook {
                    total: position.total,
                    newest,
                    life: Life::UNKNOWN,
                    sequence: None,
                });
            }
            position = now;
        }
        Ok(LogLook { total: position.total, newest: None, life: Life::UNKNOWN, sequence: None })
    }

    /// Names the life of an empty log. Of another one the newest entry tells which it is, and if
    /// that is the one that was delivered last, its life has a name.
    pub fn named(
        self,
        life_of_empty_log: impl FnOnce() -> Life,
        last_delivered: impl FnOnce() -> Option<EntryRecord>,
    ) -> LogLook {
        if self.total == 0 && self.newest.is_none() {
            return LogLook { life: life_of_empty_log(), ..self };
        }
        let is_newest = |last: &EntryRecord| {
            let total = last.sequence.map(|sequence| sequence % WRAP);
            total == Some(u64::from(self.total)) && Some(last.entry) == self.newest
        };
        match last_delivered().filter(is_newest) {
            Some(EntryRecord { life, sequence, .. }) => LogLook { life, sequence, ..self },
            None => self,
        }
    }

    /// The same where it can be found again; `None` if nothing tells which log it was.
    pub fn place_before(&self, total_after: u16) -> Option<Place> {
        let is_found = self.life.is_known() || self.newest.is_some();
        is_found.then(|| self.place(Some(total_after)))
    }

    /// The place of something that happened after this look, and before the log had this total.
    pub fn place(&self, total_after: Option<u16>) -> Place {
        let after = self.sequence.unwrap_or(self.total.into());
        let before = total_after.map(|total| {
            let more = u64::from(total.wrapping_sub(self.total));
            // Where the life has no name, totals are counted modulo 65536.
            self.sequence.map_or(total.into(), |_| after.saturating_add(more))
        });
        Place { life: self.life, after: Some(after), before, newest: self.newest, fellow: None }
    }
}
