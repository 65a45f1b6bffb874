//! A Genius bus in virtual time: whose turn it is, how long it takes, and who hears what.

use std::any::Any;
use std::collections::BTreeMap;
use std::marker::PhantomData;

use super::device::{Device, Message};
use super::device_id::DeviceId;
use super::faults::{Accidents, Fault, Noise};
use super::scan_time::{BusTiming, MIN_SCAN_NS};

/// How many bus addresses there are: 0 to 31.
pub const ADDRESSES: u8 = 32;

/// A device on a bus whose type is known.
pub struct Handle<T> {
    id: DeviceId,
    device: PhantomData<fn() -> T>,
}

impl<T> Handle<T> {
    /// The device, whatever its type.
    #[must_use]
    pub fn id(self) -> DeviceId {
        self.id
    }
}

impl<T> Clone for Handle<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Handle<T> {}

/// What has happened on a bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Scans completed.
    pub scans: u64,
    /// Turns taken.
    pub turns: u64,
    /// Datagrams and other messages besides control data.
    pub background: u64,
    /// Messages that nobody could read, apart from collisions.
    pub damaged: u64,
    /// Messages that a receiver could not read.
    pub lost: u64,
    /// Turns that several devices took at once.
    pub collisions: u64,
}

/// A bus and what is connected to it.
///
/// A *bus scan* here is the token's way from the lowest bus address round to the lowest again. A
/// scan has room for one datagram of normal priority, so devices with low addresses have the first
/// chance.
pub struct Bus {
    rate: BusTiming,
    now_us: u64,
    connected: Vec<Connected>,
    token: Token,
    scan_started_ns: u64,
    scan_ns: Option<u64>,
    background_free: bool,
    accidents: Accidents,
    scheduled: BTreeMap<u64, Vec<Fault>>,
    traffic: Traffic,
}

struct Connected {
    device: Box<dyn Device>,
    disconnected_until_us: u64,
    deaf_for: u32,
}

enum Token {
    /// Nobody is on the bus.
    Idle,
    /// The turn of this bus address, or of the next one in use, begins.
    Next { address: u8, at_ns: u64 },
    /// A turn is being taken, by several devices when their bus addresses are the same.
    Taken { address: u8, talkers: Vec<usize>, messages: Vec<Message>, until_ns: u64 },
}

impl Bus {
    /// A bus without devices, at time zero, on which nothing goes wrong by itself.
    #[must_use]
    pub fn new(rate: BusTiming) -> Bus {
        Bus::with_noise(rate, Noise::default())
    }

    /// A bus on which messages suffer.
    #[must_use]
    pub fn with_noise(rate: BusTiming, noise: Noise) -> Bus {
        Bus {
            rate,
            now_us: 0,
            connected: Vec::new(),
            token: Token::Idle,
            scan_started_ns: 0,
            scan_ns: None,
            background_free: true,
            accidents: Accidents::new(noise),
            scheduled: BTreeMap::new(),
            traffic: Traffic::default(),
        }
    }

    /// Connects a device.
    pub fn connect<T: Device>(&mut self, mut device: T) -> Handle<T> {
        device.connect(self.now_us);
        let id = DeviceId(self.connected.len());
        self.connected.push(Connected {
            device: Box::new(device),
            disconnected_until_us: 0,
            deaf_for: 0,
        });
        self.wake();
        Handle { id, device: PhantomData }
    }

    /// A device.
    ///
    /// # Panics
    /// When the handle is from another bus.
    #[must_use]
    pub fn get<T: Device>(&self, handle: Handle<T>) -> &T {
        let device: &dyn Any = &*self.connected[handle.id.0].device;
        device.downcast_ref().expect("the handle came from this bus")
    }

    /// A device, to do something to it. The consequences come when time passes.
    ///
    /// # Panics
    /// When the handle is from another bus.
    pub fn get_mut<T: Device>(&mut self, handle: Handle<T>) -> &mut T {
        let device: &mut dyn Any = &mut *self.connected[handle.id.0].device;
        device.downcast_mut().expect("the handle came from this bus")
    }

    /// The time, in microseconds.
    #[must_use]
    pub fn now_us(&self) -> u64 {
        self.now_us
    }

    /// How long the latest complete scan took.
    #[must_use]
    pub fn scan_time_ns(&self) -> Option<u64> {
        self.scan_ns
    }

    /// What has happened so far.
    #[must_use]
    pub fn traffic(&self) -> Traffic {
        self.traffic
    }

    /// Lets something go wrong now.
    pub fn inject(&mut self, fault: Fault) {
        match fault {
            Fault::Damage { messages } => self.accidents.damage(messages),
            Fault::Deafen { device, messages } => {
                if let Some(connected) = self.connected.get_mut(device.0) {
                    connected.deaf_for += messages;
                }
            }
            Fault::Disconnect { device, for_us } => {
                let until_us = self.now_us + for_us;
                if let Some(connected) = self.connected.get_mut(device.0) {
                    connected.disconnected_until_us = connected.disconnected_until_us.max(until_us);
                }
            }
            Fault::Inside { device, fault } => {
                let now_us = self.now_us;
                if let Some(connected) = self.connected.get_mut(device.0) {
                    connected.device.suffer(now_us, fault);
                }
            }
        }
        self.wake();
    }

    /// Lets something go wrong at a time to come.
    pub fn schedule(&mut self, at_us: u64, fault: Fault) {
        self.scheduled.entry(at_us.max(self.now_us)).or_default().push(fault);
    }

    /// When something happens next, if nobody interferes.
    #[must_use]
    pub fn next_due_us(&self) -> Option<u64> {
        let devices = self.connected.iter().filter_map(|connected| connected.device.next_due_us());
        let reconnected = self
            .connected
            .iter()
            .map(|connected| connected.disconnected_until_us)
            .filter(|&until_us| until_us > self.now_us);
        let due_us = devices
            .chain(reconnected)
            .chain(self.token_due_us())
            .chain(self.scheduled.first_key_value().map(|(&at_us, _)| at_us))
            .min()?;
        Some(due_us.max(self.now_us))
    }

    /// Lets time pass. A time in the past changes nothing.
    pub fn advance_to(&mut self, us: u64) {
        while let Some(due_us) = self.next_due_us().filter(|&due_us| due_us <= us) {
            self.pass(due_us);
        }
        if us > self.now_us {
            self.pass(us);
        }
    }

    /// Lets this much time pass.
    pub fn advance_by(&mut self, us: u64) {
        self.advance_to(self.now_us.saturating_add(us));
    }

    /// Lets time pass, event by event, until the condition holds. Returns whether it did within
    /// `limit_us`.
    pub fn advance_until(
        &mut self,
        limit_us: u64,
        mut condition: impl FnMut(&Bus) -> bool,
    ) -> bool {
        let end_us = self.now_us.saturating_add(limit_us);
        loop {
            if condition(self) {
                return true;
            }
            match self.next_due_us().filter(|&due_us| due_us <= end_us) {
                Some(due_us) => self.pass(due_us),
                None if self.now_us < end_us => self.pass(end_us),
                None => return false,
            }
        }
    }

    /// Does everything that is due at `now_us`.
    fn pass(&mut self, now_us: u64) {
        self.now_us = now_us;
        while let Some(entry) = self.scheduled.first_entry().filter(|entry| *entry.key() <= now_us)
        {
            for fault in entry.remove() {
                self.inject(fault);
            }
        }
        for connected in &mut self.connected {
            connected.device.advance_to(now_us);
        }
        self.wake();
        if self.token_due_us().is_some_and(|due_us| due_us <= now_us) {
            self.move_token();
        }
    }

    fn token_due_us(&self) -> Option<u64> {
        match self.token {
            Token::Idle => None,
            Token::Next { at_ns, .. } => Some(at_ns.div_ceil(1000)),
            Token::Taken { until_ns, .. } => Some(until_ns.div_ceil(1000)),
        }
    }

    /// The first device on an idle bus begins.
    fn wake(&mut self) {
        if matches!(self.token, Token::Idle) && self.first_in_use(0).is_some() {
            self.scan_started_ns = self.now_us * 1000;
            self.background_free = true;
            self.token = Token::Next { address: 0, at_ns: self.scan_started_ns };
        }
    }

    fn move_token(&mut self) {
        match std::mem::replace(&mut self.token, Token::Idle) {
            Token::Idle => {}
            Token::Next { address, at_ns } => match self.first_in_use(address) {
                Some(next) if next == address => self.begin_turn(address, at_ns),
                Some(next) => {
                    let skipped_ns = u64::from(next - address) * self.rate.skip_ns();
                    self.token = Token::Next { address: next, at_ns: at_ns + skipped_ns };
                }
                None => self.end_scan(at_ns + u64::from(ADDRESSES - address) * self.rate.skip_ns()),
            },
            Token::Taken { address, talkers, messages, until_ns } => {
                self.end_turn(&talkers, &messages);
                if address + 1 < ADDRESSES {
                    self.token = Token::Next { address: address + 1, at_ns: until_ns };
                } else {
                    self.end_scan(until_ns);
                }
            }
        }
    }

    fn end_scan(&mut self, at_ns: u64) {
        self.background_free = true;
        if self.first_in_use(0).is_none() {
            self.scan_ns = None;
            self.token = Token::Idle;
            return;
        }
        let begin_ns = at_ns.max(self.scan_started_ns + MIN_SCAN_NS);
        self.scan_ns = Some(begin_ns - self.scan_started_ns);
        self.scan_started_ns = begin_ns;
        self.traffic.scans += 1;
        self.token = Token::Next { address: 0, at_ns: begin_ns };
    }

    fn begin_turn(&mut self, address: u8, at_ns: u64) {
        let talkers: Vec<usize> = (0..self.connected.len())
            .filter(|&index| self.address_of(index) == Some(address))
            .collect();
        let (now_us, background_free) = (self.now_us, self.background_free);
        let mut messages = Vec::new();
        let mut duration_ns = 0;
        for &index in &talkers {
            let said = self.connected[index].device.take_turn(now_us, background_free);
            let said_ns: u64 = said.iter().map(|message| message.duration_ns(self.rate)).sum();
            duration_ns = duration_ns.max(said_ns);
            messages = said;
        }
        let background = messages.iter().filter(|message| message.is_background()).count();
        self.traffic.turns += 1;
        self.traffic.background += background as u64;
        self.background_free &= background == 0;
        let until_ns = at_ns + self.rate.fixed_ns() + duration_ns;
        self.token = Token::Taken { address, talkers, messages, until_ns };
    }

    fn end_turn(&mut self, talkers: &[usize], messages: &[Message]) {
        let now_us = self.now_us;
        let &[talker] = talkers else {
            self.traffic.collisions += 1;
            for (index, connected) in self.connected.iter_mut().enumerate() {
                if talkers.contains(&index) {
                    connected.device.collide(now_us);
                } else if connected.disconnected_until_us <= now_us {
                    connected.device.count_bus_error(now_us);
                }
            }
            return;
        };
        // A device that was cut off, or stopped, in the middle of its turn has said nothing that
        // anyone can read.
        let address = self.address_of(talker);
        let arrived: Vec<bool> = messages
            .iter()
            .map(|message| {
                let damaged = self.accidents.damaged();
                self.traffic.damaged += u64::from(damaged);
                self.deliver(talker, address.filter(|_| !damaged), message)
            })
            .collect();
        self.connected[talker].device.end_turn(now_us, messages, &arrived);
    }

    /// Lets everyone except the talker hear a message. A message from no address is damaged.
    fn deliver(&mut self, talker: usize, from: Option<u8>, message: &Message) -> bool {
        let mut acknowledged = message.to().is_none();
        for index in 0..self.connected.len() {
            if index == talker || self.connected[index].disconnected_until_us > self.now_us {
                continue;
            }
            let lost = self.accidents.lost();
            let connected = &mut self.connected[index];
            let deaf = connected.deaf_for > 0;
            connected.deaf_for -= u32::from(deaf);
            let other_rate = connected.device.rate() != self.rate;
            let Some(from) = from.filter(|_| !lost && !deaf && !other_rate) else {
                self.traffic.lost += u64::from(from.is_some());
                connected.device.count_bus_error(self.now_us);
                continue;
            };
            if connected.device.receive(self.now_us, from, message)
                && message.to().is_some_and(|to| connected.device.address() == Some(to))
            {
                acknowledged = !self.accidents.unacknowledged();
            }
        }
        acknowledged && from.is_some()
    }

    fn first_in_use(&self, from: u8) -> Option<u8> {
        (0..self.connected.len())
            .filter_map(|index| self.address_of(index))
            .filter(|&address| address >= from)
            .min()
    }

    /// The bus address on which a device takes turns; `None` when it cannot be heard.
    fn address_of(&self, index: usize) -> Option<u8> {
        let connected = &self.connected[index];
        let heard =
            connected.disconnected_until_us <= self.now_us && connected.device.rate() == self.rate;
        connected.device.address().filter(|&address| heard && address < ADDRESSES)
    }
}
