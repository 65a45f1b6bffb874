//! The board as a device on the bus.

use super::Board;
use super::interrupts::Condition;
use super::presence::Power;
use super::reason::Reason;
use super::request_queue::is_memory_access;
use crate::genius::datagram::{BROADCAST, Datagram, MessagePriority, subfunction};
use crate::genius::device::{Device, Message};
use crate::genius::faults::DeviceFault;
use crate::genius::identity::Identity;
use crate::genius::scan_time::BusTiming;

impl Device for Board {
    fn address(&self) -> Option<u8> {
        self.is_on_bus().then(|| self.number())
    }

    fn rate(&self) -> BusTiming {
        self.live.setup.rate()
    }

    fn connect(&mut self, now_us: u64) {
        if self.now_us == 0 {
            self.power_up_at(now_us);
        }
        self.advance_to(now_us);
    }

    fn next_due_us(&self) -> Option<u64> {
        match self.power {
            Power::InReset | Power::Stopped => None,
            Power::SelfTest { .. } => self.start_up_due_us(),
            Power::Running => [
                self.live.heartbeat_us,
                self.presence_due_us(),
                self.live.turn_missed_us,
                self.command_due_us(),
                self.live.requests.look_us,
                self.live.lockout.look_us,
                self.live.errors.due_us(),
            ]
            .into_iter()
            .flatten()
            .min(),
        }
    }

    fn advance_to(&mut self, now_us: u64) {
        while let Some(due_us) = self.next_due_us().filter(|&due_us| due_us <= now_us) {
            self.now_us = due_us.max(self.now_us);
            self.act();
        }
        self.now_us = self.now_us.max(now_us);
    }

    fn take_turn(&mut self, _now_us: u64, background_free: bool) -> Vec<Message> {
        self.measure_scan();
        self.miss_silent_devices();
        self.exchange_tables();
        self.follow_outputs_flags();
        let mut messages = self.outputs_to_send();
        messages.extend(self.live.outbox.take(background_free));
        messages.push(Message::Control(self.live.copies.global(self.live.setup.broadcast_len)));
        messages
    }

    fn end_turn(&mut self, _now_us: u64, messages: &[Message], arrived: &[bool]) {
        if !self.is_on_bus() {
            return;
        }
        let background = messages.iter().zip(arrived).find(|(message, _)| message.is_background());
        if let Some(((message, &arrived), reason)) = background.zip(self.live.outbox.sent()) {
            match reason {
                Reason::Command => self.transmitted(arrived),
                Reason::LogIn { address } => self.asked_for_identity(address, arrived),
                Reason::Assign { address } => self.assigned(address, arrived),
                Reason::UnreportedCommand | Reason::Reply => {}
            }
            // A broadcast of the host comes back to the host.
            if let Message::Datagram { to: BROADCAST, datagram } = message {
                self.queue_received(self.number(), true, datagram.clone());
            }
        }
        self.raise(Condition::OutputsSent);
    }

    fn collide(&mut self, _now_us: u64) {
        self.count_error();
        self.find_conflict();
    }

    fn receive(&mut self, _now_us: u64, from: u8, message: &Message) -> bool {
        if self.power != Power::Running {
            return false;
        }
        if let Message::Control(data) = message {
            self.hear_inputs(from, data);
            return false;
        }
        let for_us = message.to().is_none_or(|to| to == self.number());
        if !for_us || !self.is_on_bus() {
            return false;
        }
        match message {
            Message::Control(_) => {}
            Message::Directed { data, .. } => self.live.copies.set_directed(data),
            Message::AssignController { .. } => self.live.controller = Some(from),
            Message::Datagram { to, datagram } => {
                self.take_datagram(from, *to == BROADCAST, datagram);
            }
        }
        true
    }

    fn count_bus_error(&mut self, _now_us: u64) {
        self.count_error();
    }

    fn suffer(&mut self, _now_us: u64, fault: DeviceFault) {
        match fault {
            DeviceFault::FailSelfTest(faults) => self.fail_self_test(faults),
            DeviceFault::FailNextStart(faults) => self.faults.next_start = faults,
            DeviceFault::Hang => self.hang(),
            DeviceFault::Reset => {
                self.hold_reset();
                self.release_reset();
            }
            DeviceFault::AnswerLate { by_us } => self.faults.late_by_us = by_us,
            DeviceFault::OutOfMemory { datagrams } => self.faults.out_of_memory = datagrams,
            DeviceFault::ChangeAddress(address) => {
                self.set_switches(self.switches & !0x1F | address & 0x1F);
            }
        }
    }
}

impl Board {
    /// Does what is due now.
    fn act(&mut self) {
        let now_us = self.now_us;
        let due = |at_us: Option<u64>| at_us.is_some_and(|at_us| at_us <= now_us);
        if due(self.start_up_due_us()) {
            self.go_on_starting();
            return;
        }
        if due(self.live.heartbeat_us) {
            self.beat();
        }
        if due(self.live.errors.due_us()) {
            self.judge_errors();
        }
        if due(self.live.lockout.look_us) {
            self.follow_lockout_request();
        }
        if due(self.live.requests.look_us) {
            self.look_at_requests();
        }
        if due(self.live.command_look_us) {
            self.look_at_command();
        } else if due(self.command_due_us()) {
            self.go_on_with_command();
        }
        if due(self.live.turn_missed_us) {
            self.miss_turns();
        }
        if due(self.presence_due_us()) {
            self.enter_bus();
        }
    }

    /// Sorts an incoming datagram. Some the board answers itself; the others go to the host in one
    /// way or another.
    fn take_datagram(&mut self, from: u8, broadcast: bool, datagram: &Datagram) {
        if datagram.is(subfunction::READ_ID) {
            let reply = Datagram::standard(subfunction::READ_ID_REPLY, self.identity().to_bytes());
            let message = Message::Datagram { to: from, datagram: reply };
            return self.live.outbox.push(MessagePriority::High, message, Reason::Reply);
        }
        if is_memory_access(datagram) {
            return self.queue_request(from, datagram);
        }
        // One Read ID reply can answer both the board and the host, who asked independently.
        let identity = Identity::parse(&datagram.data);
        let is_identity = datagram.is(subfunction::READ_ID_REPLY) && self.waits_for_identity(from);
        if let Some(identity) = identity.filter(|_| is_identity) {
            self.log_in(from, identity);
        }
        if self.is_reply(from, datagram) || is_identity {
            return;
        }
        if let Some(identity) = identity.filter(|_| datagram.is(subfunction::CONFIGURATION_CHANGE))
        {
            self.configuration_changed(from, identity);
        }
        self.queue_received(from, broadcast, datagram.clone());
    }
}
