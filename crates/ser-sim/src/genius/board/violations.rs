//! The rules of the manual that a host broke.

use std::fmt;

/// Which rule was broken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ViolationKind {
    /// Access in the first 1.7 seconds after reset (chapters 2 and 3).
    TooEarly,
    /// Access to the reserved area (chapter 3).
    ReservedArea,
    /// A write to something that only the board writes: the switches in the setup table, the status
    /// table except the OK flag, the device table except the outputs flag (chapters 4, 5, 7).
    ReadOnly,
    /// A write to the lockout state, or a request that does not fit it (chapter 9).
    Lockout,
    /// A command while another was being carried out (chapter 10).
    CommandBusy,
    /// A write to the request queue's tail pointer (chapter 13).
    TailPointer,
    /// A head pointer beyond the tail, or a request released without a status (chapter 13).
    RequestQueue,
}

/// A rule that the host broke.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Violation {
    /// When it happened, in microseconds.
    pub at_us: u64,
    /// Which rule.
    pub kind: ViolationKind,
    /// Where in the shared RAM.
    pub offset: u16,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let what = match self.kind {
            ViolationKind::TooEarly => "access less than 1.7 s after reset",
            ViolationKind::ReservedArea => "access to the reserved area",
            ViolationKind::ReadOnly => "write to what only the board writes",
            ViolationKind::Lockout => "lockout request that does not fit its state",
            ViolationKind::CommandBusy => "command while another one was being carried out",
            ViolationKind::TailPointer => "write to the tail pointer of the request queue",
            ViolationKind::RequestQueue => {
                "head pointer of the request queue beyond its tail, or no status"
            }
        };
        write!(f, "{what} (at {:04X}h)", self.offset)
    }
}

/// How many are kept, because a host that breaks rules does so again and again.
const KEPT: usize = 64;

#[derive(Debug, Default)]
pub(super) struct Violations {
    kept: Vec<Violation>,
    /// How many of them have already been reported as new.
    told: usize,
}

impl Violations {
    pub(super) fn note(&mut self, at_us: u64, kind: ViolationKind, offset: usize) {
        if self.kept.len() < KEPT {
            let offset = u16::try_from(offset).unwrap_or(u16::MAX);
            self.kept.push(Violation { at_us, kind, offset });
        }
    }

    pub(super) fn take_new(&mut self) -> Vec<Violation> {
        let new = self.kept.get(self.told..).unwrap_or_default().to_vec();
        self.told = self.kept.len();
        new
    }

    pub(super) fn kept(&self) -> &[Violation] {
        &self.kept
    }
}
