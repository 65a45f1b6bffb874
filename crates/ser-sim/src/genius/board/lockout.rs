//! Keeping the board away from the tables while the host uses them (chapter 9).

use super::Board;
use super::interrupts::Condition;
use crate::genius::map;

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Lockout {
    /// When the board looks at the request.
    pub(super) look_us: Option<u64>,
    pub(super) granted: bool,
}

impl Board {
    /// Lets the state follow the request. The board never accesses the tables itself at the moment
    /// when it looks.
    pub(super) fn follow_lockout_request(&mut self) {
        self.live.lockout.look_us = None;
        let wanted = self.ram.bit0(map::LOCKOUT_REQUEST);
        if wanted != self.live.lockout.granted {
            self.live.lockout.granted = wanted;
            self.ram.set(map::LOCKOUT_STATE, u8::from(wanted));
            if wanted {
                self.raise(Condition::LockoutGrant);
            }
        }
    }
}
