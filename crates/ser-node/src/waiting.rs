//! Requests that have arrived and whose replies wait for their turn, in order of arrival.

use heapless::Deque;
use ser_proto::genius::ForceTable;
use ser_proto::{ClockSource, Command};

use crate::arrival::Way;

/// Requests that may wait on each way while a message is being sent. A GENI board itself holds at
/// most 15 commands.
const MAX_WAITING: usize = 16;

/// A command that has arrived and whose reply waits for its turn.
///
/// A command whose moment of arrival matters has already been carried out. All others are carried
/// out when their turn comes, so that a read is never answered from a log that a later command has
/// already erased.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) enum Pending {
    /// Still to be carried out.
    To(Command),
    /// The clock was set on arrival.
    ClockSet,
    /// The mode was set, or asked for, on arrival.
    Mode { recording: bool },
    /// The clock was read on arrival.
    Time(ReadClock),
}

/// What there was to say of the clock when a question for it arrived. The reply adds nothing of its
/// own moment but the last mark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) struct ReadClock {
    pub(crate) token: u16,
    pub(crate) clock_us: i64,
    pub(crate) source: ClockSource,
    pub(crate) age_s: u32,
    /// How long the recorder had been on.
    pub(crate) tick_us: u64,
    pub(crate) life: u32,
    /// Events of this life.
    pub(crate) events: u64,
}

/// What a device on the bus asks for. The content is looked up when the reply goes out, so that it
/// is current.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Request {
    Command(Pending),
    Forces(ForceTable),
}

/// Waiting requests, by the way on which they came.
pub(crate) struct Waiting {
    line: Deque<Pending, MAX_WAITING>,
    /// With the bus address of the device that asks.
    bus: Deque<(u8, Request), MAX_WAITING>,
}

impl Waiting {
    pub(crate) const fn new() -> Waiting {
        Waiting { line: Deque::new(), bus: Deque::new() }
    }

    /// Whether another request from this way finds room. A broadcast needs none.
    pub(crate) fn has_room(&self, way: Way) -> bool {
        match way {
            Way::Line => !self.line.is_full(),
            Way::Bus(_) => !self.bus.is_full(),
            Way::Broadcast => true,
        }
    }

    /// Queues a command; false when there is no room.
    pub(crate) fn push(&mut self, way: Way, pending: Pending) -> bool {
        match way {
            Way::Line => self.line.push_back(pending).is_ok(),
            Way::Bus(device) => self.bus.push_back((device, Request::Command(pending))).is_ok(),
            Way::Broadcast => true,
        }
    }

    /// Queues a device's question for a force table; false when there is no room.
    pub(crate) fn push_forces(&mut self, device: u8, table: ForceTable) -> bool {
        self.bus.push_back((device, Request::Forces(table))).is_ok()
    }

    /// The command from the line whose turn it is.
    pub(crate) fn next_from_line(&mut self) -> Option<Pending> {
        self.line.pop_front()
    }

    /// The request from the bus whose turn it is, and the bus address of the device that asks.
    pub(crate) fn next_from_bus(&mut self) -> Option<(u8, Request)> {
        self.bus.pop_front()
    }

    /// Forgets the requests that wait for the bus; returns how many there were.
    pub(crate) fn forget_bus(&mut self) -> usize {
        let waiting = self.bus.len();
        self.bus.clear();
        waiting
    }
}
