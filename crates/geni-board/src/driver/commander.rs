//! Starts commands one at a time (chapter 10), polls for their end and gives them up.

use crate::command_block::{
    CommandStatus, read_datagram, read_reply, start_configure, start_read, start_transmission,
};
use crate::counters::{Counters, count};
use crate::datagram::{Completion, ReceivedDatagram, Transmission, TransmitError};
use crate::elapsed::elapsed_ms;
use crate::event::{CommandError, Failure};
use crate::ram::SharedRam;
use crate::setup_table::Configuration;
use crate::timing;

/// How a command ended.
#[derive(Debug)]
pub(super) enum Done {
    /// A Read Datagram took a datagram out of the receive queue; `None` when it cannot be passed
    /// on.
    Read(Option<ReceivedDatagram>),
    /// The receive queue was empty when the board looked.
    QueueEmpty,
    /// A Read Datagram ended without news of the receive queue.
    NothingRead,
    Sent(Result<(), CommandError>),
    Replied(Result<ReceivedDatagram, CommandError>),
    Configured(CommandStatus),
}

/// What must be remembered of a datagram once the board has it.
#[derive(Clone, Copy, Debug)]
struct Sending {
    destination: u8,
    function: u8,
    completion: Completion,
    timeout_ms: u32,
}

impl Sending {
    fn ended(self, error: CommandError) -> Done {
        match self.completion {
            Completion::Reply { .. } => Done::Replied(Err(error)),
            Completion::Taken | Completion::Acknowledged => Done::Sent(Err(error)),
        }
    }
}

#[derive(Clone, Copy, Debug)]
enum State {
    Idle,
    Reading {
        since_ms: u32,
    },
    Configuring {
        since_ms: u32,
    },
    Sending {
        sending: Sending,
        since_ms: u32,
    },
    /// The block holds a command that nobody waits for: our own command, `given_up`, or another
    /// program's.
    Occupied {
        since_ms: u32,
        given_up: bool,
    },
}

/// The command block and what waits for it.
#[derive(Debug)]
pub(super) struct Commander {
    state: State,
    /// The minimum for every time limit.
    patience_ms: u32,
    outbox: Option<Transmission>,
    /// Whether something may have arrived since the last Read Datagram was started.
    read_due: bool,
    /// Whether the last Read Datagram found nothing and no other was asked for since its start.
    queue_empty: bool,
    /// Whether the last command was a read; the outbox is next then.
    read_last: bool,
    configured: Configuration,
}

impl Commander {
    pub(super) const fn new(patience_ms: u32) -> Commander {
        Commander {
            state: State::Idle,
            patience_ms,
            outbox: None,
            read_due: false,
            queue_empty: false,
            read_last: false,
            configured: Configuration::DEFAULT,
        }
    }

    /// Asks for a read: there may be datagrams.
    pub(super) fn read_due(&mut self) {
        self.read_due = true;
        self.queue_empty = false;
    }

    pub(super) fn queue_is_empty(&self) -> bool {
        self.queue_empty
    }

    pub(super) fn is_idle(&self) -> bool {
        matches!(self.state, State::Idle)
    }

    pub(super) fn is_reading(&self) -> bool {
        matches!(self.state, State::Reading { .. })
    }

    pub(super) fn can_transmit(&self) -> bool {
        self.outbox.is_none() && !matches!(self.state, State::Sending { .. })
    }

    pub(super) fn put(&mut self, transmission: Transmission) -> Result<(), TransmitError> {
        if !self.can_transmit() {
            return Err(TransmitError::Busy);
        }
        self.outbox = Some(transmission);
        Ok(())
    }

    /// The configuration that was sent last.
    pub(super) fn configured(&self) -> Configuration {
        self.configured
    }

    /// Forgets all commands because the board has been started anew.
    pub(super) fn forget(&mut self) {
        self.state = State::Idle;
        self.queue_empty = false;
    }

    /// Ends all commands because the board has failed. Returns the completion of the datagram that
    /// was lost with it.
    pub(super) fn abandon(&mut self) -> Option<Completion> {
        let waiting = self.outbox.take().map(|transmission| transmission.completion);
        let sending = match self.state {
            State::Sending { sending, .. } => Some(sending.completion),
            _ => None,
        };
        self.state = State::Idle;
        sending.or(waiting)
    }

    /// Checks whether the command in progress is finished.
    pub(super) fn poll<R: SharedRam>(
        &mut self,
        ram: &R,
        now_ms: u32,
        in_force: Configuration,
        counters: &mut Counters,
    ) -> Result<Option<Done>, Failure> {
        if self.is_idle() {
            return Ok(None);
        }
        let status = CommandStatus::read(ram);
        if status == CommandStatus::Pending {
            return self.still_pending(now_ms, counters);
        }
        if let State::Reading { .. } | State::Sending { .. } = self.state {
            // A board that has restarted shows a completed command and default settings.
            if Configuration::read(ram) != Ok(in_force) {
                return Err(Failure::Restarted);
            }
        }
        let state = core::mem::replace(&mut self.state, State::Idle);
        Ok(match state {
            State::Idle => None,
            State::Reading { .. } => Some(self.read(ram, status, counters)),
            State::Configuring { .. } => Some(Done::Configured(status)),
            State::Sending { sending, .. } => Some(sent(ram, sending, status, counters)),
            State::Occupied { given_up, .. } => {
                if given_up {
                    count(&mut counters.commands_late);
                }
                None
            }
        })
    }

    fn still_pending(
        &mut self,
        now_ms: u32,
        counters: &mut Counters,
    ) -> Result<Option<Done>, Failure> {
        match self.state {
            State::Idle => Ok(None),
            // A late Read Datagram has taken its datagram out of the queue for good, so it is never
            // given up without giving up the board.
            State::Reading { since_ms }
            | State::Configuring { since_ms }
            | State::Occupied { since_ms, .. } => {
                if elapsed_ms(now_ms, since_ms) < timing::COMMAND_STUCK_MS.max(self.patience_ms) {
                    return Ok(None);
                }
                count(&mut counters.commands_timed_out);
                Err(Failure::CommandStuck)
            }
            State::Sending { sending, since_ms } => {
                if elapsed_ms(now_ms, since_ms) < sending.timeout_ms {
                    return Ok(None);
                }
                count(&mut counters.commands_timed_out);
                self.state = State::Occupied { since_ms: now_ms, given_up: true };
                Ok(Some(sending.ended(CommandError::TimedOut)))
            }
        }
    }

    fn read<R: SharedRam>(
        &mut self,
        ram: &R,
        status: CommandStatus,
        counters: &mut Counters,
    ) -> Done {
        match status {
            CommandStatus::Complete => {
                // There may be more datagrams.
                self.read_due();
                let received = read_datagram(ram);
                if received.is_none() {
                    count(&mut counters.datagrams_refused);
                }
                Done::Read(received)
            }
            // The receive queue is empty, or was: something may have arrived while the answer was
            // on its way.
            CommandStatus::SyntaxError => {
                self.queue_empty = !self.read_due;
                Done::QueueEmpty
            }
            // "Should not occur". Reading resumes at the next flag or the next periodic check.
            CommandStatus::ProcessError => {
                count(&mut counters.commands_failed);
                Done::NothingRead
            }
            CommandStatus::Cleared | CommandStatus::Pending | CommandStatus::Unknown(_) => {
                count(&mut counters.commands_unknown);
                Done::NothingRead
            }
        }
    }

    /// Starts the next command, alternating between reading and sending.
    pub(super) fn start_next<R: SharedRam>(
        &mut self,
        ram: &mut R,
        now_ms: u32,
        scan_ms: u32,
        counters: &mut Counters,
    ) {
        if !self.read_due && self.outbox.is_none() || !self.take_block(ram, now_ms, counters) {
            return;
        }
        if self.read_due && (self.outbox.is_none() || !self.read_last) {
            self.read_last = true;
            self.read_due = false;
            self.state = State::Reading { since_ms: now_ms };
            start_read(ram);
        } else if let Some(transmission) = self.outbox.take() {
            self.read_last = false;
            let timeout_ms = match transmission.completion {
                Completion::Reply { .. } => timing::REPLY_TIMEOUT_MS,
                Completion::Taken | Completion::Acknowledged => {
                    timing::TRANSMIT_TIMEOUT_MS.max(scan_ms.saturating_mul(5))
                }
            }
            .max(self.patience_ms);
            let sending = Sending {
                destination: transmission.destination.to_byte(),
                function: transmission.function,
                completion: transmission.completion,
                timeout_ms,
            };
            self.state = State::Sending { sending, since_ms: now_ms };
            start_transmission(ram, &transmission);
        }
    }

    /// Writes the setup table and starts the command that makes the board take it.
    pub(super) fn start_configure<R: SharedRam>(
        &mut self,
        ram: &mut R,
        now_ms: u32,
        configuration: Configuration,
        counters: &mut Counters,
    ) {
        if self.take_block(ram, now_ms, counters) {
            self.configured = configuration;
            self.state = State::Configuring { since_ms: now_ms };
            configuration.write(ram);
            start_configure(ram);
        }
    }

    /// Whether the block is free. If not, another program has left a command in it, which must end
    /// first.
    fn take_block<R: SharedRam>(&mut self, ram: &R, now_ms: u32, counters: &mut Counters) -> bool {
        let free = CommandStatus::read(ram).is_free();
        if !free {
            count(&mut counters.commands_blocked);
            self.state = State::Occupied { since_ms: now_ms, given_up: false };
        }
        free
    }
}

/// The outcome of sending a datagram.
fn sent<R: SharedRam>(
    ram: &R,
    sending: Sending,
    status: CommandStatus,
    counters: &mut Counters,
) -> Done {
    match (status, sending.completion) {
        (CommandStatus::Complete, Completion::Reply { subfunction }) => {
            let reply = read_reply(ram, sending.destination, sending.function, subfunction);
            if reply.is_none() {
                count(&mut counters.datagrams_refused);
            }
            Done::Replied(reply.ok_or(CommandError::BadReply))
        }
        // An acknowledged datagram ends with 4 by the table of status values, and with 0 by the
        // text above it.
        (
            CommandStatus::Complete | CommandStatus::Cleared,
            Completion::Taken | Completion::Acknowledged,
        ) => Done::Sent(Ok(())),
        (CommandStatus::SyntaxError, _) => {
            count(&mut counters.commands_refused);
            sending.ended(CommandError::Refused)
        }
        (CommandStatus::ProcessError, _) => {
            count(&mut counters.commands_failed);
            sending.ended(CommandError::Failed)
        }
        (CommandStatus::Unknown(unknown), _) => {
            count(&mut counters.commands_unknown);
            sending.ended(CommandError::UnknownStatus(unknown))
        }
        (CommandStatus::Cleared | CommandStatus::Pending, _) => {
            count(&mut counters.commands_unknown);
            sending.ended(CommandError::Cleared)
        }
    }
}
