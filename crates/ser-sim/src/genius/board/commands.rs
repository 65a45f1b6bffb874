//! The command block (chapter 10).
//!
//! Completion values are 4, 8 and 10h. When the message is out, a Transmit Datagram clears the
//! block's options and the transmit buffer. With the clear-status bit, which leaves the block to
//! the host at once, it clears them as soon as they have been read.

use super::Board;
use super::interrupts::Condition;
use super::reason::Reason;
use crate::genius::datagram::{
    BROADCAST, Datagram, MAX_DATAGRAM_LEN, MAX_FUNCTION, MessagePriority,
};
use crate::genius::device::Message;
use crate::genius::map;

const INCOMING: u8 = 1;
const IN_PROGRESS: u8 = 2;
pub(super) const COMPLETE: u8 = 4;
pub(super) const SYNTAX_ERROR: u8 = 8;
pub(super) const PROCESS_ERROR: u8 = 0x10;

const READ_DATAGRAM: u8 = 1;
const TRANSMIT_DATAGRAM: u8 = 2;
const TRANSMIT_WITH_REPLY: u8 = 3;
const CHANGE_CONFIGURATION: u8 = 4;
const COMMAND_MASK: u8 = 0x3F;
const CLEAR_STATUS: u8 = 0x80;

/// How long the board waits for the reply that belongs to a command.
const REPLY_WITHIN_US: u64 = 10_000_000;
/// Messages that the board can hold until their turn comes.
const OUTBOX_LEN: usize = 16;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CommandState {
    Free,
    /// Something that needs no bus, done at `until_us`.
    Working {
        until_us: u64,
        work: Work,
    },
    /// The datagram waits for its turn or is being sent.
    Sending,
    /// The reply must come before `until_us`.
    AwaitingReply {
        until_us: u64,
        from: u8,
        function: u8,
        subfunction: u8,
    },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Work {
    ReadDatagram,
    ChangeConfiguration,
    Finish(u8),
}

impl Board {
    pub(super) fn command_due_us(&self) -> Option<u64> {
        let done_us = match self.live.command {
            CommandState::Free | CommandState::Sending => None,
            CommandState::Working { until_us, .. }
            | CommandState::AwaitingReply { until_us, .. } => Some(until_us),
        };
        [self.live.command_look_us, done_us].into_iter().flatten().min()
    }

    /// The host has written a status or a command.
    pub(super) fn look_at_command(&mut self) {
        self.live.command_look_us = None;
        if self.live.command != CommandState::Free || self.ram.get(map::COMMAND_STATUS) != INCOMING
        {
            return;
        }
        let byte = self.ram.get(map::COMMAND);
        let command = byte & COMMAND_MASK;
        if byte & CLEAR_STATUS != 0 {
            // Only one command can be carried out in this way. Any other is dropped.
            if command == TRANSMIT_DATAGRAM {
                self.transmit_unreported();
            }
            self.ram.set(map::COMMAND_STATUS, 0);
            return;
        }
        self.ram.set(map::COMMAND_STATUS, IN_PROGRESS);
        match command {
            READ_DATAGRAM => self.work_on(Work::ReadDatagram),
            TRANSMIT_DATAGRAM => self.transmit(),
            TRANSMIT_WITH_REPLY => self.transmit_with_reply(),
            CHANGE_CONFIGURATION => self.work_on(Work::ChangeConfiguration),
            _ => self.work_on(Work::Finish(SYNTAX_ERROR)),
        }
    }

    fn work_on(&mut self, work: Work) {
        let until_us = self.now_us + self.options.timing.work_us + self.faults.late_by_us;
        self.live.command = CommandState::Working { until_us, work };
    }

    /// The time of a command has come: its work is done, or its reply is missing.
    pub(super) fn go_on_with_command(&mut self) {
        match self.live.command {
            CommandState::Free | CommandState::Sending => {}
            CommandState::Working { work, .. } => {
                let status = match work {
                    Work::ReadDatagram => self.read_datagram(),
                    Work::ChangeConfiguration => self.change_configuration(),
                    Work::Finish(status) => status,
                };
                self.complete(status);
            }
            CommandState::AwaitingReply { .. } => {
                self.live.outbox.remove(|&reason| reason == Reason::Command);
                self.complete(PROCESS_ERROR);
            }
        }
    }

    fn complete(&mut self, status: u8) {
        self.live.command = CommandState::Free;
        self.ram.set(map::COMMAND_STATUS, status);
        self.raise(Condition::CommandComplete);
    }

    fn read_datagram(&mut self) -> u8 {
        let Some(received) = self.take_received() else { return SYNTAX_ERROR };
        let Datagram { function, subfunction, data } = received.datagram;
        let len = data.len().min(map::READ_BUFFER_LEN);
        self.ram.write(map::READ_BUFFER, &data[..len]);
        #[expect(clippy::cast_possible_truncation, reason = "at most the buffer's 134 bytes")]
        let options =
            [received.from, function, subfunction, u8::from(!received.broadcast), len as u8];
        self.ram.write(map::COMMAND_OPTIONS, &options);
        COMPLETE
    }

    fn transmit(&mut self) {
        let Some((priority, message)) = self.message_to_transmit() else {
            return self.work_on(Work::Finish(SYNTAX_ERROR));
        };
        if !self.is_on_bus() || !self.has_memory() {
            return self.work_on(Work::Finish(PROCESS_ERROR));
        }
        self.live.outbox.push(priority, message, Reason::Command);
        self.live.command = CommandState::Sending;
    }

    fn transmit_unreported(&mut self) {
        let message = self.message_to_transmit();
        self.clear_transmitted();
        if let Some((priority, message)) = message
            && self.is_on_bus()
            && self.has_memory()
        {
            self.live.outbox.push(priority, message, Reason::UnreportedCommand);
        }
    }

    fn clear_transmitted(&mut self) {
        self.ram.write(map::COMMAND, &[0; map::COMMAND_BLOCK_END - map::COMMAND]);
        self.ram.write(map::TRANSMIT_BUFFER, &[0; map::TRANSMIT_BUFFER_LEN]);
    }

    /// The datagram of a Transmit Datagram command is out.
    pub(super) fn transmitted(&mut self, arrived: bool) {
        if self.live.command == CommandState::Sending {
            self.clear_transmitted();
            self.complete(if arrived { COMPLETE } else { PROCESS_ERROR });
        }
    }

    fn transmit_with_reply(&mut self) {
        let options = self.ram.read(map::COMMAND_OPTIONS, 6);
        let (to, function, subfunction, reply_subfunction) =
            (options[0], options[1], options[2], options[3]);
        let (priority, len) = (options[4], options[5]);
        let message = self.message(to, function, subfunction, priority, len);
        let Some((priority, message)) = message.filter(|_| to != BROADCAST) else {
            return self.work_on(Work::Finish(SYNTAX_ERROR));
        };
        if !self.has_memory() {
            return self.work_on(Work::Finish(PROCESS_ERROR));
        }
        // Whatever keeps the reply from coming shows after ten seconds, and not before.
        self.live.outbox.push(priority, message, Reason::Command);
        let until_us = self.now_us + REPLY_WITHIN_US;
        self.live.command = CommandState::AwaitingReply {
            until_us,
            from: to,
            function,
            subfunction: reply_subfunction,
        };
    }

    /// Takes a datagram when it is the reply that the command waits for.
    pub(super) fn is_reply(&mut self, from: u8, datagram: &Datagram) -> bool {
        let CommandState::AwaitingReply { from: expected, function, subfunction, .. } =
            self.live.command
        else {
            return false;
        };
        if (from, datagram.function, datagram.subfunction) != (expected, function, subfunction) {
            return false;
        }
        let len = datagram.data.len().min(map::READ_BUFFER_LEN);
        self.ram.write(map::READ_BUFFER, &datagram.data[..len]);
        #[expect(clippy::cast_possible_truncation, reason = "at most the buffer's 134 bytes")]
        self.ram.set(map::COMMAND_OPTIONS + 6, len as u8);
        self.complete(COMPLETE);
        true
    }

    fn message_to_transmit(&self) -> Option<(MessagePriority, Message)> {
        let options = self.ram.read(map::COMMAND_OPTIONS, 5);
        self.message(options[0], options[1], options[2], options[3], options[4])
    }

    /// The message to send; `None` when something is not specified correctly.
    fn message(
        &self,
        to: u8,
        function: u8,
        subfunction: u8,
        priority: u8,
        len: u8,
    ) -> Option<(MessagePriority, Message)> {
        let number_exists = to < 32 || to == BROADCAST;
        if !number_exists || function > MAX_FUNCTION || usize::from(len) > MAX_DATAGRAM_LEN {
            return None;
        }
        let priority = if priority == 0 { MessagePriority::Normal } else { MessagePriority::High };
        let data = self.ram.read(map::TRANSMIT_BUFFER, len.into()).to_vec();
        Some((
            priority,
            Message::Datagram { to, datagram: Datagram { function, subfunction, data } },
        ))
    }

    fn has_memory(&mut self) -> bool {
        if self.faults.out_of_memory > 0 {
            self.faults.out_of_memory -= 1;
            return false;
        }
        self.live.outbox.len() < OUTBOX_LEN
    }
}
