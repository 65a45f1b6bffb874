//! The latest operations, for anyone who looks into a failed run.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::fmt::{self, Display};
use std::rc::Rc;

use super::digest::Digest;

/// How many operations are kept.
const KEPT: usize = 60;

/// The latest operations with their times, and the digest of all operations. Clones are the same
/// trail.
#[derive(Clone, Default)]
pub struct Trail {
    now_ms: Rc<Cell<u64>>,
    latest: Rc<RefCell<VecDeque<(u64, String)>>>,
    digest: Rc<RefCell<Digest>>,
    operations: Rc<Cell<u64>>,
}

impl Trail {
    /// Sets the present.
    pub fn set_now(&self, now_ms: u64) {
        self.now_ms.set(now_ms);
    }

    /// The present.
    #[must_use]
    pub fn now_ms(&self) -> u64 {
        self.now_ms.get()
    }

    /// Notes that something is done.
    pub fn note(&self, what: impl Display) {
        let text = what.to_string();
        self.mark(text.as_bytes());
        self.operations.set(self.operations.get() + 1);
        let mut latest = self.latest.borrow_mut();
        if latest.len() == KEPT {
            latest.pop_front();
        }
        latest.push_back((self.now_ms(), text));
    }

    /// Adds something to the digest that must be the same at this moment in every run of the seed.
    pub fn mark(&self, bytes: &[u8]) {
        let mut digest = self.digest.borrow_mut();
        digest.number(self.now_ms());
        digest.bytes(bytes);
    }

    /// The digest of everything so far.
    #[must_use]
    pub fn digest(&self) -> u64 {
        self.digest.borrow().value()
    }

    /// How many operations there were.
    #[must_use]
    pub fn operations(&self) -> u64 {
        self.operations.get()
    }
}

impl fmt::Display for Trail {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (at_ms, what) in self.latest.borrow().iter() {
            writeln!(f, "  {}  {what}", VirtualTime(*at_ms))?;
        }
        Ok(())
    }
}

/// Virtual time as days, hours, minutes, seconds.
#[derive(Clone, Copy, Debug)]
pub struct VirtualTime(pub u64);

impl fmt::Display for VirtualTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (seconds, ms) = (self.0 / 1000, self.0 % 1000);
        let (days, hours) = (seconds / 86_400, seconds / 3600 % 24);
        write!(f, "{days}d {hours:02}:{:02}:{:02}.{ms:03}", seconds / 60 % 60, seconds % 60)
    }
}
