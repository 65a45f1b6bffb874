//! A Genius bus in virtual time with the GENI boards of the emulated board, of a host, and of
//! recorders in this process.

use std::cell::RefCell;
use std::rc::Rc;

use crate::lockstep::Lockstep;
use geni_board::{
    Completion, Configuration, Data, Destination, Driver, Event, Options, Start, Transmission,
    TransmitPriority,
};
use ser_node::{GeniusOptions, GeniusPort};
use ser_proto::genius::{FUNCTION_HORNER, SUBFUNCTION_SER};
use ser_proto::{Command, FrameEncoder, Model};
use ser_sim::genius::{Board, BoardOptions, BoardWindow, Bus, BusTiming, Handle, Read, tick_ms};
use ser_sim::{Ram, Scenario, SimNode, SimNodeOptions, Step};

use ser_trial::genius_world::HOST;

/// Bus address of the image.
const RECORDER: u8 = 5;

/// The reset line at power-up, held as shortly as the board allows.
const RESET: Start = Start::Reset { hold_ms: 20 };

/// A recorder in this process, with its port.
pub struct BuiltIn {
    number: u8,
    /// The recorder.
    pub node: SimNode<'static>,
    /// Its port.
    pub port: GeniusPort<BoardWindow>,
}

impl BuiltIn {
    /// Says something on its RS-232 line.
    pub fn send_command(&mut self, command: &Command) {
        self.node.receive(&FrameEncoder::new(command.to_body()).collect::<Vec<u8>>());
        self.node.take_output();
    }

    /// Opens or closes contacts, in the sample that the emulated board is about to take.
    pub fn contact(&mut self, input: u8, on: bool) {
        self.node.play(&Scenario::from_steps([Step { at_ms: 0, input, on }]));
    }
}

/// The bus.
pub struct Genius {
    bus: Rc<RefCell<Bus>>,
    recorder: Handle<Board>,
    /// The other recorders.
    pub others: Vec<BuiltIn>,
    host: Driver<BoardWindow>,
    received: Vec<Data>,
}

impl Genius {
    /// A bus on which both boards have power, and nobody has looked at them.
    #[must_use]
    pub fn new() -> Genius {
        let bus = Rc::new(RefCell::new(Bus::new(BusTiming::default())));
        let connect = |number| bus.borrow_mut().connect(Board::powered(BoardOptions::at(number)));
        let (recorder, host) = (connect(RECORDER), connect(HOST));
        let window = BoardWindow::new(Rc::clone(&bus), host);
        let host =
            Driver::new(window, Options { start: RESET, ..Options::new(Configuration::DEFAULT) });
        Genius { bus, recorder, others: Vec::new(), host, received: Vec::new() }
    }

    /// Connects another recorder, with 32 inputs and in this process. To be called at the
    /// beginning.
    pub fn connect(&mut self, number: u8) {
        let board = self.bus.borrow_mut().connect(Board::powered(BoardOptions::at(number)));
        let window = BoardWindow::new(Rc::clone(&self.bus), board);
        // This memory is given back when the test process ends.
        let node =
            SimNode::new(SimNodeOptions::new(Model::Ser320), Box::leak(Box::new(Ram::new())));
        let options = GeniusOptions { start: RESET, ..GeniusOptions::new(Model::Ser320) };
        self.others.push(BuiltIn { number, node, port: GeniusPort::new(window, options) });
    }

    /// Lets the boards and the host live up to `now_ms`, at which the image is held. The other
    /// recorders live up to the millisecond before, whose sample they have taken.
    pub fn advance(&mut self, now_ms: u64, lockstep: &mut Lockstep) {
        for BuiltIn { node, port, .. } in &mut self.others {
            node.advance_to(now_ms - 1);
            node.serve(port);
            let held = port.reset_held();
            port.window().drive_reset(held);
        }
        {
            let mut bus = self.bus.borrow_mut();
            lockstep.tell_geni(bus.get_mut(self.recorder));
            bus.advance_to(now_ms * 1000);
            lockstep.hear_geni(bus.get_mut(self.recorder));
        }
        #[expect(clippy::cast_possible_truncation, reason = "the count wraps")]
        let event = self.host.poll(now_ms as u32);
        if let Some(Event::Received(received)) = event
            && (received.source, received.function, received.subfunction)
                == (RECORDER, FUNCTION_HORNER, SUBFUNCTION_SER)
        {
            self.received.push(received.data);
        }
        let held = self.host.reset_held();
        self.host.ram_mut().drive_reset(held);
    }

    /// Whether the host knows all recorders and can send something.
    #[must_use]
    pub fn is_ready(&self) -> bool {
        let known = |number| self.host.device(number).is_ok();
        let others = self.others.iter().all(|other| other.port.is_ready() && known(other.number));
        known(RECORDER) && others && self.host.can_transmit()
    }

    /// Sends the recorder a command. [`is_ready`](Genius::is_ready) must have returned true.
    ///
    /// # Errors
    /// When the host's board does not take it.
    pub fn send(&mut self, command: &Command) -> Result<(), String> {
        self.send_to(Destination::Device(RECORDER), command)
    }

    /// Sends a command to all recorders.
    ///
    /// # Errors
    /// When the host's board does not take it.
    pub fn broadcast(&mut self, command: &Command) -> Result<(), String> {
        self.send_to(Destination::Broadcast, command)
    }

    fn send_to(&mut self, destination: Destination, command: &Command) -> Result<(), String> {
        let transmission = Transmission {
            destination,
            function: FUNCTION_HORNER,
            subfunction: SUBFUNCTION_SER,
            priority: TransmitPriority::Normal,
            completion: Completion::Acknowledged,
            // No command is longer than a datagram.
            data: Data::from_slice(&command.to_body()).unwrap_or_default(),
        };
        self.host
            .transmit(transmission)
            .map_err(|error| format!("the host's board refuses: {error:?}"))
    }

    /// The ticks at which the recorders' boards received the datagram that they handed over last,
    /// the image's first.
    ///
    /// # Panics
    /// When there was none since a board's reset.
    #[must_use]
    pub fn read_arrived_ms(&mut self) -> Vec<u64> {
        let image = self.bus.borrow().get(self.recorder).latest_read();
        let others =
            self.others.iter_mut().map(|other| other.port.window().look(Board::latest_read));
        let others = others.collect::<Vec<_>>();
        let arrived_ms = |read: Option<Read>| tick_ms(read.expect("a datagram").arrived_us);
        [image].into_iter().chain(others).map(arrived_ms).collect()
    }

    /// Takes the bodies of what the recorder has said.
    pub fn take_received(&mut self) -> Vec<Data> {
        std::mem::take(&mut self.received)
    }

    /// Checks that both hosts have kept to the rules of their boards.
    ///
    /// # Errors
    /// The first rule that was broken.
    pub fn check(&self) -> Result<(), String> {
        let bus = self.bus.borrow();
        match bus.get(self.recorder).violations().first() {
            Some(violation) => {
                Err(format!("the image breaks a rule of its GENI board: {violation}"))
            }
            None => Ok(()),
        }
    }
}

impl Default for Genius {
    fn default() -> Genius {
        Genius::new()
    }
}
