//! The shared RAM as the driver sees it: bytes that change by themselves, or a board.

use std::cell::RefCell;
use std::rc::Rc;

use geni_board::{RAM_LEN, SharedRam, map};
use ser_sim::genius::BoardWindow;

/// The flag of a datagram in the receive queue.
const RECEIVE_QUEUE_FLAG: u16 = map::INTERRUPT_STATUS.at(map::INTERRUPT_FIRST + 5);

/// The driver's end.
#[derive(Clone, Debug)]
pub(super) struct Window(pub(super) Rc<RefCell<Ram>>);

impl SharedRam for Window {
    fn read(&self, offset: u16) -> u8 {
        self.0.borrow_mut().read(offset)
    }

    fn write(&mut self, offset: u16, byte: u8) {
        self.0.borrow_mut().write(offset, byte);
    }
}

/// What the RAM does after each poll. It takes the driver further than a board that does nothing
/// would.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Puppet {
    beats: bool,
    /// The status that a command ends with.
    completes: Option<u8>,
    locks: bool,
    restores_setup: bool,
}

impl Puppet {
    pub(super) fn from_byte(bits: u8) -> Puppet {
        Puppet {
            beats: bits & 1 != 0,
            completes: match bits >> 1 & 0b111 {
                0 => None,
                1..=4 => Some(4),
                5 => Some(8),
                6 => Some(0x10),
                _ => Some(0),
            },
            locks: bits & 0x10 != 0,
            restores_setup: bits & 0x20 != 0,
        }
    }
}

/// The RAM from both sides.
#[derive(Debug)]
pub(super) struct Ram {
    bytes: Vec<u8>,
    /// Decides for each access whether the byte changes at this moment, and to what.
    noise: Vec<u8>,
    noise_at: usize,
    /// How likely that is, of 256.
    pub(super) noisiness: u8,
    pub(super) puppet: Puppet,
    /// The setup table as the driver last wrote it, which a board that restores it puts back.
    setup: [u8; 6],
    /// The board that has taken over.
    pub(super) board: Option<BoardHolder>,
    pub(super) accesses: usize,
    /// What the driver last saw in the lockout bytes.
    lockout_seen: [u8; 2],
    /// Whether the driver has seen a heartbeat since this was last asked.
    pub(super) beat_seen: bool,
    /// Whether the driver has seen the flag of a datagram since this was last asked.
    pub(super) flag_seen: bool,
    pub(super) written: Vec<(u16, u8)>,
}

/// A board's window, wrapped because it has no `Debug` output.
pub(super) struct BoardHolder(pub(super) BoardWindow);

impl std::fmt::Debug for BoardHolder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Board")
    }
}

impl Ram {
    pub(super) fn new(noise: &[u8]) -> Ram {
        Ram {
            bytes: vec![0; RAM_LEN],
            noise: noise.to_vec(),
            noise_at: 0,
            noisiness: 0,
            puppet: Puppet::default(),
            setup: [0; 6],
            board: None,
            accesses: 0,
            lockout_seen: [0; 2],
            beat_seen: false,
            flag_seen: false,
            written: Vec::new(),
        }
    }

    fn read(&mut self, offset: u16) -> u8 {
        self.accesses += 1;
        assert!(usize::from(offset) < RAM_LEN, "reads beyond the RAM, at {offset:04X}h");
        assert!(!map::RESERVED.contains(offset), "reads from the reserved area, at {offset:04X}h");
        let byte = self.byte(offset);
        match offset {
            map::LOCKOUT_REQUEST => self.lockout_seen[0] = byte & 1,
            map::LOCKOUT_STATE => self.lockout_seen[1] = byte & 1,
            map::STATUS_OK => self.beat_seen |= byte == 1,
            RECEIVE_QUEUE_FLAG => self.flag_seen |= byte & 1 != 0,
            _ => {}
        }
        byte
    }

    fn byte(&mut self, offset: u16) -> u8 {
        if let Some(BoardHolder(board)) = &self.board {
            return board.read(offset);
        }
        if self.next_noise() < self.noisiness {
            self.bytes[usize::from(offset)] = telling(self.next_noise());
        }
        self.bytes[usize::from(offset)]
    }

    fn write(&mut self, offset: u16, byte: u8) {
        self.accesses += 1;
        self.written.push((offset, byte));
        if offset == map::LOCKOUT_REQUEST {
            // Lockout is requested when neither byte is set, and given back when both are.
            assert_eq!(self.lockout_seen, [1 - byte; 2], "lockout request {byte}");
        }
        if let Some(BoardHolder(board)) = &mut self.board {
            board.write(offset, byte);
        } else if let Some(cell) = self.bytes.get_mut(usize::from(offset)) {
            *cell = byte;
        }
        if let Some(byte_of_setup) = offset.checked_sub(map::SETUP_TABLE.start)
            && let Some(kept) = self.setup.get_mut(usize::from(byte_of_setup))
        {
            *kept = byte;
        }
    }

    fn next_noise(&mut self) -> u8 {
        let Some(&byte) = self.noise.get(self.noise_at) else { return u8::MAX };
        self.noise_at = (self.noise_at + 1) % self.noise.len();
        byte
    }

    /// Does what a board would have done since the last poll.
    pub(super) fn play_puppet(&mut self) {
        let Puppet { beats, completes, locks, restores_setup } = self.puppet;
        if beats {
            self.set(map::STATUS_OK, 1);
        }
        if let Some(status) = completes
            && self.get(map::COMMAND_STATUS) == 1
        {
            self.set(map::COMMAND_STATUS, status);
        }
        if locks {
            self.set(map::LOCKOUT_STATE, self.get(map::LOCKOUT_REQUEST));
        }
        if restores_setup {
            let start = usize::from(map::SETUP_TABLE.start);
            self.bytes[start..start + self.setup.len()].copy_from_slice(&self.setup);
        }
    }

    fn get(&self, offset: u16) -> u8 {
        self.bytes[usize::from(offset)]
    }

    /// Changes a byte behind the driver's back.
    pub(super) fn set(&mut self, offset: u16, byte: u8) {
        self.bytes[usize::from(offset) % RAM_LEN] = byte;
    }

    pub(super) fn set_lockout(&mut self, bits: u8) {
        self.set(map::LOCKOUT_REQUEST, bits & 0x0F);
        self.set(map::LOCKOUT_STATE, bits >> 4);
    }

    pub(super) fn fill(&mut self, offset: u16, len: u16, byte: u8) {
        let start = usize::from(offset) % RAM_LEN;
        let end = (start + usize::from(len)).min(RAM_LEN);
        self.bytes[start..end].fill(byte);
    }

    /// Shows a finished Read Datagram command with any result, and the flag that there is more.
    pub(super) fn put_datagram(&mut self, source: u8, directed: u8, len: u8) {
        self.set(map::READ_SOURCE, source);
        self.set(map::READ_DIRECTED, directed);
        self.set(map::READ_LEN, len);
        self.set(map::INTERRUPT_STATUS.at(0), 1);
        self.set(map::INTERRUPT_STATUS.at(6), 1);
    }

    /// Shows a request with any header in the buffer before the tail, and sets the tail anywhere.
    pub(super) fn put_request(&mut self, tail: u8, header: &[u8]) {
        let index = self.get(map::REQUEST_HEAD) % map::REQUEST_COUNT;
        for (at, &byte) in (u16::from(index) * map::REQUEST_LEN..).zip(header) {
            self.set(at, byte);
        }
        self.set(map::REQUEST_TAIL, tail);
        self.set(map::INTERRUPT_STATUS.at(0), 1);
        self.set(map::INTERRUPT_STATUS.at(1), 1);
    }
}

/// Half of the time a value that means something in flags, states and pointers.
fn telling(byte: u8) -> u8 {
    match byte {
        0..=127 => [0, 1, 2, 4, 8, 0x10, 0x0F, 0x80][usize::from(byte % 8)],
        any => any,
    }
}
