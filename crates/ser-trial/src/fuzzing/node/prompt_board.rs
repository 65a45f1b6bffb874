//! A GENI board that does everything at the moment it is told, so that it is certain when a
//! datagram arrives.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use geni_board::{RAM_LEN, SharedRam, map};

/// A datagram on its way to the recorder.
#[derive(Clone, Debug)]
pub(super) struct Incoming {
    pub(super) source: u8,
    pub(super) is_broadcast: bool,
    pub(super) function: u8,
    pub(super) subfunction: u8,
    pub(super) data: Vec<u8>,
}

/// A datagram that the recorder has sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Outgoing {
    pub(super) destination: u8,
    pub(super) function: u8,
    pub(super) subfunction: u8,
    pub(super) data: Vec<u8>,
}

/// A handle: clones are the same board.
#[derive(Clone, Debug)]
pub(super) struct PromptBoard(Rc<RefCell<State>>);

#[derive(Debug)]
struct State {
    bytes: Vec<u8>,
    inbox: VecDeque<Incoming>,
    sent: VecDeque<Outgoing>,
}

const COMPLETE: u8 = 4;
const SYNTAX_ERROR: u8 = 8;
const ALREADY_IN_FORCE: u8 = 0x10;

/// The flag in the interrupt table that a datagram is in the receive queue.
const RECEIVE_QUEUE: u16 = map::INTERRUPT_FIRST + 5;

/// The recorder's own bus address.
pub(super) const NUMBER: u8 = 5;

/// A bus scan, in milliseconds.
const SCAN_MS: u8 = 3;

impl PromptBoard {
    pub(super) fn new() -> PromptBoard {
        let mut state =
            State { bytes: vec![0; RAM_LEN], inbox: VecDeque::new(), sent: VecDeque::new() };
        state.set(map::SETUP_DIP_SWITCHES, NUMBER);
        state.set(map::STATUS_SCAN_TIME, SCAN_MS);
        PromptBoard(Rc::new(RefCell::new(state)))
    }

    pub(super) fn bring(&self, datagram: Incoming) {
        let mut state = self.0.borrow_mut();
        state.inbox.push_back(datagram);
        state.set(map::INTERRUPT_STATUS.at(RECEIVE_QUEUE), 1);
        state.set(map::INTERRUPT_STATUS.at(map::INTERRUPT_SUMMARY), 1);
    }

    pub(super) fn take_sent(&self) -> Option<Outgoing> {
        self.0.borrow_mut().sent.pop_front()
    }

    /// The global data that goes to everybody in every scan.
    pub(super) fn global_data(&self, len: usize) -> Vec<u8> {
        self.0.borrow().slice(map::BROADCAST_OUTPUT.start, len)
    }
}

impl SharedRam for PromptBoard {
    fn read(&self, offset: u16) -> u8 {
        // The heartbeat is always there.
        if offset == map::STATUS_OK { 1 } else { self.0.borrow().get(offset) }
    }

    fn write(&mut self, offset: u16, byte: u8) {
        let mut state = self.0.borrow_mut();
        state.set(offset, byte);
        match offset {
            map::COMMAND_STATUS => state.carry_out(),
            map::LOCKOUT_REQUEST => state.set(map::LOCKOUT_STATE, byte),
            _ => {}
        }
    }
}

impl State {
    fn get(&self, offset: u16) -> u8 {
        self.bytes[usize::from(offset)]
    }

    fn set(&mut self, offset: u16, byte: u8) {
        self.bytes[usize::from(offset)] = byte;
    }

    fn slice(&self, start: u16, len: usize) -> Vec<u8> {
        self.bytes[usize::from(start)..][..len].to_vec()
    }

    fn carry_out(&mut self) {
        let status = match self.get(map::COMMAND_CODE) {
            1 => self.hand_over(),
            2 => {
                self.send();
                COMPLETE
            }
            4 => ALREADY_IN_FORCE,
            _ => SYNTAX_ERROR,
        };
        self.set(map::COMMAND_STATUS, status);
    }

    fn hand_over(&mut self) -> u8 {
        let Some(datagram) = self.inbox.pop_front() else { return SYNTAX_ERROR };
        let Incoming { source, is_broadcast, function, subfunction, data } = datagram;
        self.set(map::READ_SOURCE, source);
        self.set(map::READ_FUNCTION, function);
        self.set(map::READ_SUBFUNCTION, subfunction);
        self.set(map::READ_DIRECTED, u8::from(!is_broadcast));
        self.set(map::READ_LEN, u8::try_from(data.len()).expect("at most 134 bytes"));
        self.bytes[usize::from(map::READ_BUFFER.start)..][..data.len()].copy_from_slice(&data);
        COMPLETE
    }

    fn send(&mut self) {
        let len = self.get(map::TRANSMIT_LEN);
        self.sent.push_back(Outgoing {
            destination: self.get(map::TRANSMIT_DESTINATION),
            function: self.get(map::TRANSMIT_FUNCTION),
            subfunction: self.get(map::TRANSMIT_SUBFUNCTION),
            data: self.slice(map::TRANSMIT_BUFFER.start, len.into()),
        });
    }
}
