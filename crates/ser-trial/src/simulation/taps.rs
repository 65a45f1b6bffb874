//! What a recorder has been given: the bytes of its line, and the datagrams that it has taken from
//! its board.
//!
//! The ledger is based on this. Both are decoded here a second time, independently of the recorder.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use geni_board::{SharedRam, map};
use ser_proto::genius::{
    FUNCTION_GENIUS, FUNCTION_HORNER, ForceTable, SUBFUNCTION_SER, Subfunction,
};
use ser_proto::{Code, Command, Decoded, FrameDecoder, MAX_BODY_LEN, ParseError, Reply};
use ser_sim::genius::{Board, BoardWindow, Read};

use super::counts::Expected;
use super::ledger::Ledger;
use super::printout::Printout;

/// What a body says.
pub type Received = Result<Command, ParseError>;

/// The flag of a datagram in the receive queue.
const RECEIVE_QUEUE_FLAG: u16 = map::INTERRUPT_STATUS.at(map::INTERRUPT_FIRST + 5);

/// Bytes of the longest command that a recorder has room for.
const MAX_COMMAND_LEN: usize = 16;

/// What goes into a recorder's RS-232 port, and what comes out.
pub struct LineTap {
    commands: FrameDecoder<MAX_COMMAND_LEN>,
    replies: FrameDecoder<MAX_BODY_LEN>,
    /// The text that comes out.
    pub printout: Printout,
}

impl LineTap {
    /// The tap at power-up.
    #[must_use]
    pub fn new() -> LineTap {
        LineTap {
            commands: FrameDecoder::new(),
            replies: FrameDecoder::new(),
            printout: Printout::default(),
        }
    }

    /// A byte goes in. Returns the command that it completes, if the recorder has room for it. A
    /// configuration that is refused counts as a question.
    pub fn goes_in(
        &mut self,
        byte: u8,
        has_room: bool,
        expected: &mut Expected,
    ) -> Option<Command> {
        match self.commands.push(byte)? {
            Decoded::Text(_) => None,
            Decoded::Dropped(dropped) => {
                expected.frame_error(dropped.cause);
                None
            }
            Decoded::Frame(body) => match Command::parse(body) {
                Ok(_) if !has_room => {
                    expected.exact.commands_overrun += 1;
                    None
                }
                Ok(command) => Some(command),
                Err(error) => {
                    expected.parse_error(error);
                    answered_as(error).filter(|_| has_room)
                }
            },
        }
    }

    /// A byte comes out. Returns the reply that it completes.
    ///
    /// # Errors
    /// When the recorder sends what is not a reply, or prints what is not an event.
    pub fn comes_out(&mut self, byte: u8, ledger: &Ledger) -> Result<Option<Reply>, String> {
        match self.replies.push(byte) {
            Some(Decoded::Frame(body)) => Reply::parse(body)
                .map(Some)
                .map_err(|error| format!("the recorder sends {body:02X?}: {error:?}")),
            Some(Decoded::Dropped(dropped)) => {
                Err(format!("the recorder sends a broken frame: {dropped:?}"))
            }
            Some(Decoded::Text(byte)) => self.printout.take(byte, ledger).map(|()| None),
            None => Ok(None),
        }
    }
}

/// The question that the recorder answers when it gets this error.
#[must_use]
pub fn answered_as(error: ParseError) -> Option<Command> {
    match error {
        ParseError::BadValue { code, .. } if code == Code::Configure.byte() => {
            Some(Command::QueryConfiguration)
        }
        _ => None,
    }
}

impl Default for LineTap {
    fn default() -> LineTap {
        LineTap::new()
    }
}

/// A message for a recorder that it has taken from its board.
#[derive(Clone, Copy, Debug)]
pub struct Taken {
    /// What it says.
    pub received: Received,
    /// Whether it was meant for all.
    pub broadcast: bool,
    /// When the board received it, in microseconds of the bus.
    pub arrived_us: u64,
    /// The look to which a recorder without the interrupt line assigns it; `None` if no look saw
    /// its flag.
    pub seen_ms: Option<u64>,
}

/// What is taken through a window.
#[derive(Debug, Default)]
pub struct Taking {
    /// Messages that have been taken and not yet processed.
    pub messages: Vec<Taken>,
    /// How many datagrams were taken that are not for a recorder.
    pub ignored: u32,
    /// How many questions for force tables were taken that nobody has counted yet.
    forces_asked: u32,
    /// How many datagrams the board had handed over when one was last taken.
    handed_over: u64,
    looks: Looks,
    /// Set while the datagram that was taken last still has to be assigned to a look. The value
    /// says whether the datagram is among the messages.
    unseen: Option<bool>,
}

/// Looks that found the flag set, which are the arrivals for a recorder without the interrupt line.
///
/// Each look stands for one datagram, in order. Datagrams that share a flag leave too few looks for
/// later ones: the last has the look of the one before. See `docs/genius.md`.
#[derive(Debug, Default)]
struct Looks {
    /// The present, by the simulation's time.
    now_ms: u64,
    /// Looks that no datagram has been assigned to.
    seen_ms: VecDeque<u64>,
    latest_ms: Option<u64>,
}

impl Taking {
    /// The recorder is about to look at its board, for the first time in this millisecond.
    pub fn begin(&mut self, now_ms: u64) {
        self.looks.now_ms = now_ms;
    }

    /// The recorder has looked. Returns the messages that it has taken.
    pub fn end(&mut self) -> Vec<Taken> {
        self.put_to_a_look();
        std::mem::take(&mut self.messages)
    }

    /// How many questions for force tables were taken since this was last asked.
    pub fn take_forces_asked(&mut self) -> u32 {
        std::mem::take(&mut self.forces_asked)
    }

    /// The recorder has given up its board, and has forgotten what it saw there.
    pub fn board_failed(&mut self) {
        self.looks.seen_ms.clear();
        self.looks.latest_ms = None;
    }

    /// When the oldest datagram that has not been taken was seen to arrive.
    #[must_use]
    pub fn untaken_since_look_ms(&self) -> Option<u64> {
        self.looks.seen_ms.front().copied()
    }

    /// The flag of a datagram that came while another one was read is seen before that one is
    /// passed on.
    fn put_to_a_look(&mut self) {
        let Some(is_message) = self.unseen.take() else { return };
        self.looks.latest_ms = self.looks.seen_ms.pop_front().or(self.looks.latest_ms);
        if let Some(message) = self.messages.last_mut().filter(|_| is_message) {
            message.seen_ms = self.looks.latest_ms;
        }
    }

    /// When the oldest datagram that has not been taken from this board arrived, in microseconds of
    /// the bus.
    #[must_use]
    pub fn untaken_since_us(&self, board: &Board) -> Option<u64> {
        let in_buffer = board.latest_read().filter(|read| read.number > self.handed_over);
        in_buffer.map(|read| read.arrived_us).or(board.unread_since_us())
    }
}

/// A window's tap. Clones are the same tap.
pub type BusTap = Rc<RefCell<Taking>>;

/// A board's window that tells what is taken through it.
pub struct TappedWindow {
    inner: BoardWindow,
    tap: BusTap,
}

impl TappedWindow {
    /// A window that tells `tap` what is taken through `inner`.
    #[must_use]
    pub fn new(inner: BoardWindow, tap: BusTap) -> TappedWindow {
        TappedWindow { inner, tap }
    }

    fn asks_for_forces(&self, data: &[u8]) -> bool {
        let (function, subfunction) =
            (self.inner.read(map::READ_FUNCTION), self.inner.read(map::READ_SUBFUNCTION));
        (function, subfunction) == (FUNCTION_GENIUS, Subfunction::ReadIoForces.code())
            && matches!(*data, [code] if ForceTable::from_code(code).is_some())
    }

    /// The window itself.
    #[must_use]
    pub fn inner(&self) -> &BoardWindow {
        &self.inner
    }
}

impl SharedRam for TappedWindow {
    fn read(&self, offset: u16) -> u8 {
        self.inner.read(offset)
    }

    fn write(&mut self, offset: u16, byte: u8) {
        if offset == RECEIVE_QUEUE_FLAG && self.inner.read(offset) & 1 != 0 && byte == 0 {
            let looks = &mut self.tap.borrow_mut().looks;
            looks.seen_ms.push_back(looks.now_ms);
        }
        self.inner.write(offset, byte);
    }

    fn read_bytes(&self, offset: u16, bytes: &mut [u8]) {
        self.inner.read_bytes(offset, bytes);
        if offset != map::READ_BUFFER.start {
            return;
        }
        let Some(Read { number, arrived_us }) = self.inner.look(Board::latest_read) else { return };
        let mut taking = self.tap.borrow_mut();
        taking.put_to_a_look();
        taking.handed_over = number;
        let is_message = self.inner.read(map::READ_FUNCTION) == FUNCTION_HORNER
            && self.inner.read(map::READ_SUBFUNCTION) == SUBFUNCTION_SER;
        taking.unseen = Some(is_message);
        let broadcast = self.inner.read(map::READ_DIRECTED) != 1;
        if !is_message {
            let asks = !broadcast && self.asks_for_forces(bytes);
            *(if asks { &mut taking.forces_asked } else { &mut taking.ignored }) += 1;
        } else {
            let received = Command::parse(bytes);
            taking.messages.push(Taken { received, broadcast, arrived_us, seen_ms: None });
        }
    }
}
