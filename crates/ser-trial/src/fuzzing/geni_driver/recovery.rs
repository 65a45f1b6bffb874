//! After the hostility: a board that works, on a bus of its own.

use std::cell::RefCell;
use std::rc::Rc;

use geni_board::{
    Completion, Configuration, Data, Destination, Event, Transmission, TransmitPriority, map,
};
use ser_sim::genius::{
    Board, BoardOptions, BoardWindow, Bus, BusTiming, Handle, Violation, ViolationKind, tick_ms,
};

use super::bench::Bench;
use super::ram::BoardHolder;

/// The bus address of the driver's board.
const DRIVER: u8 = 5;

/// The period of a slow main loop.
const PACE_MS: u32 = 10;

/// The longest pause between two attempts to start a board, plus all that a board may take before
/// it counts as failed, plus one start.
const LIMIT_MS: u32 = 150_000;

/// How long the driver may keep waiting for something from before the change.
const SETTLED_MS: u32 = 5_500;

/// The bus address of a device that sends datagrams without a driver.
const SENDER: u8 = 9;

/// How soon a datagram has been sent and read.
const DATAGRAM_MS: u32 = 5_000;

/// Where the setup table, the interrupts that are not wanted, and this host's global data are.
const SETUP_TABLE: usize = 0x0882;
const INTERRUPT_DISABLE: usize = 0x08B2;
const BROADCAST_OUTPUT: usize = 0x1F80;

struct Recovery {
    bench: Bench,
    bus: Rc<RefCell<Bus>>,
    board: Handle<Board>,
    sender: Handle<Board>,
    window: BoardWindow,
    /// The driver's millisecond in which the bus began.
    began_ms: u32,
}

/// Checks that the driver brings a board onto the bus. The board now takes the place of the hostile
/// RAM. It has just been switched on or, if it is `warm`, has been running for a while.
pub(super) fn assert_recovers(bench: Bench, warm: bool) {
    let mut recovery = Recovery::begin(bench, warm);
    recovery.settle();
    let violations = recovery.violations();
    recovery.assert_configured();
    recovery.assert_sends();
    recovery.assert_global_data();
    recovery.assert_knows_arrivals();
    recovery.assert_lawful(violations);
}

impl Recovery {
    fn begin(bench: Bench, warm: bool) -> Recovery {
        // The slowest bus has the fewest scans to simulate.
        let rate = BusTiming::K38;
        let bus = Rc::new(RefCell::new(Bus::new(rate)));
        let board = bus.borrow_mut().connect(Board::new(BoardOptions::at(DRIVER).rate(rate)));
        let sender = bus.borrow_mut().connect(Board::powered(BoardOptions::at(SENDER).rate(rate)));
        let window = BoardWindow::new(Rc::clone(&bus), board);
        window.drive_reset(bench.driver.reset_held());
        if warm {
            bus.borrow_mut().advance_by(5_000_000);
        }
        bench.ram().board = Some(BoardHolder(window.clone()));
        let lived_ms = if warm { 5_000 } else { 0 };
        let began_ms = bench.now_ms.wrapping_sub(lived_ms);
        // Pulses from before the driver was there.
        let _ = window.take_interrupts();
        Recovery { bench, bus, board, sender, window, began_ms }
    }

    fn step(&mut self) -> Option<Event> {
        self.bench.pass(PACE_MS);
        if std::mem::take(&mut self.bench.was_refused) {
            // The driver leaves it to its host to try again.
            self.bench.configure(self.bench.wanted);
        }
        self.bus.borrow_mut().advance_by(u64::from(PACE_MS) * 1000);
        for at_us in self.window.take_interrupts() {
            let tick_ms = self.tick_ms(at_us);
            self.bench.pulse_at(tick_ms);
        }
        let event = self.bench.poll_now();
        self.window.drive_reset(self.bench.driver.reset_held());
        event
    }

    /// The driver's tick in this microsecond of the bus.
    #[expect(clippy::cast_possible_truncation, reason = "the tick wraps")]
    fn tick_ms(&self, bus_us: u64) -> u32 {
        self.began_ms.wrapping_add(tick_ms(bus_us) as u32)
    }

    /// Waits until the driver has been on the bus for a while, and what it still had to send is
    /// done.
    fn settle(&mut self) {
        let (mut waited_ms, mut settled_ms) = (0, 0);
        while settled_ms < SETTLED_MS {
            let failed = matches!(self.step(), Some(Event::Failed(_)));
            let on_bus = self.bench.driver.status().is_some_and(|status| status.on_bus());
            let ready = !failed && self.bench.driver.can_transmit() && on_bus;
            settled_ms = if ready { settled_ms + PACE_MS } else { 0 };
            waited_ms += PACE_MS;
            assert!(waited_ms < LIMIT_MS, "not on the bus again: {:?}", self.bench.driver);
        }
    }

    fn ram(&self, start: usize, len: usize) -> Vec<u8> {
        self.bus.borrow().get(self.board).ram()[start..start + len].to_vec()
    }

    fn violations(&self) -> usize {
        self.bus.borrow().get(self.board).violations().len()
    }

    /// Checks the rules. What the driver believes of the board that was there before may mislead it
    /// at first, but not into requests that this board has never had.
    fn assert_lawful(&self, violations_before: usize) {
        let bus = self.bus.borrow();
        let violations = bus.get(self.board).violations();
        assert_eq!(violations.len(), violations_before, "{violations:?}");
        let of_requests = |violation: &Violation| violation.kind == ViolationKind::RequestQueue;
        assert!(!violations.iter().any(of_requests), "{violations:?}");
    }

    fn assert_configured(&self) {
        let wanted: Configuration = self.bench.wanted;
        assert_eq!(self.bench.driver.configuration(), wanted);
        let [low, high] = wanted.reference().to_le_bytes();
        let table = [low, high, wanted.broadcast_len(), wanted.directed_len(), wanted.buffer_len()];
        assert_eq!(self.ram(SETUP_TABLE + 1, table.len()), table);
        assert!(self.bus.borrow().get(self.board).is_on_bus());
    }

    fn assert_sends(&mut self) {
        let transmission = Transmission {
            destination: Destination::Device(9),
            function: 0x40,
            subfunction: 0x50,
            priority: TransmitPriority::Normal,
            completion: Completion::Taken,
            data: Data::from_slice(b"L").expect("one byte fits"),
        };
        assert!(self.bench.driver.can_transmit());
        self.bench.transmit(transmission);
        assert!(self.bench.is_sending());
        let sent =
            (0..1_000).find_map(|_| self.step().filter(|event| matches!(event, Event::Sent(_))));
        assert_eq!(sent, Some(Event::Sent(Ok(()))));
    }

    /// Whether the board pulls its line for datagrams and nothing else. A board that has taken the
    /// place of another unseen was not told to, so its pulses may mean anything.
    fn pulls_for_datagrams(&self) -> bool {
        self.ram(INTERRUPT_DISABLE, 8) == [0, 1, 1, 1, 1, 1, 0, 1]
    }

    /// Checks arrival times. With the interrupt line, a datagram arrived in the millisecond of its
    /// pulse, as the board itself says. Without it, it arrived at the next look at its flag.
    fn assert_knows_arrivals(&mut self) {
        if self.bench.has_line && !self.pulls_for_datagrams() {
            return;
        }
        for number in 1..=3 {
            self.send_from_elsewhere(number);
            let arrived_ms = (0..DATAGRAM_MS / PACE_MS)
                .find_map(|_| match self.step() {
                    Some(Event::Received(received)) if received.source == SENDER => {
                        assert_eq!(*received.data, [number]);
                        Some(received.arrived_ms)
                    }
                    _ => None,
                })
                .expect("the datagram is handed out");
            let read = self.bus.borrow().get(self.board).latest_read().expect("it has been read");
            let pulsed_ms = self.tick_ms(read.arrived_us);
            let expected_ms = if self.bench.has_line {
                pulsed_ms
            } else {
                // Looks come at multiples of the pace, and after the arrival.
                let paced_ms = self.bench.now_ms.wrapping_sub(pulsed_ms) % PACE_MS;
                let at_once = paced_ms == 0 && read.arrived_us.is_multiple_of(1000);
                pulsed_ms.wrapping_add(if paced_ms == 0 && !at_once { PACE_MS } else { paced_ms })
            };
            assert_eq!(arrived_ms, Some(expected_ms));
        }
    }

    /// Another device sends a datagram of one byte.
    fn send_from_elsewhere(&mut self, number: u8) {
        let mut bus = self.bus.borrow_mut();
        let sender = bus.get_mut(self.sender);
        sender.host_write_from(map::TRANSMIT_BUFFER.start, &[number]);
        let header = [DRIVER, 0x40, 0x50, 0, 1];
        sender.host_write_from(map::TRANSMIT_DESTINATION, &header);
        sender.host_write(map::COMMAND_CODE, 2);
        sender.host_write(map::COMMAND_STATUS, 1);
    }

    fn assert_global_data(&mut self) {
        let data = vec![0xA5; self.bench.wanted.broadcast_len().into()];
        self.bench.set_global_data(&data);
        (0..100).for_each(|_| drop(self.step()));
        assert_eq!(self.ram(BROADCAST_OUTPUT, data.len()), data);
    }
}
