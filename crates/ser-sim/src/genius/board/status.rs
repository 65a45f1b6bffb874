//! The status table (chapter 5).

use std::collections::VecDeque;

use super::Board;
use super::interrupts::Condition;
use super::presence::Power;
use crate::genius::map;

/// How many errors within [`INTERVAL_US`] are excessive.
const EXCESSIVE: usize = 10;
/// The time in which errors are counted.
const INTERVAL_US: u64 = 10_000_000;

// Bits 1 and 3 of the byte, counted from 1.
const MONITOR_PRESENT: u8 = 0x01;
const EXCESSIVE_ERRORS: u8 = 0x04;

/// The errors the board has noticed on the bus.
#[derive(Clone, Debug, Default)]
pub(super) struct BusErrors {
    count: u16,
    latest_us: VecDeque<u64>,
    excessive: bool,
}

impl BusErrors {
    fn note(&mut self, now_us: u64) {
        self.count = self.count.wrapping_add(1);
        if self.latest_us.len() == EXCESSIVE {
            self.latest_us.pop_front();
        }
        self.latest_us.push_back(now_us);
    }

    fn calm_at_us(&self) -> Option<u64> {
        let tenth = self.latest_us.front().filter(|_| self.latest_us.len() == EXCESSIVE)?;
        Some(tenth + INTERVAL_US)
    }

    /// When the errors stop being excessive.
    pub(super) fn due_us(&self) -> Option<u64> {
        self.calm_at_us().filter(|_| self.excessive)
    }
}

impl Board {
    pub(super) fn count_error(&mut self) {
        if self.power == Power::Running {
            self.live.errors.note(self.now_us);
            self.ram.set_word(map::BUS_ERRORS, self.live.errors.count);
            self.judge_errors();
        }
    }

    pub(super) fn judge_errors(&mut self) {
        let excessive = self.live.errors.calm_at_us().is_some_and(|calm_us| calm_us > self.now_us);
        if excessive != self.live.errors.excessive {
            self.live.errors.excessive = excessive;
            self.show_active();
            if excessive {
                self.raise(Condition::BoardStatus);
            }
        }
    }

    pub(super) fn show_active(&mut self) {
        if self.power == Power::Running {
            let monitor = if self.monitor_plugged { MONITOR_PRESENT } else { 0 };
            let excessive = if self.live.errors.excessive { EXCESSIVE_ERRORS } else { 0 };
            self.ram.set(map::ACTIVE, monitor | excessive);
        }
    }

    /// Shows no scan time, because none is known before the second turn on the bus.
    pub(super) fn show_no_scan(&mut self) {
        self.ram.set_word(map::SCAN_TIME, 0xFFFF);
    }

    pub(super) fn measure_scan(&mut self) {
        self.expect_turn();
        let before_us = self.live.last_turn_us.replace(self.now_us);
        if let Some(before_us) = before_us {
            let scan_ms = (self.now_us - before_us + 500) / 1000;
            self.ram.set_word(map::SCAN_TIME, u16::try_from(scan_ms).unwrap_or(0xFFFE));
        }
    }
}
