//! Reset, power-up, and being on the bus or not (chapters 2, 3 and 14).

use super::Board;
use super::interrupts::Condition;
use super::live::Live;
use super::presence::{OFF_BUS_US, Power, Presence, Stage};
use super::reason::Reason;
use super::violations::ViolationKind;
use crate::genius::map;
use crate::genius::outbox::Outbox;

/// How long after reset an access can make the board's watchdog time out.
const FRAGILE_US: u64 = 500;
/// When after reset one interrupt comes that means nothing.
const FALSE_INTERRUPT_US: u64 = 250;
/// When the self-test changes its pattern in the RAM. Each pattern stands for half of the time.
const SECOND_PATTERN_US: u64 = 850_000;
/// From this time after reset the host may access the RAM.
const HOST_MAY_ACCESS_US: u64 = 1_700_000;
/// How recently a bus address must have been heard to be in use. This is longer than the longest
/// scan.
const NUMBER_IN_USE_US: u64 = 1_200_000;
/// After this long without a turn the board cannot get at the bus. This too is longer than a scan.
const TURN_MISSED_US: u64 = 1_000_000;
pub(super) const HEARTBEAT_US: u64 = 200_000;

/// A lamp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Led {
    /// Dark.
    Off,
    /// Lit.
    On,
    /// Blinking.
    Flashing,
}

/// The two lamps of the board, which are also pins to the host.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Leds {
    /// The board works.
    pub board_ok: Led,
    /// It takes its turns on the bus.
    pub comm_ok: Led,
}

impl Board {
    /// Pulls the reset line. Everything stops.
    pub fn hold_reset(&mut self) {
        self.power = Power::InReset;
        self.live = Live::new(self.switches);
        self.ram.fill(0xFF);
    }

    /// Lets the reset line go. The board starts.
    pub fn release_reset(&mut self) {
        if self.power == Power::InReset {
            self.power = Power::SelfTest { released_us: self.now_us, stage: Stage::Released };
            self.ram.fill(0x55);
        }
    }

    /// Starts time for a board that has known none.
    pub(super) fn power_up_at(&mut self, now_us: u64) {
        self.now_us = now_us;
        if let Power::SelfTest { released_us, .. } = &mut self.power {
            *released_us = now_us;
        }
    }

    /// Whether the reset line is held.
    #[must_use]
    pub fn is_in_reset(&self) -> bool {
        self.power == Power::InReset
    }

    /// The lamps. After a conflict of bus addresses both blink.
    #[must_use]
    pub fn leds(&self) -> Leds {
        let (board_ok, comm_ok) = match (self.power, self.live.presence) {
            (Power::Running, Presence::On) if self.live.turn_missed_us.is_some() => {
                (Led::On, Led::On)
            }
            (Power::Running, Presence::On | Presence::Off { .. }) => (Led::On, Led::Off),
            (Power::Running, Presence::Conflict { .. }) => (Led::Flashing, Led::Flashing),
            _ => (Led::Off, Led::Off),
        };
        Leds { board_ok, comm_ok }
    }

    /// Whether the board takes its turns on the bus.
    #[must_use]
    pub fn is_on_bus(&self) -> bool {
        self.power == Power::Running && self.live.presence == Presence::On
    }

    /// Handles an access at a time when the manual forbids it.
    pub(super) fn check_not_too_early(&mut self, offset: usize) {
        if let Power::SelfTest { released_us, .. } = self.power {
            let age_us = self.now_us - released_us;
            if age_us < HOST_MAY_ACCESS_US {
                self.violations.note(self.now_us, ViolationKind::TooEarly, offset);
            }
            if age_us < FRAGILE_US {
                self.power = Power::Stopped;
            }
        }
    }

    pub(super) fn start_up_due_us(&self) -> Option<u64> {
        let Power::SelfTest { released_us, stage } = self.power else { return None };
        Some(
            released_us
                + match stage {
                    Stage::Released => FALSE_INTERRUPT_US,
                    Stage::Interrupted => SECOND_PATTERN_US,
                    Stage::SecondPattern => HOST_MAY_ACCESS_US,
                    Stage::RamReady => self.options.timing.ok_after_us.max(HOST_MAY_ACCESS_US),
                },
        )
    }

    pub(super) fn go_on_starting(&mut self) {
        let Power::SelfTest { released_us, stage } = self.power else { return };
        let mut reach = |stage| self.power = Power::SelfTest { released_us, stage };
        match stage {
            Stage::Released => {
                reach(Stage::Interrupted);
                self.interrupts.pulse(self.now_us);
            }
            Stage::Interrupted => {
                reach(Stage::SecondPattern);
                self.ram.fill(0xAA);
            }
            Stage::SecondPattern => {
                let faults = std::mem::take(&mut self.faults.next_start);
                if faults == 0 {
                    reach(Stage::RamReady);
                    self.set_defaults();
                } else {
                    // The host gets to see the faults and nothing else. The rest of the RAM stays
                    // as it is.
                    self.power = Power::Stopped;
                    self.ram.write(map::STATUS, &[0; map::STATUS_LEN]);
                    self.ram.set(map::HARDWARE, faults);
                }
            }
            Stage::RamReady => {
                self.power = Power::Running;
                self.ram.set(map::BOARD_OK, 1);
                self.live.heartbeat_us = Some(self.now_us + HEARTBEAT_US);
                self.stay_off_bus(OFF_BUS_US);
                self.show_active();
            }
        }
    }

    /// The contents of the RAM after a successful self-test.
    fn set_defaults(&mut self) {
        self.live = Live::new(self.switches);
        self.ram.fill(0);
        self.ram.set(map::REVISION, self.options.revision);
        self.ram.set(map::COMMAND_STATUS, super::commands::COMPLETE);
        let outputs_disabled = u8::from(!self.live.setup.outputs_enabled());
        for address in 0..32 {
            self.ram.set(map::device(address) + map::DEVICE_OUTPUTS, outputs_disabled);
        }
        self.show_setup();
    }

    pub(super) fn beat(&mut self) {
        self.ram.set(map::BOARD_OK, 1);
        self.live.heartbeat_us = Some(self.now_us + HEARTBEAT_US);
    }

    /// Takes no turns for a while. What was on its way is lost.
    pub(super) fn stay_off_bus(&mut self, for_us: u64) {
        self.live.presence = Presence::Off { until_us: self.now_us + for_us };
        self.live.outbox = Outbox::default();
        self.miss_turns();
    }

    pub(super) fn presence_due_us(&self) -> Option<u64> {
        match self.live.presence {
            Presence::Off { until_us } => Some(until_us).filter(|&until_us| until_us < u64::MAX),
            Presence::Conflict { heard_us } => Some(heard_us + NUMBER_IN_USE_US),
            Presence::On => None,
        }
    }

    /// Ends the wait: enters the bus, unless the bus address is in use there.
    pub(super) fn enter_bus(&mut self) {
        let in_use = self
            .live
            .log_ins
            .own_number_heard_us()
            .filter(|heard_us| heard_us + NUMBER_IN_USE_US > self.now_us);
        self.live.presence = match in_use {
            Some(heard_us) => Presence::Conflict { heard_us },
            None => {
                self.live.log_ins.enter_bus();
                self.expect_turn();
                Presence::On
            }
        };
    }

    pub(super) fn expect_turn(&mut self) {
        self.live.turn_missed_us = Some(self.now_us + TURN_MISSED_US);
    }

    /// The board cannot get at the bus. All devices count as gone, and what waits for its turn has
    /// failed.
    pub(super) fn miss_turns(&mut self) {
        self.live.turn_missed_us = None;
        self.live.last_turn_us = None;
        self.show_no_scan();
        self.log_out_all();
        self.live.outbox.remove(|&reason| reason == Reason::Command);
        self.transmitted(false);
    }

    /// Another device took the same turn.
    pub(super) fn find_conflict(&mut self) {
        if self.live.presence == Presence::On {
            self.stay_off_bus(OFF_BUS_US);
            self.live.log_ins.hear_own_number(self.now_us);
            self.live.presence = Presence::Conflict { heard_us: self.now_us };
        }
    }

    /// Follows the switches for the bus address without a reset, as the board does in a conflict.
    pub(super) fn leave_conflict(&mut self) {
        let conflict = matches!(self.live.presence, Presence::Conflict { .. });
        if self.power == Power::Running && conflict && self.switches & 0x1F != self.number() {
            self.live.setup.set_number(self.switches);
            self.ram.set(map::DIP_SWITCHES, self.live.setup.switches());
            self.live.log_ins = super::log_in::LogIns::default();
            self.stay_off_bus(OFF_BUS_US);
        }
    }

    /// A self-test found a fault: outputs and everything else stop at once.
    ///
    /// The manual clears the OK flag only when the status change interrupt is enabled.
    pub(super) fn fail_self_test(&mut self, faults: u8) {
        if self.power == Power::Running && faults != 0 {
            self.ram.set(map::HARDWARE, faults);
            if self.is_enabled(Condition::BoardStatus) {
                self.ram.set(map::BOARD_OK, 0);
            }
            self.raise(Condition::BoardStatus);
            self.power = Power::Stopped;
        }
    }

    pub(super) fn hang(&mut self) {
        if self.power != Power::InReset {
            self.power = Power::Stopped;
        }
    }
}
