//! A board's main loop with both ports, in the middle of which time passes: interrupts take
//! samples, bytes and pulses while it is busy. A clock set by broadcast counts from the tick of the
//! pulse, for every change after it.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use geni_board::{
    Completion, Configuration, Data, Destination, Driver, Options, Start, Transmission,
    TransmitPriority,
};
use ser_board::genius::{GeniBoard, Genius};
use ser_board::main_loop::{self, Line};
use ser_board::serial_line::ReceivedByte;
use ser_node::{
    Capture, CaptureChannel, CopyNumber, Debounce, Event as Change, GeniusOptions, NoRtc, Node,
    NodeParts, RECORD_LEN, Storage, Work,
};
use ser_proto::genius::{FUNCTION_HORNER, SUBFUNCTION_SER};
use ser_proto::{AutoReport, Baud, Command, Configure, Entry, FrameEncoder, Model, TimeStamp};
use ser_sim::genius::{Board, BoardOptions, BoardWindow, Bus, BusTiming, Handle};

const UNIT: u8 = 5;
const HOST: u8 = 31;

/// The reset line at power-up, held as shortly as the boards allow.
const RESET: Start = Start::Reset { hold_ms: 20 };

/// By when everybody is on the bus.
const START_LIMIT_MS: u32 = 30_000;

/// How long after time begins to pass the broadcast is given to the host's board. The contact moves
/// when the broadcast has arrived and been ready to be read for a while.
const BROADCAST_AFTER_MS: u32 = 20;
const MOVE_AFTER_MS: u32 = 80;
const AWAY_MS: u32 = 120;

const TEN_O_CLOCK: TimeStamp =
    TimeStamp { year: 26, month: 11, day: 22, hour: 10, minute: 0, second: 0, millisecond: 0 };

/// A configuration that differs from the one in force, so it has to be stored.
const CONFIGURE: Command = Command::Configure(Configure {
    size: Some(1_000),
    baud: None,
    auto_report: AutoReport::Off,
    report_address: 0,
    auto_print: false,
});

/// What happens outside the main loop.
#[derive(Clone, Debug)]
enum Act {
    Broadcast(Command),
    Toggle,
    Say(Command),
}

/// Everything that goes on while the main loop is busy.
struct Surroundings {
    now_ms: u32,
    capture: Capture<'static>,
    inputs: u32,
    bus: Rc<RefCell<Bus>>,
    board: Handle<Board>,
    host: Driver<BoardWindow>,
    pulses: VecDeque<u32>,
    bytes: VecDeque<ReceivedByte>,
    acts: Vec<(u32, Act)>,
    /// When the contact moved.
    moved_ms: Option<u32>,
}

impl Surroundings {
    /// A millisecond. It begins with its sample, and everything after that has its tick.
    fn pass_ms(&mut self) {
        self.now_ms += 1;
        let now_ms = self.now_ms;
        let (due, later) =
            std::mem::take(&mut self.acts).into_iter().partition(|&(at_ms, _)| at_ms <= now_ms);
        self.acts = later;
        let due: Vec<(u32, Act)> = due;
        for (_, act) in due {
            match act {
                Act::Toggle => {
                    self.inputs ^= 1;
                    self.moved_ms = Some(now_ms);
                }
                Act::Broadcast(command) => {
                    transmit(&mut self.host, Destination::Broadcast, &command);
                }
                Act::Say(command) => {
                    let bytes = FrameEncoder::new(command.to_body());
                    self.bytes.extend(bytes.map(|byte| ReceivedByte { byte, at: now_ms.into() }));
                }
            }
        }
        self.capture.sample(now_ms, self.inputs);
        let mut bus = self.bus.borrow_mut();
        bus.advance_to(u64::from(now_ms) * 1000 + 999);
        let pulses = bus.get_mut(self.board).take_interrupts();
        self.pulses.extend(pulses.into_iter().map(|us| u32::try_from(us / 1000).expect("short")));
        drop(bus);
        let _ = self.host.poll(now_ms);
        let held = self.host.reset_held();
        self.host.ram_mut().drive_reset(held);
    }

    /// Plans a broadcast and then a change, both so soon that the main loop is still held up.
    fn plan(&mut self, besides: impl IntoIterator<Item = (u32, Act)>) {
        let acts = [
            (BROADCAST_AFTER_MS, Act::Broadcast(Command::SetClock(TEN_O_CLOCK))),
            (MOVE_AFTER_MS, Act::Toggle),
        ];
        let began_ms = self.now_ms;
        self.acts.extend(
            acts.into_iter().chain(besides).map(|(after_ms, act)| (began_ms + after_ms, act)),
        );
    }
}

fn transmit(host: &mut Driver<BoardWindow>, destination: Destination, command: &Command) {
    let transmission = Transmission {
        destination,
        function: FUNCTION_HORNER,
        subfunction: SUBFUNCTION_SER,
        priority: TransmitPriority::Normal,
        completion: Completion::Acknowledged,
        data: Data::from_slice(&command.to_body()).expect("short"),
    };
    host.transmit(transmission).expect("the board takes it");
}

type Shared = Rc<RefCell<Surroundings>>;

/// Memory that takes its time, like flash while a sector is erased.
struct SlowStorage {
    around: Shared,
    copies: [[u8; RECORD_LEN]; 2],
    /// Whether something happens during the next writing.
    meanwhile: Rc<RefCell<bool>>,
}

impl Storage for SlowStorage {
    type Error = ();

    fn read(&mut self, copy: CopyNumber, record: &mut [u8; RECORD_LEN]) -> Result<(), ()> {
        *record = self.copies[copy as usize];
        Ok(())
    }

    fn write(&mut self, copy: CopyNumber, record: &[u8; RECORD_LEN]) -> Result<(), ()> {
        self.copies[copy as usize] = *record;
        let mut around = self.around.borrow_mut();
        if self.meanwhile.take() {
            around.plan([]);
        }
        (0..AWAY_MS).for_each(|_| around.pass_ms());
        Ok(())
    }
}

/// The line, and the lines of the GENI board.
struct Lines {
    around: Shared,
    window: BoardWindow,
    /// Whether time passes when the main loop asks for line errors. It has read its tick by then.
    is_away: bool,
}

impl Line for Lines {
    const MAX_BYTES: usize = 256;

    fn receive(&mut self, now_ms: u32) -> Option<ReceivedByte> {
        let bytes = &mut self.around.borrow_mut().bytes;
        if bytes.front()?.at.tick_ms <= now_ms { bytes.pop_front() } else { None }
    }

    fn errors(&mut self) -> u32 {
        if std::mem::take(&mut self.is_away) {
            let mut around = self.around.borrow_mut();
            // A command arrives last.
            around.plan([(AWAY_MS, Act::Say(Command::QueryMode))]);
            (0..AWAY_MS).for_each(|_| around.pass_ms());
        }
        0
    }

    fn can_send(&self) -> bool {
        true
    }

    fn send(&mut self, _: u8) {}

    fn is_quiet(&mut self, _: u32) -> bool {
        true
    }

    fn set_baud(&mut self, _: Baud) {}
}

impl GeniBoard for Lines {
    fn next_pulse(&mut self) -> Option<u32> {
        self.around.borrow_mut().pulses.pop_front()
    }

    fn drive_reset(&mut self, held: bool) {
        self.window.drive_reset(held);
    }
}

struct Bench {
    around: Shared,
    node: Node<'static, SlowStorage, NoRtc>,
    line: Lines,
    genius: Genius<BoardWindow, Lines>,
    /// Whether a broadcast and a change come while the configuration is stored.
    meanwhile: Rc<RefCell<bool>>,
}

impl Bench {
    /// A bench on which everybody is on the bus.
    fn start() -> Bench {
        let bus = Rc::new(RefCell::new(Bus::new(BusTiming::default())));
        let connect = |number| bus.borrow_mut().connect(Board::new(BoardOptions::at(number)));
        let (board, host) = (connect(UNIT), connect(HOST));
        let window = |board| BoardWindow::new(Rc::clone(&bus), board);
        let host = Driver::new(
            window(host),
            Options { start: RESET, ..Options::new(Configuration::DEFAULT) },
        );
        // This memory is given back when the test process ends.
        let (capture, reader) = Box::leak(Box::new(CaptureChannel::new())).split(Debounce::OFF);
        let around = Rc::new(RefCell::new(Surroundings {
            now_ms: 0,
            capture,
            inputs: 0,
            bus: Rc::clone(&bus),
            board,
            host,
            pulses: VecDeque::new(),
            bytes: VecDeque::new(),
            acts: Vec::new(),
            moved_ms: None,
        }));
        let meanwhile = Rc::new(RefCell::new(false));
        let storage = SlowStorage {
            around: Rc::clone(&around),
            copies: [[0xFF; RECORD_LEN]; 2],
            meanwhile: Rc::clone(&meanwhile),
        };
        let model = Model::Ser160;
        let log = vec![Change::EMPTY; 2048].leak();
        let work = Box::leak(Box::new(Work::new()));
        let parts = NodeParts { model, log, work, capture: reader, storage, rtc: NoRtc, id: None };
        let node = Node::new(parts);
        let lines = || Lines { around: Rc::clone(&around), window: window(board), is_away: false };
        let options = GeniusOptions { start: RESET, ..GeniusOptions::new(model) };
        let genius = Genius::new(lines(), window(board), options);
        let line = lines();
        let mut bench = Bench { around, node, line, genius, meanwhile };
        while !bench.is_ready() {
            assert!(bench.around.borrow().now_ms < START_LIMIT_MS, "not everybody is on the bus");
            bench.turn();
        }
        (0..500).for_each(|_| bench.turn());
        bench
    }

    fn is_ready(&self) -> bool {
        let host = &self.around.borrow().host;
        self.genius.is_ready() && host.device(UNIT).is_ok() && host.can_transmit()
    }

    /// A millisecond, and a pass of the main loop.
    fn turn(&mut self) {
        self.around.borrow_mut().pass_ms();
        main_loop::pass(&mut self.node, &mut self.line, Some(&mut self.genius));
    }

    /// Checks that the change has the time that was set, counted from when the board says it came.
    fn assert_stamped_by_the_broadcast(&mut self) {
        (0..200).for_each(|_| self.turn());
        let around = self.around.borrow();
        let read = around.bus.borrow().get(around.board).latest_read().expect("the broadcast");
        let arrived_ms = read.arrived_us / 1000;
        let moved_ms = u64::from(around.moved_ms.expect("the contact has moved"));
        assert!(arrived_ms < moved_ms, "{arrived_ms} {moved_ms}");
        let millisecond = u16::try_from(moved_ms - arrived_ms).expect("short");
        let stamps: Vec<TimeStamp> =
            self.node.read(1, 10).entries.iter().map(|entry: &Entry| entry.time).collect();
        assert_eq!(
            stamps,
            [TimeStamp { millisecond, ..TEN_O_CLOCK }],
            "{:?}",
            self.node.diagnostics()
        );
        assert_eq!(self.node.diagnostics().settings_late, 0);
        assert_eq!(self.genius.diagnostics().broadcasts, 1);
    }
}

#[test]
fn a_change_after_a_broadcast_waits_for_it_while_a_configuration_is_stored_for_the_line() {
    let mut bench = Bench::start();
    bench.meanwhile.replace(true);
    let now_ms = bench.around.borrow().now_ms;
    bench.around.borrow_mut().acts.push((now_ms + 1, Act::Say(CONFIGURE)));
    bench.turn();
    assert!(!bench.meanwhile.take(), "the configuration has been stored");
    bench.assert_stamped_by_the_broadcast();
}

#[test]
fn a_change_after_a_broadcast_waits_for_it_while_a_configuration_is_stored_for_the_bus() {
    let mut bench = Bench::start();
    bench.meanwhile.replace(true);
    transmit(&mut bench.around.borrow_mut().host, Destination::Device(UNIT), &CONFIGURE);
    for _ in 0..100 {
        if !*bench.meanwhile.borrow() {
            break;
        }
        bench.turn();
    }
    assert!(!bench.meanwhile.take(), "the configuration has been stored");
    bench.assert_stamped_by_the_broadcast();
}

#[test]
fn a_command_that_came_after_a_broadcast_does_not_overtake_it() {
    let mut bench = Bench::start();
    bench.line.is_away = true;
    bench.turn();
    assert_eq!(bench.node.commands(), 0, "it came after the tick of the pass");
    bench.assert_stamped_by_the_broadcast();
    assert_eq!(bench.node.commands(), 2);
}
