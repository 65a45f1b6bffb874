//! A board's main loop with a UART that is a pair of queues: rings, line and node together.

use geni_board::SharedRam;
use ser_board::budget;
use ser_board::genius::{GeniBoard, Genius};
use ser_board::main_loop::{self, Line};
use ser_board::ring::{Reader, Writer};
use ser_board::serial_line::{
    self, LineErrors, Quiet, ReceivedByte, Receiver, SerialEnds, SerialRings,
};
use ser_node::{
    Capture, CaptureChannel, CopyNumber, Debounce, Event, NoRtc, Node, NodeParts, RECORD_LEN,
    Storage, Work,
};
use ser_proto::{
    AutoReport, Baud, Command, Configure, Decoded, FrameDecoder, FrameEncoder, MAX_BODY_LEN, Mode,
    Model, Reply,
};

const RECEIVE: usize = budget::RECEIVE_RING_LEN;
const TRANSMIT: usize = budget::TRANSMIT_RING_LEN;

struct NoStorage;

impl Storage for NoStorage {
    type Error = ();

    fn read(&mut self, _: CopyNumber, _: &mut [u8; RECORD_LEN]) -> Result<(), ()> {
        Err(())
    }

    fn write(&mut self, _: CopyNumber, _: &[u8; RECORD_LEN]) -> Result<(), ()> {
        Err(())
    }
}

/// A GENI board that is not fitted.
enum NoBoard {}

const NO_GENIUS: Option<&mut Genius<NoBoard, NoBoard>> = None;

impl SharedRam for NoBoard {
    fn read(&self, _: u16) -> u8 {
        match *self {}
    }

    fn write(&mut self, _: u16, _: u8) {
        match *self {}
    }
}

impl GeniBoard for NoBoard {
    fn next_pulse(&mut self) -> Option<u32> {
        match *self {}
    }

    fn drive_reset(&mut self, _: bool) {
        match *self {}
    }
}

/// The main loop's end of a UART.
struct Uart<'a> {
    received: Reader<'a, ReceivedByte, RECEIVE>,
    errors: LineErrors<'a>,
    to_send: Writer<'a, u8, TRANSMIT>,
    quiet: Quiet,
    baud: Baud,
    /// The transmitter has a byte that it has not finished.
    is_sending: bool,
}

impl Line for Uart<'_> {
    const MAX_BYTES: usize = RECEIVE;

    fn receive(&mut self, now_ms: u32) -> Option<ReceivedByte> {
        serial_line::take_until(&mut self.received, now_ms)
    }

    fn errors(&mut self) -> u32 {
        self.errors.take()
    }

    fn can_send(&self) -> bool {
        self.to_send.has_room()
    }

    fn send(&mut self, byte: u8) {
        assert!(self.to_send.push(byte), "called without room");
    }

    fn is_quiet(&mut self, now_ms: u32) -> bool {
        self.quiet.look(self.to_send.is_empty() && !self.is_sending, now_ms, self.baud)
    }

    fn set_baud(&mut self, baud: Baud) {
        assert!(!self.is_sending, "what is being sent would be garbled");
        self.baud = baud;
    }
}

/// A board: interrupts, main loop and time. The transmitter takes two bytes per millisecond.
struct Board<'a> {
    node: Node<'a, NoStorage, NoRtc>,
    capture: Capture<'a>,
    uart: Uart<'a>,
    receiver: Receiver<'a, RECEIVE>,
    transmitter: Reader<'a, u8, TRANSMIT>,
    tick_ms: u32,
    /// What has left the transmitter, and at which rate.
    sent: Vec<(u8, Baud)>,
}

struct Memory {
    channel: CaptureChannel,
    log: Vec<Event>,
    work: Work,
    rings: SerialRings<RECEIVE, TRANSMIT>,
}

impl Memory {
    fn new() -> Memory {
        Memory {
            channel: CaptureChannel::new(),
            log: vec![Event::EMPTY; 2048],
            work: Work::new(),
            rings: SerialRings::new(),
        }
    }

    fn power_up(&mut self) -> Board<'_> {
        let (capture, reader) = self.channel.split(Debounce::OFF);
        let node = Node::new(NodeParts {
            model: Model::Ser320,
            log: &mut self.log,
            work: &mut self.work,
            capture: reader,
            storage: NoStorage,
            rtc: NoRtc,
            id: None,
        });
        let SerialEnds { receiver, received, errors, to_send, transmitter } = self.rings.split();
        let uart = Uart {
            received,
            errors,
            to_send,
            quiet: Quiet::new(),
            baud: node.baud(),
            is_sending: false,
        };
        Board { node, capture, uart, receiver, transmitter, tick_ms: 0, sent: Vec::new() }
    }
}

impl Board<'_> {
    /// Passes a millisecond in which the main loop does not run.
    fn stall_ms(&mut self, inputs: u32) {
        self.tick_ms += 1;
        self.capture.sample(self.tick_ms, inputs);
        self.uart.is_sending = false;
        for _ in 0..2 {
            if let Some(byte) = self.transmitter.pop() {
                self.sent.push((byte, self.uart.baud));
                self.uart.is_sending = true;
            }
        }
    }

    fn pass_ms(&mut self, ms: u32) {
        for _ in 0..ms {
            self.stall_ms(0);
            assert_eq!(main_loop::pass(&mut self.node, &mut self.uart, NO_GENIUS), self.tick_ms);
        }
    }

    fn arrive(&mut self, command: &Command) {
        for byte in FrameEncoder::new(command.to_body()) {
            self.receiver.push(ReceivedByte { byte, at: self.tick_ms.into() });
        }
    }

    fn replies(&self) -> Vec<Reply> {
        let mut decoder = FrameDecoder::<MAX_BODY_LEN>::new();
        self.sent
            .iter()
            .filter_map(|&(byte, _)| match decoder.push(byte)? {
                Decoded::Frame(body) => Some(Reply::parse(body).unwrap()),
                other => panic!("the recorder sent {other:?}"),
            })
            .collect()
    }
}

#[test]
fn a_command_goes_in_and_its_reply_comes_out() {
    let mut memory = Memory::new();
    let mut board = memory.power_up();
    board.arrive(&Command::SetMode { recording: false });
    board.pass_ms(100);
    assert_eq!(
        board.replies(),
        [Reply::Mode(Mode { recording: false, version: ser_node::VERSION })]
    );
}

#[test]
fn the_rate_changes_when_the_reply_has_left_and_not_before() {
    let mut memory = Memory::new();
    let mut board = memory.power_up();
    let faster = Configure {
        size: None,
        baud: Some(Baud::B19200),
        auto_report: AutoReport::Off,
        report_address: 0,
        auto_print: false,
    };
    board.arrive(&Command::Configure(faster));
    board.arrive(&Command::QueryMode);
    board.pass_ms(100);
    let replies = board.replies();
    assert!(matches!(replies[..], [Reply::Configuration(_), Reply::Mode(_)]), "{replies:?}");
    let changed_at = board.sent.iter().position(|&(_, baud)| baud == Baud::B19200);
    let first_reply_len = FrameEncoder::new(replies[0].to_body()).count();
    assert_eq!(changed_at, Some(first_reply_len));
}

#[test]
fn what_arrives_during_the_longest_stall_is_not_lost() {
    let mut memory = Memory::new();
    let mut board = memory.power_up();
    board.pass_ms(1);
    // All inputs change in every millisecond, and the line is never silent.
    let mut line =
        std::iter::repeat_with(|| FrameEncoder::new(Command::QueryMode.to_body())).flatten();
    let mut arrived = 0;
    for ms in 1..=budget::MAIN_LOOP_STALL_MS {
        board.stall_ms(if ms.is_multiple_of(2) { 0 } else { u32::MAX });
        while arrived < budget::bytes_in(ms) {
            let byte = line.next().unwrap();
            board.receiver.push(ReceivedByte { byte, at: board.tick_ms.into() });
            arrived += 1;
        }
    }
    board.pass_ms(1000);
    let diagnostics = board.node.diagnostics();
    assert_eq!(
        (diagnostics.edges_lost, diagnostics.samples_missed, diagnostics.line_errors),
        (0, 0, 0)
    );
    let frame_len = FrameEncoder::new(Command::QueryMode.to_body()).count();
    assert_eq!(board.replies().len(), arrived / frame_len);
}

#[test]
fn bytes_beyond_the_ring_are_counted_as_line_errors() {
    let mut memory = Memory::new();
    let mut board = memory.power_up();
    for _ in 0..RECEIVE + 10 {
        board.receiver.push(ReceivedByte { byte: b'.', at: 0.into() });
    }
    board.receiver.count_error();
    // At once, because no further byte may ever follow.
    board.pass_ms(1);
    assert_eq!(board.node.diagnostics().line_errors, 11);
    board.arrive(&Command::QueryMode);
    board.pass_ms(100);
    assert_eq!(board.node.diagnostics().line_errors, 11);
    assert_eq!(board.replies().len(), 1);
}
