//! A scripted board, which keeps the manual's rules and checks that the host does.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::fmt;
use std::ops::Range;
use std::rc::Rc;

use geni_board::{RAM_LEN, SharedRam};

pub(crate) const OK: usize = 0x0893;
pub(crate) const COMMAND: usize = 0x08C2;
pub(crate) const LOCKOUT_REQUEST: usize = 0x0A48;
pub(crate) const LOCKOUT_STATE: usize = 0x0A49;

/// How the board misbehaves.
#[derive(Clone, Debug, Default)]
pub(crate) struct Misbehaviour {
    /// The self-test finds faults.
    pub(crate) self_test_faults: u8,
    /// The board is dead.
    pub(crate) hangs: bool,
    /// The heartbeat stops; all else goes on.
    pub(crate) no_heartbeat: bool,
    /// Commands stay in progress.
    pub(crate) stalls: bool,
    /// Every configuration is refused.
    pub(crate) refuses_configuration: bool,
    /// The global data are cleared when the board joins the bus.
    pub(crate) forgets_global_data: bool,
    /// Commands take this long instead of 3 ms.
    pub(crate) command_ms: Option<u32>,
    /// Commands end with this status.
    pub(crate) command_status: Option<u8>,
    /// Lockout requests are not answered.
    pub(crate) ignores_lockout: bool,
    /// Flags are not set.
    pub(crate) no_flags: bool,
}

/// A datagram in the receive queue.
#[derive(Clone, Debug)]
pub(crate) struct Incoming {
    pub(crate) source: u8,
    pub(crate) function: u8,
    pub(crate) subfunction: u8,
    pub(crate) directed: u8,
    pub(crate) len: u8,
    pub(crate) data: Vec<u8>,
}

/// A datagram that the host has sent: the command block and the data.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Sent {
    pub(crate) block: [u8; 9],
    pub(crate) data: Vec<u8>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Reset,
    SelfTest { since_ms: u32 },
    Running,
    Stopped,
}

pub(crate) struct Board {
    pub(crate) ram: Vec<u8>,
    pub(crate) misbehaviour: Misbehaviour,
    pub(crate) dip: u8,
    pub(crate) receive_queue: VecDeque<Incoming>,
    pub(crate) reply: Option<Vec<u8>>,
    pub(crate) sent: Vec<Sent>,
    pub(crate) configurations: u32,
    /// The global data that the board sends in each scan, sampled when it may.
    pub(crate) on_bus: bool,
    pub(crate) lockouts: u32,
    pub(crate) resets: u32,
    /// Host accesses since the counter was last set to 0.
    pub(crate) accesses: usize,
    /// The offsets that the host has written since this was last emptied, in order.
    pub(crate) written: Vec<usize>,
    pub(crate) first_access_ms: Option<u32>,
    pub(crate) released_ms: u32,
    /// Whether to check the host's accesses; a RAM full of noise needs no checks.
    pub(crate) checks_handshakes: bool,
    state: State,
    now_ms: u32,
    joins_ms: Option<u32>,
    beat_ms: u32,
    command_since_ms: Option<u32>,
    configuration: [u8; 5],
}

const DEFAULTS: [u8; 5] = [0xFF, 0xFF, 0, 0, 128];

/// Where the host may write, and where it may not even read.
const HOST_WRITES: [Range<usize>; 12] = [
    0x0000..0x0881,
    0x0883..0x0888,
    0x0893..0x0894,
    0x08A2..0x08AA,
    0x08B2..0x08BA,
    0x08C2..0x08D2,
    0x08D2..0x09C2,
    0x0A48..0x0A49,
    0x1E00..0x1F00,
    0x1F80..0x2000,
    0x2000..0x4000,
    0x0882..0x0882,
];
const RESERVED: Range<usize> = 0x0A4A..0x1E00;

impl Board {
    /// A board without power, whose RAM holds anything.
    pub(crate) fn new() -> Board {
        Board {
            ram: vec![0xA5; RAM_LEN],
            misbehaviour: Misbehaviour::default(),
            dip: 0xE0 | 7,
            receive_queue: VecDeque::new(),
            reply: None,
            sent: Vec::new(),
            configurations: 0,
            on_bus: false,
            lockouts: 0,
            resets: 0,
            accesses: 0,
            written: Vec::new(),
            first_access_ms: None,
            released_ms: 0,
            checks_handshakes: true,
            state: State::Reset,
            now_ms: 0,
            joins_ms: None,
            beat_ms: 0,
            command_since_ms: None,
            configuration: DEFAULTS,
        }
    }

    /// A board that has been running for a long time.
    pub(crate) fn running(now_ms: u32) -> Board {
        let mut board = Board::new();
        board.state = State::Running;
        board.start_up(now_ms);
        board.joins_ms = Some(now_ms);
        board.step(now_ms, false);
        board
    }

    fn start_up(&mut self, now_ms: u32) {
        self.ram[0x0880..0x0A4A].fill(0);
        self.ram[0x1E00..].fill(0);
        self.ram[0x0882] = self.dip;
        self.ram[0x0883..0x0888].copy_from_slice(&DEFAULTS);
        self.configuration = DEFAULTS;
        self.ram[0x0892] = 0x21;
        self.ram[COMMAND] = 4;
        self.ram[OK] = 1;
        self.receive_queue.clear();
        self.on_bus = false;
        self.command_since_ms = None;
        self.beat_ms = now_ms;
        self.joins_ms = Some(now_ms.wrapping_add(1_500));
    }

    /// Restarts by itself within no time.
    pub(crate) fn restart(&mut self) {
        self.start_up(self.now_ms);
    }

    pub(crate) fn flag(&mut self, index: usize) {
        if self.misbehaviour.no_flags {
            return;
        }
        self.ram[0x08A2 + index] = 1;
        if self.ram[0x08B2] & 1 == 0 && self.ram[0x08B2 + index] & 1 == 0 {
            self.ram[0x08A2] = 1;
        }
    }

    pub(crate) fn receive(&mut self, source: u8, directed: u8, data: &[u8]) {
        let len = u8::try_from(data.len()).expect("short");
        self.receive_queue.push_back(Incoming {
            source,
            function: 0x40,
            subfunction: 0x50,
            directed,
            len,
            data: data.to_vec(),
        });
        self.flag(6);
    }

    /// Puts a request into the queue; false when it is full.
    pub(crate) fn request(&mut self, buffer: &[u8]) -> bool {
        let tail = usize::from(self.ram[0x0881]) % 16;
        let next = (tail + 1) % 16;
        if next == usize::from(self.ram[0x0880]) {
            return false;
        }
        self.ram[tail * 136..][..buffer.len()].copy_from_slice(buffer);
        self.ram[0x0881] = u8::try_from(next).expect("below 16");
        self.flag(1);
        true
    }

    /// Sets the device table entry of a device, `[model, …, block configuration]`.
    pub(crate) fn device(&mut self, number: usize, record: [u8; 8]) {
        self.ram[0x1E00 + 8 * number..][..8].copy_from_slice(&record);
        self.flag(3);
    }

    pub(crate) fn locked(&self) -> bool {
        self.ram[LOCKOUT_STATE] == 1
    }

    fn buffer_len(&self) -> usize {
        self.configuration[4].into()
    }

    /// Lets one millisecond pass.
    pub(crate) fn step(&mut self, now_ms: u32, reset_held: bool) {
        self.now_ms = now_ms;
        if reset_held {
            if self.state != State::Reset {
                self.resets += 1;
            }
            self.state = State::Reset;
            self.on_bus = false;
            return;
        }
        match self.state {
            State::Reset => {
                self.state = State::SelfTest { since_ms: now_ms };
                self.released_ms = now_ms;
                self.first_access_ms = None;
            }
            State::SelfTest { since_ms } if now_ms.wrapping_sub(since_ms) >= 1_850 => {
                self.end_self_test();
            }
            State::Running if !self.misbehaviour.hangs => self.run(),
            State::SelfTest { .. } | State::Running | State::Stopped => {}
        }
    }

    fn end_self_test(&mut self) {
        self.start_up(self.now_ms);
        self.state = State::Running;
        if self.misbehaviour.self_test_faults != 0 {
            self.ram[OK] = 0;
            self.ram[0x0894] = self.misbehaviour.self_test_faults;
            self.state = State::Stopped;
        }
    }

    fn run(&mut self) {
        if self.now_ms.wrapping_sub(self.beat_ms) >= 200 {
            self.beat_ms = self.now_ms;
            if !self.misbehaviour.no_heartbeat {
                self.ram[OK] = 1;
            }
        }
        if self.joins_ms == Some(self.now_ms) {
            self.joins_ms = None;
            self.on_bus = true;
            if self.misbehaviour.forgets_global_data {
                self.ram[0x1F80..0x2000].fill(0);
            }
            self.ram[0x0898..0x089A].copy_from_slice(&[5, 0]);
        }
        self.run_lockout();
        self.run_command();
    }

    fn run_lockout(&mut self) {
        if self.misbehaviour.ignores_lockout || self.ram[LOCKOUT_STATE] == self.ram[LOCKOUT_REQUEST]
        {
            return;
        }
        self.ram[LOCKOUT_STATE] = self.ram[LOCKOUT_REQUEST];
        if self.locked() {
            self.lockouts += 1;
            self.flag(7);
        }
    }

    fn run_command(&mut self) {
        if self.ram[COMMAND] == 1 {
            self.ram[COMMAND] = 2;
            self.command_since_ms = Some(self.now_ms);
        }
        let Some(since_ms) = self.command_since_ms else { return };
        let takes_ms = self.misbehaviour.command_ms.unwrap_or(3);
        if self.misbehaviour.stalls || self.now_ms.wrapping_sub(since_ms) < takes_ms {
            return;
        }
        self.command_since_ms = None;
        let status = match self.ram[COMMAND + 1] & 0x3F {
            1 => self.read_datagram(),
            2 => self.transmit(6),
            3 => self.transmit_with_reply(),
            4 => self.configure(),
            _ => 8,
        };
        let status = self.misbehaviour.command_status.unwrap_or(status);
        if self.ram[COMMAND + 1] & 0x80 != 0 {
            self.ram[COMMAND] = 0;
        } else {
            self.ram[COMMAND] = status;
            self.flag(5);
        }
    }

    fn read_datagram(&mut self) -> u8 {
        let Some(incoming) = self.receive_queue.pop_front() else { return 8 };
        let header = [
            incoming.source,
            incoming.function,
            incoming.subfunction,
            incoming.directed,
            incoming.len,
        ];
        self.ram[COMMAND + 2..COMMAND + 7].copy_from_slice(&header);
        self.ram[0x09C2..][..incoming.data.len()].copy_from_slice(&incoming.data);
        4
    }

    fn transmit(&mut self, len_at: usize) -> u8 {
        let len = usize::from(self.ram[COMMAND + len_at]);
        let block = self.ram[COMMAND..COMMAND + 9].try_into().expect("nine bytes");
        self.sent.push(Sent { block, data: self.ram[0x08D2..][..len].to_vec() });
        4
    }

    fn transmit_with_reply(&mut self) -> u8 {
        self.transmit(7);
        let Some(reply) = self.reply.clone() else { return 0x10 };
        self.ram[COMMAND + 8] = u8::try_from(reply.len()).expect("short");
        self.ram[0x09C2..][..reply.len()].copy_from_slice(&reply);
        4
    }

    fn configure(&mut self) -> u8 {
        let wanted: [u8; 5] = self.ram[0x0883..0x0888].try_into().expect("five bytes");
        if wanted == self.configuration {
            return 0x10;
        }
        if self.misbehaviour.refuses_configuration
            || wanted[2] > 128
            || wanted[3] > 128
            || wanted[4] == 0
            || wanted[4] > 128
        {
            self.ram[0x0883..0x0888].copy_from_slice(&self.configuration);
            return 8;
        }
        self.configuration = wanted;
        self.configurations += 1;
        self.on_bus = false;
        self.ram[0x0898..0x089A].copy_from_slice(&[0xFF, 0xFF]);
        self.joins_ms = Some(self.now_ms.wrapping_add(1_500));
        for record in self.ram[0x1E00..0x1F00].chunks_mut(8) {
            record[2] = 0;
        }
        4
    }

    fn note_access(&mut self, offset: usize) {
        self.accesses += 1;
        assert!(!RESERVED.contains(&offset), "access to reserved byte {offset:04X}h");
        assert_ne!(self.state, State::Reset, "access to {offset:04X}h in reset");
        if let State::SelfTest { since_ms } = self.state {
            let elapsed_ms = self.now_ms.wrapping_sub(since_ms);
            assert!(elapsed_ms >= 1_700, "access to {offset:04X}h {elapsed_ms} ms after reset");
        }
        self.first_access_ms.get_or_insert(self.now_ms);
    }

    fn check_read(&mut self, offset: usize) {
        self.note_access(offset);
        let tables = (0x1F00..0x4000).contains(&offset) && !(0x1F80..0x2000).contains(&offset);
        if tables && self.buffer_len() > 1 {
            assert!(
                self.locked() || !self.checks_handshakes,
                "read of {offset:04X}h without lockout"
            );
        }
    }

    fn check_write(&mut self, offset: usize, byte: u8) {
        self.note_access(offset);
        assert!(HOST_WRITES.iter().any(|range| range.contains(&offset)), "write to {offset:04X}h");
        if (0x1E00..0x1F00).contains(&offset) {
            assert_eq!(offset % 8, 1, "write to device record byte {offset:04X}h");
        }
        if !self.checks_handshakes {
            return;
        }
        let (request, state) = (self.ram[LOCKOUT_REQUEST], self.ram[LOCKOUT_STATE]);
        match offset {
            LOCKOUT_REQUEST if byte == 1 => {
                assert_eq!((request, state), (0, 0), "request over a request");
            }
            LOCKOUT_REQUEST => assert_eq!((byte, request, state), (0, 1, 1), "request withdrawn"),
            COMMAND => {
                assert_eq!(byte, 1);
                assert!(self.ram[COMMAND] == 0 || self.ram[COMMAND] >= 4, "command over a command");
            }
            0x08C3..0x09C2 => {
                assert!(self.ram[COMMAND] == 0 || self.ram[COMMAND] >= 4, "block is busy");
            }
            OK | 0x08A2..0x08AA => assert_eq!(byte, 0),
            0x1F80..0x2000 if self.on_bus && self.configuration[2] > 1 => {
                assert!(self.locked(), "global data changed without lockout");
            }
            0x2000.. if self.buffer_len() > 1 => {
                assert!(self.locked(), "outputs changed without lockout");
            }
            0x2000.. => {
                assert!(offset >= 0x2000 + 32 * self.buffer_len(), "write to the input table");
            }
            _ => {}
        }
    }
}

/// The host's side of the RAM.
#[derive(Clone)]
pub(crate) struct HostSide(pub Rc<RefCell<Board>>);

/// Prints nothing: 16 KiB would help nobody.
impl fmt::Debug for HostSide {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("HostSide")
    }
}

impl SharedRam for HostSide {
    fn read(&self, offset: u16) -> u8 {
        let mut board = self.0.borrow_mut();
        board.check_read(offset.into());
        board.ram[usize::from(offset)]
    }

    fn write(&mut self, offset: u16, byte: u8) {
        let mut board = self.0.borrow_mut();
        board.check_write(offset.into(), byte);
        board.written.push(offset.into());
        board.ram[usize::from(offset)] = byte;
    }
}
