//! Whether a recorder takes a request while it answers another one.
//!
//! Every request that was taken in this way is a credit, and every one that was lost costs some.
//! When the credit is used up, requests go one at a time.

/// Requests that were taken in this way, up to which they count.
const MAX_CREDIT: u8 = 8;

/// As much as one that was lost weighs against those that were taken: one in five is too many.
const LOSS: u8 = 4;

/// Answers after which a recorder that has taken `MAX_CREDIT` requests once, on a line that was bad
/// since, is tried again.
const PROBATION: u8 = 100;

/// What is known about the recorder. At first nothing is, and it is tried.
#[derive(Debug, Default)]
pub(super) struct Pace {
    one_at_a_time: bool,
    credit: u8,
    /// Whether the recorder is known to take requests while it answers.
    proven: bool,
    /// Answers since it has been one at a time.
    alone: u8,
}

impl Pace {
    /// That of a recorder, or a way to it, for which one request at a time is right.
    pub(super) const ONE_AT_A_TIME: Pace =
        Pace { one_at_a_time: true, credit: 0, proven: false, alone: 0 };

    /// Whether there must be no other request under way.
    pub(super) const fn is_one_at_a_time(&self) -> bool {
        self.one_at_a_time
    }

    /// A request was answered, and those before it were; `behind` says whether it was sent while
    /// another one was under way.
    pub(super) fn kept(&mut self, behind: bool) {
        if behind {
            self.credit = MAX_CREDIT.min(self.credit + 1);
            self.proven |= self.credit == MAX_CREDIT;
        } else if self.one_at_a_time && self.proven {
            self.alone += 1;
            if self.alone == PROBATION {
                *self = Pace { one_at_a_time: false, credit: LOSS, proven: true, alone: 0 };
            }
        }
    }

    /// One of two requests under way was not answered. Whether that is put down to there having
    /// been two: then it is one at a time.
    pub(super) fn lost(&mut self) -> bool {
        match self.credit.checked_sub(LOSS) {
            Some(credit) => self.credit = credit,
            None => self.one_at_a_time = true,
        }
        self.one_at_a_time
    }
}
