//! The setup table and the Configuration Change command (chapters 4 and 10).

use super::Board;
use super::commands::{COMPLETE, PROCESS_ERROR, SYNTAX_ERROR};
use super::presence::{OFF_BUS_US, Presence};
use crate::genius::map;
use crate::genius::scan_time::BusTiming;

/// The configuration in force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Setup {
    switches: u8,
    pub(super) reference: u16,
    pub(super) broadcast_len: u8,
    pub(super) directed_len: u8,
    pub(super) buffer_len: u8,
}

impl Setup {
    pub(super) fn new(switches: u8) -> Setup {
        Setup { switches, reference: 0xFFFF, broadcast_len: 0, directed_len: 0, buffer_len: 128 }
    }

    pub(super) fn switches(self) -> u8 {
        self.switches
    }

    pub(super) fn number(self) -> u8 {
        self.switches & 0x1F
    }

    pub(super) fn set_number(&mut self, switches: u8) {
        self.switches = self.switches & !0x1F | switches & 0x1F;
    }

    pub(super) fn rate(self) -> BusTiming {
        BusTiming::from_dip_switches(self.switches)
    }

    pub(super) fn outputs_enabled(self) -> bool {
        self.switches & 0x80 != 0
    }

    fn is_valid(self) -> bool {
        self.broadcast_len <= 128
            && self.directed_len <= 128
            && (1..=128).contains(&self.buffer_len)
    }
}

impl Board {
    pub(super) fn show_setup(&mut self) {
        let setup = self.live.setup;
        self.ram.set(map::DIP_SWITCHES, setup.switches);
        self.ram.set_word(map::REFERENCE, setup.reference);
        self.ram.set(map::BROADCAST_LENGTH, setup.broadcast_len);
        self.ram.set(map::DIRECTED_LENGTH, setup.directed_len);
        self.ram.set(map::BUFFER_LENGTH, setup.buffer_len);
    }

    /// Takes what the host wrote into the setup table, and returns the command's completion status.
    ///
    /// If only the buffer length is new, the board keeps taking its turns, but all devices are
    /// logged out and none is logged in for that time. Before the board first enters the bus a
    /// change costs no extra time.
    pub(super) fn change_configuration(&mut self) -> u8 {
        let old = self.live.setup;
        let new = Setup {
            switches: old.switches,
            reference: self.ram.word(map::REFERENCE),
            broadcast_len: self.ram.get(map::BROADCAST_LENGTH),
            directed_len: self.ram.get(map::DIRECTED_LENGTH),
            buffer_len: self.ram.get(map::BUFFER_LENGTH),
        };
        if !new.is_valid() {
            self.show_setup();
            return SYNTAX_ERROR;
        }
        // A host that has overwritten the switches finds them restored in every case.
        self.ram.set(map::DIP_SWITCHES, old.switches);
        if new == old {
            return PROCESS_ERROR;
        }
        self.live.setup = new;
        let stops_turns = Setup { buffer_len: old.buffer_len, ..new } != old;
        match self.live.presence {
            Presence::Off { .. } if self.live.log_ins.is_new() => {}
            Presence::On if !stops_turns => {
                self.log_out_all();
                self.live.log_ins.refuse_until(self.now_us + OFF_BUS_US);
            }
            Presence::On | Presence::Off { .. } => self.stay_off_bus(OFF_BUS_US),
            // The bus address is still taken.
            Presence::Conflict { .. } => {}
        }
        COMPLETE
    }
}
