//! What the bus asks of the devices that are connected to it.

use std::any::Any;

use super::datagram::{BROADCAST, Datagram};
use super::faults::DeviceFault;
use super::scan_time::BusTiming;

/// Something a device says on its turn.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Message {
    /// Inputs of a block, or global data of a controller, to everyone. Every turn ends with it,
    /// even if it is empty: it passes the token and shows that the device is there.
    Control(Vec<u8>),
    /// Outputs for a block, or directed control data for a controller.
    Directed {
        /// The device they are for.
        to: u8,
        /// The outputs.
        data: Vec<u8>,
    },
    /// Tells the receiver to report faults to the sender from now on.
    AssignController {
        /// The device.
        to: u8,
    },
    /// A datagram.
    Datagram {
        /// A device, or [`BROADCAST`].
        to: u8,
        /// The datagram.
        datagram: Datagram,
    },
}

impl Message {
    /// The device it is for; `None` when it is for all.
    #[must_use]
    pub fn to(&self) -> Option<u8> {
        match *self {
            Message::Control(_) => None,
            Message::Directed { to, .. }
            | Message::AssignController { to }
            | Message::Datagram { to, .. } => Some(to).filter(|&to| to != BROADCAST),
        }
    }

    /// Whether it takes the scan's one place for messages other than control data.
    #[must_use]
    pub fn is_background(&self) -> bool {
        matches!(self, Message::AssignController { .. } | Message::Datagram { .. })
    }

    /// How long it takes, apart from the fixed part of a turn.
    #[must_use]
    pub fn duration_ns(&self, rate: BusTiming) -> u64 {
        match self {
            Message::Control(data) | Message::Directed { data, .. } => {
                rate.byte_ns() * data.len() as u64
            }
            Message::AssignController { .. } => rate.datagram_ns(0),
            Message::Datagram { datagram, .. } => rate.datagram_ns(datagram.data.len()),
        }
    }
}

/// A device on the bus, driven by [`Bus`](super::Bus).
pub trait Device: Any + Send {
    /// The bus address on which it takes turns; `None` while it is silent.
    fn address(&self) -> Option<u8>;

    /// The speed it is set to.
    fn rate(&self) -> BusTiming;

    /// It was connected to the bus.
    fn connect(&mut self, now_us: u64) {
        self.advance_to(now_us);
    }

    /// When it next has something to do by itself.
    fn next_due_us(&self) -> Option<u64>;

    /// Lets time pass. Does what was due meanwhile, and what is due now.
    fn advance_to(&mut self, now_us: u64);

    /// Takes its turn: returns what it says, ending with [`Message::Control`]. `background_free`
    /// says that nobody has sent a datagram in this scan yet.
    fn take_turn(&mut self, now_us: u64, background_free: bool) -> Vec<Message>;

    /// The turn is over. `arrived` says for each message whether its receiver acknowledged it. It
    /// is true for messages to all.
    fn end_turn(&mut self, now_us: u64, messages: &[Message], arrived: &[bool]);

    /// Another device took its turn at the same time.
    fn collide(&mut self, now_us: u64) {
        self.count_bus_error(now_us);
    }

    /// Hears a message on the bus, to anyone. Returns whether it acknowledges the message.
    fn receive(&mut self, now_us: u64, from: u8, message: &Message) -> bool;

    /// A message came damaged, or not at all.
    fn count_bus_error(&mut self, _now_us: u64) {}

    /// Something goes wrong with it. A fault that cannot happen to this kind of device is ignored.
    fn suffer(&mut self, _now_us: u64, _fault: DeviceFault) {}
}
