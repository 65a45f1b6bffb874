//! The lockout handshake (chapter 9), without blocking.

use crate::counters::{Counters, count};
use crate::elapsed::elapsed_ms;
use crate::event::Failure;
use crate::lockout::Lockout;
use crate::ram::SharedRam;
use crate::timing;

/// The state of the handshake.
#[derive(Clone, Copy, Debug)]
enum State {
    Free,
    Requested { since_ms: u32 },
    Held,
    Releasing { since_ms: u32 },
}

/// Requests, holds and releases lockout.
#[derive(Debug)]
pub(super) struct Locker {
    state: State,
    /// Whether to check the bytes even when no lock is wanted: a host that died may have left them
    /// set.
    due: bool,
    released_ms: Option<u32>,
    /// How long the board may take to answer, at least.
    patience_ms: u32,
}

impl Locker {
    pub(super) const fn new(patience_ms: u32) -> Locker {
        Locker { state: State::Free, due: true, released_ms: None, patience_ms }
    }

    pub(super) fn due(&mut self) {
        self.due = true;
    }

    pub(super) fn is_free(&self) -> bool {
        matches!(self.state, State::Free)
    }

    pub(super) fn is_held(&self) -> bool {
        matches!(self.state, State::Held)
    }

    /// True when the board has just been locked out.
    ///
    /// At least `gap_ms` pass between two lockouts. A host that always wants the tables thus leaves
    /// the board a bus scan to exchange them.
    pub(super) fn poll<R: SharedRam>(
        &mut self,
        ram: &mut R,
        now_ms: u32,
        wanted: bool,
        gap_ms: u32,
        counters: &mut Counters,
    ) -> Result<bool, Failure> {
        match self.state {
            State::Free => {
                let rested = self
                    .released_ms
                    .is_none_or(|released_ms| elapsed_ms(now_ms, released_ms) > gap_ms);
                if rested && (wanted || self.due) {
                    self.due = false;
                    self.released_ms = None;
                    self.begin(ram, now_ms, wanted, counters);
                }
            }
            State::Requested { since_ms } => match Lockout::read(ram) {
                Lockout::Locked => {
                    self.state = State::Held;
                    return Ok(true);
                }
                Lockout::Requested => self.wait(now_ms, since_ms)?,
                Lockout::Free => self.lose(counters),
                Lockout::Releasing => {
                    count(&mut counters.lockouts_lost);
                    self.state = State::Releasing { since_ms: now_ms };
                }
            },
            State::Held => {}
            State::Releasing { since_ms } => match Lockout::read(ram) {
                Lockout::Free => {
                    self.state = State::Free;
                    self.released_ms = Some(now_ms);
                }
                Lockout::Releasing => self.wait(now_ms, since_ms)?,
                Lockout::Requested | Lockout::Locked => {
                    count(&mut counters.lockouts_foreign);
                    self.state = State::Requested { since_ms: now_ms };
                }
            },
        }
        Ok(false)
    }

    /// A request must not be made over another one, and an ungranted one must not be withdrawn. So
    /// what another program has left behind is first completed.
    fn begin<R: SharedRam>(
        &mut self,
        ram: &mut R,
        now_ms: u32,
        wanted: bool,
        counters: &mut Counters,
    ) {
        self.state = match Lockout::read(ram) {
            Lockout::Free if wanted => {
                Lockout::request(ram);
                State::Requested { since_ms: now_ms }
            }
            Lockout::Free => State::Free,
            Lockout::Requested => {
                count(&mut counters.lockouts_foreign);
                State::Requested { since_ms: now_ms }
            }
            Lockout::Locked => {
                count(&mut counters.lockouts_foreign);
                Lockout::release(ram);
                State::Releasing { since_ms: now_ms }
            }
            Lockout::Releasing => State::Releasing { since_ms: now_ms },
        };
    }

    /// Gives the tables back to the board, if they are locked.
    pub(super) fn end_hold<R: SharedRam>(
        &mut self,
        ram: &mut R,
        now_ms: u32,
        counters: &mut Counters,
    ) {
        if !self.is_held() {
            return;
        }
        match Lockout::read(ram) {
            Lockout::Locked => {
                Lockout::release(ram);
                self.state = State::Releasing { since_ms: now_ms };
            }
            Lockout::Requested => {
                count(&mut counters.lockouts_lost);
                self.state = State::Requested { since_ms: now_ms };
            }
            Lockout::Free => self.lose(counters),
            Lockout::Releasing => {
                count(&mut counters.lockouts_lost);
                self.state = State::Releasing { since_ms: now_ms };
            }
        }
    }

    fn lose(&mut self, counters: &mut Counters) {
        count(&mut counters.lockouts_lost);
        self.state = State::Free;
    }

    fn wait(&self, now_ms: u32, since_ms: u32) -> Result<(), Failure> {
        if elapsed_ms(now_ms, since_ms) < timing::LOCKOUT_STUCK_MS.max(self.patience_ms) {
            Ok(())
        } else {
            Err(Failure::LockoutStuck)
        }
    }
}
