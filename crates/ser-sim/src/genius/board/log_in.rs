//! Who is on the bus (chapters 3 and 7).

use super::Board;
use super::interrupts::Condition;
use super::reason::Reason;
use crate::genius::datagram::{Datagram, MessagePriority, subfunction};
use crate::genius::device::Message;
use crate::genius::identity::{BlockKind, Identity};
use crate::genius::map;

/// How many scans a device may send nothing before it is logged out.
const SILENT_SCANS: u8 = 3;
/// How many scans the board waits for a Read ID reply before it asks again.
const ASK_AGAIN_SCANS: u8 = 10;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum State {
    #[default]
    Absent,
    Present {
        input_len: u8,
        output_len: u8,
        kind: u8,
    },
    /// The device has too much data. The board asks again only after the device has been away.
    Refused,
}

#[derive(Clone, Copy, Debug, Default)]
struct LogIn {
    state: State,
    /// Something was heard since the board's latest turn.
    heard: bool,
    silent_scans: u8,
    /// Scans left for the answer to a Read ID.
    asked_scans: u8,
    /// The device takes its outputs from this board.
    assigned: bool,
    /// The board has read outputs for it since it logged in.
    outputs_read: bool,
}

#[derive(Clone, Debug, Default)]
pub(super) struct LogIns {
    devices: [LogIn; 32],
    own_number_heard_us: Option<u64>,
    refuse_until_us: u64,
    been_on_bus: bool,
}

impl LogIns {
    pub(super) fn own_number_heard_us(&self) -> Option<u64> {
        self.own_number_heard_us
    }

    pub(super) fn hear_own_number(&mut self, now_us: u64) {
        self.own_number_heard_us = Some(now_us);
    }

    /// Logs in nobody before then.
    pub(super) fn refuse_until(&mut self, until_us: u64) {
        self.refuse_until_us = until_us;
    }

    pub(super) fn enter_bus(&mut self) {
        self.been_on_bus = true;
    }

    /// Whether the board has not been on the bus since its reset.
    pub(super) fn is_new(&self) -> bool {
        !self.been_on_bus
    }

    pub(super) fn outputs_were_read(&mut self) {
        for device in &mut self.devices {
            device.outputs_read = matches!(device.state, State::Present { .. });
        }
    }
}

impl Board {
    /// Inputs or global data from a device.
    pub(super) fn hear_inputs(&mut self, from: u8, data: &[u8]) {
        if from == self.number() {
            self.live.log_ins.hear_own_number(self.now_us);
            return;
        }
        if !self.is_on_bus() {
            return;
        }
        let asking = self.live.outbox.contains(|&reason| reason == Reason::LogIn { address: from });
        let refuse = self.now_us < self.live.log_ins.refuse_until_us;
        let Some(device) = self.live.log_ins.devices.get_mut(usize::from(from)) else { return };
        device.heard = true;
        match device.state {
            State::Present { .. } => self.live.copies.set_inputs(from, data),
            State::Absent if !asking && !refuse && device.asked_scans == 0 => {
                let datagram = Datagram::standard(subfunction::READ_ID, []);
                let message = Message::Datagram { to: from, datagram };
                self.live.outbox.push(
                    MessagePriority::Normal,
                    message,
                    Reason::LogIn { address: from },
                );
            }
            State::Absent | State::Refused => {}
        }
    }

    /// A Read ID of the board's own is out. Without an acknowledgement the board asks again when it
    /// next hears the device.
    pub(super) fn asked_for_identity(&mut self, address: u8, arrived: bool) {
        let device = &mut self.live.log_ins.devices[usize::from(address)];
        device.asked_scans = if arrived { ASK_AGAIN_SCANS } else { 0 };
    }

    pub(super) fn waits_for_identity(&self, address: u8) -> bool {
        self.live
            .log_ins
            .devices
            .get(usize::from(address))
            .is_some_and(|device| device.asked_scans > 0)
    }

    /// A Read ID reply to the board's question.
    pub(super) fn log_in(&mut self, address: u8, identity: Identity) {
        self.show_identity(address, identity);
        let fits = identity.input_len.max(identity.output_len) <= self.live.setup.buffer_len;
        let device = &mut self.live.log_ins.devices[usize::from(address)];
        device.asked_scans = 0;
        if !fits {
            device.state = State::Refused;
            return;
        }
        let Identity { input_len, output_len, kind, .. } = identity;
        device.state = State::Present { input_len, output_len, kind: kind as u8 };
        if self.live.setup.outputs_enabled() {
            self.ram.set(map::device(address) + map::DEVICE_OUTPUTS, 0);
        }
        self.ram.set(map::device(address) + map::DEVICE_PRESENT, 1);
        self.raise(Condition::DeviceStatus);
    }

    /// A device that is logged in says that it was reconfigured.
    pub(super) fn configuration_changed(&mut self, address: u8, identity: Identity) {
        let Some(device) = self.live.log_ins.devices.get_mut(usize::from(address)) else { return };
        let State::Present { input_len, output_len, kind } = device.state else { return };
        let Identity {
            input_len: new_input_len, output_len: new_output_len, kind: new_kind, ..
        } = identity;
        if (new_input_len, new_output_len, new_kind as u8) == (input_len, output_len, kind) {
            return;
        }
        if new_input_len.max(new_output_len) > self.live.setup.buffer_len {
            self.log_out(address);
            self.live.log_ins.devices[usize::from(address)].state = State::Refused;
        } else {
            device.state = State::Present {
                input_len: new_input_len,
                output_len: new_output_len,
                kind: new_kind as u8,
            };
        }
        self.raise(Condition::DeviceStatus);
        self.show_identity(address, identity);
    }

    fn show_identity(&mut self, address: u8, identity: Identity) {
        let entry = map::device(address);
        self.ram.set(entry + map::DEVICE_MODEL, identity.model);
        self.ram.set_word(entry + map::DEVICE_REFERENCE, identity.reference);
        self.ram.set(entry + map::DEVICE_BROADCAST_LENGTH, identity.input_len);
        self.ram.set(entry + map::DEVICE_DIRECTED_LENGTH, identity.output_len);
        self.ram.set(entry + map::DEVICE_BLOCK, identity.kind as u8);
    }

    /// Logs out the devices that have been silent for three scans. Called once per turn.
    pub(super) fn miss_silent_devices(&mut self) {
        for address in 0..32 {
            let device = &mut self.live.log_ins.devices[usize::from(address)];
            device.asked_scans = device.asked_scans.saturating_sub(1);
            if std::mem::take(&mut device.heard) {
                device.silent_scans = 0;
                continue;
            }
            device.silent_scans = device.silent_scans.saturating_add(1);
            if device.silent_scans < SILENT_SCANS {
                continue;
            }
            match device.state {
                State::Present { .. } => {
                    self.log_out(address);
                    self.raise(Condition::DeviceStatus);
                }
                State::Refused => device.state = State::Absent,
                State::Absent => {}
            }
        }
    }

    fn log_out(&mut self, address: u8) {
        self.live.log_ins.devices[usize::from(address)] = LogIn::default();
        self.live.copies.forget_inputs(address);
        self.live.outbox.remove(|&reason| {
            reason == Reason::LogIn { address } || reason == Reason::Assign { address }
        });
        self.ram.set(map::device(address) + map::DEVICE_PRESENT, 0);
    }

    /// Logs out all devices, because the configuration or the bus address changed.
    pub(super) fn log_out_all(&mut self) {
        let mut any = false;
        for address in 0..32 {
            let state = self.live.log_ins.devices[usize::from(address)].state;
            any |= matches!(state, State::Present { .. });
            self.log_out(address);
        }
        if any {
            self.raise(Condition::DeviceStatus);
        }
    }

    /// Follows the outputs flags of the device table. A device that is to take outputs from this
    /// board is told so first.
    pub(super) fn follow_outputs_flags(&mut self) {
        for address in 0..32 {
            let disabled = self.ram.bit0(map::device(address) + map::DEVICE_OUTPUTS);
            let telling = self.live.outbox.contains(|&reason| reason == Reason::Assign { address });
            let device = &mut self.live.log_ins.devices[usize::from(address)];
            if disabled {
                device.assigned = false;
            } else if !device.assigned && !telling && matches!(device.state, State::Present { .. })
            {
                let message = Message::AssignController { to: address };
                self.live.outbox.push(MessagePriority::Normal, message, Reason::Assign { address });
            }
        }
    }

    pub(super) fn assigned(&mut self, address: u8, arrived: bool) {
        let enabled = !self.ram.bit0(map::device(address) + map::DEVICE_OUTPUTS);
        let device = &mut self.live.log_ins.devices[usize::from(address)];
        device.assigned = arrived && enabled && matches!(device.state, State::Present { .. });
    }

    /// Outputs and directed control data for this turn.
    pub(super) fn outputs_to_send(&self) -> Vec<Message> {
        (0..32)
            .filter_map(|to| {
                let device = &self.live.log_ins.devices[usize::from(to)];
                let State::Present { output_len: len @ 1.., .. } = device.state else {
                    return None;
                };
                let data = || self.live.copies.outputs(to, len);
                (device.assigned && device.outputs_read)
                    .then(|| Message::Directed { to, data: data() })
            })
            .collect()
    }

    /// What the board answers to a Read ID.
    pub(super) fn identity(&self) -> Identity {
        let setup = self.live.setup;
        Identity {
            input_len: setup.broadcast_len,
            output_len: setup.directed_len,
            kind: BlockKind::of(setup.broadcast_len, setup.directed_len),
            forced: false,
            monitor: self.monitor_plugged,
            reference: setup.reference,
            revision: self.options.revision,
            controller: self.live.controller.unwrap_or(0xFF),
            model: self.options.model,
            rate: setup.rate(),
        }
    }
}
