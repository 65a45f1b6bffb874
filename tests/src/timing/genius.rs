//! A Genius bus in virtual time with the emulated board's GENI and a host's.

use std::cell::RefCell;
use std::rc::Rc;

use geni::{
    Completion, Configuration, Data, Destination, Driver, Event, Options, Priority, Start, Transmission,
};
use ser_proto::Command;
use ser_proto::genius::{FUNCTION_HORNER, SUBFUNCTION_SER};
use ser_sim::Lockstep;
use ser_sim::genius::{Board, BoardOptions, BoardWindow, Bus, BusRate, Handle};

/// Device numbers.
pub const HOST: u8 = 31;
const RECORDER: u8 = 5;

/// Reset line at power-up, as short as the board allows.
const RESET: Start = Start::Reset { hold_ms: 20 };

/// The bus.
pub struct Genius {
    bus: Rc<RefCell<Bus>>,
    recorder: Handle<Board>,
    host: Driver<BoardWindow>,
    received: Vec<Data>,
}

impl Genius {
    /// Both boards have power, and nobody has looked at them.
    #[must_use]
    pub fn new() -> Genius {
        let bus = Rc::new(RefCell::new(Bus::new(BusRate::default())));
        let connect = |number| bus.borrow_mut().connect(Board::powered(BoardOptions::at(number)));
        let (recorder, host) = (connect(RECORDER), connect(HOST));
        let window = BoardWindow::new(Rc::clone(&bus), host);
        let host = Driver::new(window, Options { start: RESET, ..Options::new(Configuration::DEFAULT) });
        Genius { bus, recorder, host, received: Vec::new() }
    }

    /// The recorder is held at this millisecond: lets the boards and the host live up to it.
    pub fn advance(&mut self, now_ms: u64, lockstep: &mut Lockstep) {
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

    /// Whether the host knows the recorder and can send it something.
    #[must_use]
    pub fn is_ready(&self) -> bool {
        self.host.device(RECORDER).is_ok() && self.host.can_transmit()
    }

    /// Sends the recorder a command. [`is_ready`](Genius::is_ready) has said yes.
    ///
    /// # Errors
    /// When the host's board does not take it.
    pub fn send(&mut self, command: &Command) -> Result<(), String> {
        let transmission = Transmission {
            destination: Destination::Device(RECORDER),
            function: FUNCTION_HORNER,
            subfunction: SUBFUNCTION_SER,
            priority: Priority::Normal,
            completion: Completion::Acknowledged,
            // No command is longer than a datagram.
            data: Data::from_slice(&command.to_body()).unwrap_or_default(),
        };
        self.host.transmit(transmission).map_err(|error| format!("the host's board refuses: {error:?}"))
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
            Some(violation) => Err(format!("the image breaks a rule of its GENI board: {violation}")),
            None => Ok(()),
        }
    }
}

impl Default for Genius {
    fn default() -> Genius {
        Genius::new()
    }
}
