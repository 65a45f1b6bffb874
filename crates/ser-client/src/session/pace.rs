//! Whether a recorder takes a request while it answers another one.
//!
//! Every request that the recorder took in this way earns credit, and every lost one costs some.
//! When the credit is used up, requests go one at a time.

/// The most credit: requests beyond this many earn nothing.
const MAX_CREDIT: u8 = 8;

/// The cost of a lost request, in requests that were taken: one loss in five is too many.
const LOSS: u8 = 4;

/// Answers after which a proven recorder is tried again. It has once earned `MAX_CREDIT`, so the
/// later losses were the line's.
const PROBATION: u8 = 100;

/// What is known about the recorder. It is tried as long as nothing is known.
#[derive(Debug, Default)]
pub(super) struct Pace {
    one_at_a_time: bool,
    credit: u8,
    /// Whether the recorder is known to take requests while it answers.
    proven: bool,
    /// Answers since requests have gone one at a time.
    alone: u8,
}

impl Pace {
    /// The pace of a recorder, or of a connection, that is always to get one request at a time.
    pub(super) const ONE_AT_A_TIME: Pace =
        Pace { one_at_a_time: true, credit: 0, proven: false, alone: 0 };

    /// Whether only one request may be under way.
    pub(super) const fn is_one_at_a_time(&self) -> bool {
        self.one_at_a_time
    }

    /// Takes note that a request was answered, and all before it. `behind` says whether it was sent
    /// while another one was under way.
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

    /// Takes note that one of two requests under way was not answered. Returns whether the second
    /// request is held to be the cause; requests then go one at a time.
    pub(super) fn lost(&mut self) -> bool {
        match self.credit.checked_sub(LOSS) {
            Some(credit) => self.credit = credit,
            None => self.one_at_a_time = true,
        }
        self.one_at_a_time
    }
}
