//! The driver, and what is checked of it.

use std::cell::{RefCell, RefMut};
use std::collections::HashSet;
use std::rc::Rc;

use geni_board::{
    Configuration, ConfigurationOutcome, Counters, Driver, Event, Interrupts, Options, Start,
    Transmission, map, timing,
};

use super::ram::{Ram, Window};

/// The most accesses in one poll. The longest poll gets a lockout granted (128 bytes of global
/// data), sets flags and looks at devices.
const MAX_ACCESSES: usize = 600;

/// How a datagram that was accepted has to end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ending {
    Sent,
    Replied,
}

/// A driver under watch.
pub(super) struct Bench {
    pub(super) driver: Driver<Window>,
    /// The latest configuration that was asked for.
    pub(super) wanted: Configuration,
    pub(super) now_ms: u32,
    ram: Rc<RefCell<Ram>>,
    polls: u32,
    counted: Counters,
    on_its_way: Option<Ending>,
    /// Whether the board's latest answer refused the configuration.
    pub(super) was_refused: bool,
    /// When the driver last saw a heartbeat, and how long it may go without.
    beat_ms: u32,
    heartbeat_timeout_ms: u32,
    /// Whether pulses of the interrupt line mean datagrams.
    pub(super) has_line: bool,
    /// Ticks of looks that saw the flag of a datagram, and of pulses that mean a datagram.
    signs_ms: HashSet<u32>,
    pulsed_ms: u32,
    /// When the reset line was last seen to go up. The board must then be left alone for a while.
    released_ms: Option<u32>,
}

impl Bench {
    pub(super) fn new(options: Options, now_ms: u32, noise: &[u8]) -> Bench {
        let ram = Rc::new(RefCell::new(Ram::new(noise)));
        Bench {
            driver: Driver::new(Window(Rc::clone(&ram)), options),
            wanted: options.configuration,
            now_ms,
            ram,
            polls: 0,
            counted: Counters::default(),
            on_its_way: None,
            was_refused: false,
            beat_ms: now_ms,
            heartbeat_timeout_ms: options.heartbeat_timeout_ms,
            has_line: options.interrupts == Interrupts::RECEIVE_QUEUE,
            signs_ms: HashSet::new(),
            pulsed_ms: now_ms,
            released_ms: (options.start == Start::Released).then_some(now_ms),
        }
    }

    pub(super) fn ram(&self) -> RefMut<'_, Ram> {
        self.ram.borrow_mut()
    }

    pub(super) fn polls(&self) -> u32 {
        self.polls
    }

    /// The interrupt line was pulsed this long ago, or with the latest pulse if that was later.
    pub(super) fn pulse(&mut self, ago_ms: u32) {
        let since_latest_ms = self.now_ms.wrapping_sub(self.pulsed_ms);
        self.pulse_at(self.now_ms.wrapping_sub(ago_ms.min(since_latest_ms)));
    }

    /// The interrupt line was pulsed at this tick.
    pub(super) fn pulse_at(&mut self, tick_ms: u32) {
        self.pulsed_ms = tick_ms;
        if self.has_line {
            self.signs_ms.insert(tick_ms);
        }
        self.driver.interrupt(tick_ms);
    }

    /// Lets time pass without polling the driver.
    pub(super) fn pass(&mut self, ms: u32) {
        self.now_ms = self.now_ms.wrapping_add(ms);
    }

    /// Polls once, a millisecond later, and checks everything that must hold of a poll.
    pub(super) fn poll(&mut self) -> Option<Event> {
        self.pass(1);
        self.ram().play_puppet();
        self.poll_now()
    }

    /// Polls and checks in the present millisecond, with the RAM as it is.
    pub(super) fn poll_now(&mut self) -> Option<Event> {
        self.polls += 1;
        self.ram().accesses = 0;
        let (was_held, was_ready) = (self.driver.reset_held(), self.driver.is_ready());
        let event = self.driver.poll(self.now_ms);
        if std::mem::take(&mut self.ram().flag_seen) {
            self.signs_ms.insert(self.now_ms);
        }
        let accesses = self.ram().accesses;
        assert!(accesses <= MAX_ACCESSES, "{accesses} accesses in one poll");
        self.check_leaves_alone(was_held, accesses);
        self.check_heartbeat(was_ready);
        self.check_writes();
        self.check_counters();
        if let Some(event) = &event {
            self.check_event(event);
            self.make_use_of(event);
        }
        event
    }

    fn check_leaves_alone(&mut self, was_held: bool, accesses: usize) {
        if was_held {
            assert_eq!(accesses, 0, "the board is held in reset");
            self.released_ms = (!self.driver.reset_held()).then_some(self.now_ms);
        } else if let Some(released_ms) = self.released_ms
            && self.now_ms.wrapping_sub(released_ms) < timing::NO_ACCESS_MS
        {
            assert_eq!(accesses, 0, "the board has just been released");
        } else {
            self.released_ms = None;
        }
    }

    /// Checks how long the driver goes without a heartbeat. A board that starts up gets more time,
    /// up to the poll in which it becomes ready.
    fn check_heartbeat(&mut self, was_ready: bool) {
        if std::mem::take(&mut self.ram().beat_seen) {
            self.beat_ms = self.now_ms;
        }
        let without_ms = self.now_ms.wrapping_sub(self.beat_ms);
        let is_trusted = was_ready && self.driver.is_ready();
        assert!(
            !is_trusted || without_ms < self.heartbeat_timeout_ms,
            "{without_ms} ms without a beat"
        );
    }

    /// Checks what was written since this was last called.
    pub(super) fn check_writes(&mut self) {
        let written = std::mem::take(&mut self.ram().written);
        let buffer_len = u16::from(self.driver.configuration().buffer_len());
        for (offset, byte) in written {
            assert!(may_write(offset, byte, buffer_len), "writes {byte:02X}h at {offset:04X}h");
        }
    }

    fn check_counters(&mut self) {
        let counters = self.driver.counters();
        let mut both = counters.all().into_iter().zip(self.counted.all());
        let went_back = both.find(|((_, now), (_, before))| now < before);
        assert_eq!(went_back, None, "a counter went back");
        self.counted = counters;
    }

    fn check_event(&mut self, event: &Event) {
        let ending = match event {
            Event::Sent(_) => Some(Ending::Sent),
            Event::Replied(_) => Some(Ending::Replied),
            _ => None,
        };
        if ending.is_some() {
            assert_eq!(self.on_its_way.take(), ending, "{event:?} ends what was to be sent");
        }
        match event {
            Event::Ready(identity) => {
                assert!(self.driver.is_ready());
                assert_eq!(identity.configuration, self.driver.configuration());
            }
            Event::Configured(outcome) => {
                self.was_refused = matches!(outcome, ConfigurationOutcome::Refused(_));
            }
            Event::Failed(_) => assert!(!self.driver.is_ready()),
            Event::Device { number, .. } => assert!(*number < map::DEVICE_COUNT),
            Event::Received(received) => {
                assert!(received.source < map::DEVICE_COUNT);
                let arrived_ms = received.arrived_ms;
                let is_sign = |tick_ms| self.signs_ms.contains(tick_ms);
                assert!(
                    arrived_ms.as_ref().is_none_or(is_sign),
                    "nothing was seen at {arrived_ms:?}"
                );
            }
            _ => {}
        }
    }

    /// Acts as a host that uses whatever it is offered.
    fn make_use_of(&mut self, event: &Event) {
        let mut bytes = [0; 256];
        if *event == Event::TablesLocked {
            let mut tables = self.driver.tables().expect("they are locked");
            for number in 0..34 {
                if let Ok(len) = tables.inputs(number, &mut bytes) {
                    assert!(len <= 128);
                }
                let _ = tables.set_outputs(number, &bytes[..usize::from(number) * 4]);
            }
            let _ = tables.directed_inputs(&mut bytes);
        }
        for number in [0, 1, 31, 32, 255] {
            let _ = self.driver.input_byte(number);
            let _ = self.driver.set_output_byte(number, number);
            let _ = self.driver.enable_outputs(number, true);
        }
        self.check_writes();
    }

    pub(super) fn transmit(&mut self, transmission: Transmission) {
        let reply = matches!(transmission.completion, geni_board::Completion::Reply { .. });
        let could = self.driver.can_transmit();
        if self.driver.transmit(transmission).is_ok() {
            assert!(could && self.on_its_way.is_none(), "two datagrams at once");
            self.on_its_way = Some(if reply { Ending::Replied } else { Ending::Sent });
        }
    }

    pub(super) fn is_sending(&self) -> bool {
        self.on_its_way.is_some()
    }

    pub(super) fn set_global_data(&mut self, data: &[u8]) {
        let expected = data.len() == usize::from(self.wanted.broadcast_len());
        assert_eq!(self.driver.set_global_data(data).is_ok(), expected);
    }

    pub(super) fn configure(&mut self, configuration: Configuration) {
        self.driver.configure(configuration);
        self.wanted = configuration;
    }
}

/// Whether the byte at this offset is the host's to write, and may have this value.
fn may_write(offset: u16, byte: u8, buffer_len: u16) -> bool {
    let outputs = map::IO_TABLE.start + u16::from(map::DEVICE_COUNT) * buffer_len;
    match offset {
        map::REQUEST_HEAD => byte < map::REQUEST_COUNT,
        map::STATUS_OK => byte == 0,
        map::LOCKOUT_REQUEST => byte <= 1,
        _ if map::REQUEST_QUEUE.contains(offset) => {
            let at = offset % map::REQUEST_LEN;
            at == map::REQUEST_STATUS || at >= map::REQUEST_DATA
        }
        map::SETUP_REFERENCE..=map::SETUP_BUFFER_LEN => true,
        _ if map::INTERRUPT_STATUS.contains(offset) => {
            offset <= map::INTERRUPT_STATUS.at(7) && byte == 0
        }
        _ if map::INTERRUPT_DISABLE.contains(offset) => {
            offset <= map::INTERRUPT_DISABLE.at(7) && byte <= 1
        }
        _ if map::COMMAND_BLOCK.contains(offset) => offset <= map::REPLY_LEN,
        _ if map::TRANSMIT_BUFFER.contains(offset) => offset < map::TRANSMIT_BUFFER.start + 134,
        _ if map::DEVICE_TABLE.contains(offset) => {
            offset % map::DEVICE_LEN == map::DEVICE_OUTPUTS_DISABLED && byte <= 1
        }
        _ if map::BROADCAST_OUTPUT.contains(offset) => true,
        _ => offset >= outputs && offset < outputs + u16::from(map::DEVICE_COUNT) * buffer_len,
    }
}
