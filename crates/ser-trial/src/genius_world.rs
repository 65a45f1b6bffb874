//! Recorders and a host on a Genius bus, in virtual time: nodes with their ports, boards, the bus,
//! and the driver at the host's board.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use chrono::NaiveDateTime;
use geni_board::{
    CommandError, Completion, Configuration, Data, Destination, Driver, Event, Options,
    ReceivedDatagram, Start,
};
use ser_node::{Debounce, GeniusOptions, GeniusPort};
use ser_proto::genius::{FUNCTION_HORNER, SUBFUNCTION_SER};
use ser_proto::{
    AutoReport, Command, Configure, Decoded, FrameDecoder, FrameEncoder, MAX_BODY_LEN, Model, Reply,
};
use ser_sim::genius::{
    Board, BoardOptions, BoardWindow, Bus, BusTiming, Handle, Noise, ViolationKind, tick_ms,
};
use ser_sim::{NonVolatile, Ram, Scenario, SimNode, SimNodeOptions, SimRtc, Step};

/// Bus address of the host.
pub const HOST: u8 = 31;

/// The settings with which a recorder sends every event to the host as it happens.
pub const REPORT: Configure = Configure {
    size: None,
    baud: None,
    auto_report: AutoReport::Genius,
    report_address: HOST,
    auto_print: false,
};

/// The reset line at power-up, held as shortly as the boards allow.
const RESET: Start = Start::Reset { hold_ms: 20 };

/// The time in which everything waited for happens. Thirty boards that ask each other who they are,
/// with one datagram per scan, take more than a minute.
const LIMIT_MS: u64 = 300_000;

/// How soon a host finds out that its board has started anew: within a few looks at it.
const FOUND_OUT_US: u64 = 5_000;

/// How long everybody is given once all are on the bus.
const SETTLING_MS: u64 = 500;

/// A recorder with its board.
pub struct Recorder {
    /// Bus address.
    pub number: u8,
    /// The recorder.
    pub node: SimNode<'static>,
    /// Its port.
    pub port: GeniusPort<BoardWindow>,
    /// Its board.
    pub board: Handle<Board>,
    /// Whether it gets the pulses of its board's interrupt line.
    pub has_line: bool,
    /// Until when its main loop is away, while its interrupts go on.
    pub away_until_ms: u64,
    frames: FrameDecoder<MAX_BODY_LEN>,
}

impl Recorder {
    /// When the board received the datagram that it handed over last, in microseconds.
    ///
    /// # Panics
    /// When there was none since its reset.
    #[must_use]
    pub fn read_arrived_us(&mut self) -> u64 {
        self.port.window().look(Board::latest_read).expect("a datagram").arrived_us
    }

    /// Lets a millisecond of the recorder pass whose bus has come to its end.
    fn pass_ms(&mut self, now_ms: u64) {
        let Recorder { node, port, has_line, away_until_ms, .. } = self;
        if *has_line {
            let pulses = port.window().take_interrupts();
            pulses.into_iter().for_each(|at_us| node.interrupt(port, tick_ms(at_us)));
        }
        if now_ms < *away_until_ms {
            return;
        }
        if std::mem::take(away_until_ms) > 0 {
            node.hold_up_to(now_ms);
        }
        node.advance_to(now_ms);
        node.serve(port);
        let held = port.reset_held();
        port.window().drive_reset(held);
    }

    /// Opens or closes a contact in the next millisecond.
    pub fn contact(&mut self, input: u8, on: bool) {
        self.node.play(&Scenario::from_steps([Step { at_ms: 0, input, on }]));
    }

    /// Says something on the recorder's RS-232 line.
    pub fn serial_send(&mut self, command: &Command) {
        self.node.receive(&FrameEncoder::new(command.to_body()).collect::<Vec<u8>>());
    }

    /// What the recorder has said on its RS-232 line: replies, and text.
    pub fn serial_said(&mut self) -> (Vec<Reply>, String) {
        let (mut replies, mut text) = (Vec::new(), String::new());
        for byte in self.node.take_output() {
            match self.frames.push(byte) {
                Some(Decoded::Frame(body)) => {
                    replies.push(Reply::parse(body).expect("a recorder's reply"));
                }
                Some(Decoded::Text(byte)) => text.push(byte.into()),
                Some(Decoded::Dropped(dropped)) => panic!("the recorder sent {dropped:?}"),
                None => {}
            }
        }
        (replies, text)
    }

    /// Asks over RS-232.
    ///
    /// # Panics
    /// When there is not exactly one reply at once.
    pub fn serial_ask(&mut self, command: &Command) -> Reply {
        self.serial_send(command);
        let (mut replies, _) = self.serial_said();
        assert_eq!(replies.len(), 1, "{command:?}: {replies:?}");
        replies.remove(0)
    }
}

/// The host's board.
pub struct Host {
    /// The driver for it.
    pub driver: Driver<BoardWindow>,
    /// The board.
    pub board: Handle<Board>,
    /// Datagrams that have arrived, and when.
    pub inbox: VecDeque<(u64, ReceivedDatagram)>,
    /// How the datagrams ended that the host wanted to send.
    pub sent: VecDeque<Result<(), CommandError>>,
}

/// Recorders and a host on their bus.
pub struct World {
    /// The bus.
    pub bus: Rc<RefCell<Bus>>,
    /// The recorders.
    pub recorders: Vec<Recorder>,
    /// The host.
    pub host: Host,
    /// The present.
    pub now_ms: u64,
}

impl World {
    /// Recorders with these bus addresses and a host, all powered at time zero, on a bus without
    /// noise.
    #[must_use]
    pub fn new(recorders: &[(u8, Model)]) -> World {
        World::with_noise(recorders, Noise::default())
    }

    /// Recorders and a host on a noisy bus.
    #[must_use]
    pub fn with_noise(recorders: &[(u8, Model)], noise: Noise) -> World {
        World::of(recorders, noise, Debounce::OFF, BoardOptions::default().model)
    }

    /// Recorders and a host on a noisy bus, with boards of this model number.
    #[must_use]
    pub fn with_boards(recorders: &[(u8, Model)], noise: Noise, board_model: u8) -> World {
        World::of(recorders, noise, Debounce::OFF, board_model)
    }

    fn of(recorders: &[(u8, Model)], noise: Noise, debounce: Debounce, board_model: u8) -> World {
        let bus = Rc::new(RefCell::new(Bus::with_noise(BusTiming::default(), noise)));
        let connect = |number| {
            let options = BoardOptions { model: board_model, ..BoardOptions::at(number) };
            let board = bus.borrow_mut().connect(Board::new(options));
            (board, BoardWindow::new(Rc::clone(&bus), board))
        };
        let recorders = recorders
            .iter()
            .map(|&(number, model)| {
                let (board, window) = connect(number);
                // Every clock shows a different time, until somebody sets them.
                let time =
                    NaiveDateTime::default() + chrono::TimeDelta::days(365 * i64::from(number));
                let non_volatile = NonVolatile {
                    storage: ser_sim::MemoryStorage::default(),
                    rtc: SimRtc::held_at(time),
                    id: None,
                };
                let options =
                    SimNodeOptions { debounce, non_volatile, ..SimNodeOptions::new(model) };
                // This memory is given back when the test process ends.
                let node = SimNode::new(options, Box::leak(Box::new(Ram::new())));
                let options = GeniusOptions { start: RESET, ..GeniusOptions::new(model) };
                let port = GeniusPort::new(window, options);
                let frames = FrameDecoder::new();
                Recorder { number, node, port, board, has_line: false, away_until_ms: 0, frames }
            })
            .collect();
        let (board, window) = connect(HOST);
        let options = Options { start: RESET, ..Options::new(Configuration::DEFAULT) };
        let driver = Driver::new(window, options);
        let host = Host { driver, board, inbox: VecDeque::new(), sent: VecDeque::new() };
        World { bus, recorders, host, now_ms: 0 }
    }

    /// Recorders and a host, once everybody is on the bus.
    ///
    /// # Panics
    /// When somebody is not on the bus within five minutes.
    #[must_use]
    pub fn started(recorders: &[(u8, Model)]) -> World {
        World::new(recorders).when_started()
    }

    /// Recorders and a host on a noisy bus, once everybody is on it.
    ///
    /// # Panics
    /// When somebody is not on the bus within five minutes.
    #[must_use]
    pub fn started_with_noise(recorders: &[(u8, Model)], noise: Noise) -> World {
        World::with_noise(recorders, noise).when_started()
    }

    /// Recorders with debounce and a host, once everybody is on the bus.
    ///
    /// # Panics
    /// When somebody is not on the bus within five minutes.
    #[must_use]
    pub fn started_with(recorders: &[(u8, Model)], debounce: Debounce) -> World {
        World::of(recorders, Noise::default(), debounce, BoardOptions::default().model)
            .when_started()
    }

    fn when_started(self) -> World {
        let mut world = self;
        world.until("everybody is on the bus", |world| {
            let known = |recorder: &Recorder| {
                recorder.port.is_ready() && world.host.driver.device(recorder.number).is_ok()
            };
            world.recorders.iter().all(known).then_some(())
        });
        // Boards that have asked each other who they are then assign themselves as controllers.
        world.run(SETTLING_MS);
        world.host.inbox.clear();
        world
    }

    /// Makes all recorders [report](REPORT) from now on.
    pub fn report_to_host(&mut self) {
        for recorder in &mut self.recorders {
            recorder.serial_ask(&Command::Configure(REPORT));
        }
    }

    /// Lets a millisecond pass.
    pub fn step(&mut self) {
        self.step_without_host();
        match self.host.driver.poll(u32::try_from(self.now_ms).expect("less than 49 days")) {
            Some(Event::Received(received)) => self.host.inbox.push_back((self.now_ms, received)),
            Some(Event::Sent(result)) => self.host.sent.push_back(result),
            _ => {}
        }
        let held = self.host.driver.reset_held();
        self.host.driver.ram_mut().drive_reset(held);
    }

    /// Lets a millisecond pass without the driver of this host. The host may be another program.
    pub fn step_without_host(&mut self) {
        self.now_ms += 1;
        self.bus.borrow_mut().advance_to(self.now_ms * 1000);
        self.recorders.iter_mut().for_each(|recorder| recorder.pass_ms(self.now_ms));
    }

    /// Lets time pass.
    pub fn run(&mut self, ms: u64) {
        for _ in 0..ms {
            self.step();
        }
    }

    /// Lets time pass until `look` finds something.
    ///
    /// # Panics
    /// When it finds nothing within five minutes.
    pub fn until<T>(&mut self, what: &str, mut look: impl FnMut(&mut World) -> Option<T>) -> T {
        for _ in 0..LIMIT_MS {
            if let Some(found) = look(self) {
                return found;
            }
            self.step();
        }
        panic!("{what}: not within {LIMIT_MS} ms");
    }

    /// Gives the host's board a datagram as soon as the board takes one.
    pub fn transmit(
        &mut self,
        destination: Destination,
        function: u8,
        subfunction: u8,
        data: &[u8],
    ) {
        let data = Data::from_slice(data).expect("short enough");
        self.until("the host's board is free", |world| {
            world.host.driver.can_transmit().then_some(())
        });
        let transmission = geni_board::Transmission {
            destination,
            function,
            subfunction,
            priority: geni_board::TransmitPriority::Normal,
            completion: Completion::Acknowledged,
            data,
        };
        self.host.driver.transmit(transmission).expect("the board takes it");
    }

    /// Sends a command from the host.
    pub fn send(&mut self, destination: Destination, command: &Command) {
        self.transmit(destination, FUNCTION_HORNER, SUBFUNCTION_SER, &command.to_body());
    }

    /// The oldest message of a recorder that has arrived at the host.
    pub fn take_message(&mut self, from: u8) -> Option<(u64, Data)> {
        let fits = |received: &ReceivedDatagram| {
            (received.source, received.function, received.subfunction)
                == (from, FUNCTION_HORNER, SUBFUNCTION_SER)
        };
        let at = self.host.inbox.iter().position(|(_, received)| fits(received))?;
        self.host.inbox.remove(at).map(|(at_ms, received)| (at_ms, received.data))
    }

    /// Asks a recorder over Genius.
    ///
    /// # Panics
    /// When there is no reply.
    pub fn ask(&mut self, number: u8, command: &Command) -> Reply {
        Reply::parse(&self.ask_bytes(number, command)).expect("a reply")
    }

    /// Asks a recorder over Genius, and returns the bytes of the reply.
    ///
    /// # Panics
    /// When there is no reply.
    pub fn ask_bytes(&mut self, number: u8, command: &Command) -> Data {
        self.send(Destination::Device(number), command);
        self.until("a reply", |world| world.take_message(number)).1
    }

    /// A recorder's global data, as the host's board has it in its input table.
    #[must_use]
    pub fn global(&self, number: u8, len: usize) -> Vec<u8> {
        let bus = self.bus.borrow();
        let table = INPUT_TABLE + usize::from(number) * 128;
        bus.get(self.host.board).ram()[table..table + len].to_vec()
    }

    /// Checks that no host did what the manual forbids, with one exception. A recorder whose board
    /// has started anew by itself may look at it once too early, because nobody tells it.
    ///
    /// # Panics
    /// When a host did more.
    pub fn assert_lawful_but_for_a_reset(&self) {
        let bus = self.bus.borrow();
        for recorder in &self.recorders {
            let violations = bus.get(recorder.board).violations();
            let first_us = violations.first().map(|violation| violation.at_us);
            for violation in violations {
                assert_eq!(violation.kind, ViolationKind::TooEarly, "recorder {}", recorder.number);
                let since_us = violation.at_us - first_us.unwrap_or_default();
                assert!(since_us <= FOUND_OUT_US, "recorder {}: {violation:?}", recorder.number);
            }
        }
        assert_eq!(bus.get(self.host.board).violations(), [], "host");
    }

    /// Checks that no host did what the manual forbids.
    ///
    /// # Panics
    /// When one did.
    pub fn assert_lawful(&self) {
        let bus = self.bus.borrow();
        for recorder in &self.recorders {
            assert_eq!(bus.get(recorder.board).violations(), [], "recorder {}", recorder.number);
        }
        assert_eq!(bus.get(self.host.board).violations(), [], "host");
    }
}

/// Where the input table begins in the shared RAM; each device has 128 bytes there.
const INPUT_TABLE: usize = 0x2000;
