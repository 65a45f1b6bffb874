//! A recorder as a board starts it: what it finds of the previous run, and what it assumes.

#[allow(dead_code, reason = "no power is cut here")]
mod flash;

use chrono::{NaiveDate, NaiveDateTime, NaiveTime};
use flash::Flash;
use rtcc::DateTimeAccess;
use ser_board::clock_chip::{ClockHealth, ClockState, KeepsTime};
use ser_board::flash_log::FlashHealth;
use ser_board::health::Health;
use ser_board::inputs::InputHealth;
use ser_board::start::{BoardNode, BoardParts, Memory, NOT_BEFORE, start};
use ser_node::Debounce;
use ser_proto::{Command, Configuration, Configure, FrameEncoder, MAX_SIZE, Model};

type BoardFlash = Flash<1024, 4>;

/// A clock that shows midnight of a day.
struct Clock(NaiveDate);

impl DateTimeAccess for Clock {
    type Error = ();

    fn datetime(&mut self) -> Result<NaiveDateTime, ()> {
        Ok(self.0.and_time(NaiveTime::MIN))
    }

    fn set_datetime(&mut self, datetime: &NaiveDateTime) -> Result<(), ()> {
        self.0 = datetime.date();
        Ok(())
    }
}

impl KeepsTime for Clock {
    const RESOLUTION_MS: u16 = 1;

    fn has_lost_time(&mut self) -> Result<bool, ()> {
        Ok(false)
    }

    fn time_is_good(&mut self) -> Result<(), ()> {
        Ok(())
    }
}

#[derive(Default)]
struct Parts {
    inputs: InputHealth,
    clock: ClockHealth,
    storage: FlashHealth,
}

impl Parts {
    fn health(&self) -> Health<'_> {
        Health {
            inputs: &self.inputs,
            serialisers: None,
            clock: &self.clock,
            storage: &self.storage,
        }
    }
}

/// Runs a recorder whose clock shows midnight of `day`.
fn run(
    flash: &BoardFlash,
    day: NaiveDate,
    then: impl FnOnce(&mut ser_node::Capture<'_>, &mut BoardNode<'_, BoardFlash, Clock>),
) -> ClockState {
    let (mut memory, parts) = (Box::new(Memory::new()), Parts::default());
    let board = BoardParts {
        model: Model::Ser320,
        debounce: Debounce::OFF,
        flash: flash.clone(),
        clock: Clock(day),
        id: None,
    };
    let (mut capture, node) = start(&mut memory, board, &parts.health());
    then(&mut capture, node);
    parts.clock.state()
}

fn configure(node: &mut BoardNode<'_, BoardFlash, Clock>, size: u16) {
    let configure = Configure::from(Configuration { size, ..Configuration::default() });
    for byte in FrameEncoder::new(Command::Configure(configure).to_body()) {
        node.serial_receive(byte, 0);
    }
    while node.serial_transmit().is_some() {}
}

#[test]
fn a_recorder_starts_with_the_configuration_of_the_run_before() {
    let flash = BoardFlash::new(2);
    run(&flash, NOT_BEFORE, |_, node| {
        configure(node, 17);
    });
    run(&flash, NOT_BEFORE, |capture, node| {
        for tick_ms in 1..=19 {
            capture.sample(tick_ms, tick_ms);
        }
        node.poll(19);
        let report = node.read(1, 1);
        assert_eq!((node.events(), report.total, report.next_slot), (18, 18, 1), "a ring of 17");
    });
}

#[test]
fn the_log_has_room_for_the_largest_size() {
    run(&BoardFlash::new(2), NOT_BEFORE, |capture, node| {
        configure(node, MAX_SIZE);
        for tick_ms in 1..=u32::from(MAX_SIZE) + 1 {
            capture.sample(tick_ms, tick_ms % 2);
            node.poll(tick_ms);
        }
        assert_eq!(
            (node.events(), node.diagnostics().parameters_refused),
            (u32::from(MAX_SIZE), 0)
        );
        assert_eq!(node.read(MAX_SIZE, 1).entries.len(), 1);
    });
}

#[test]
fn a_clock_that_shows_a_day_before_there_was_a_recorder_is_not_believed() {
    let flash = BoardFlash::new(2);
    let states =
        [NOT_BEFORE.pred_opt().unwrap(), NOT_BEFORE].map(|day| run(&flash, day, |_, _| {}));
    assert_eq!(states, [ClockState::Implausible, ClockState::Good]);
}

#[test]
fn debounce_and_model_are_the_boards() {
    let (mut memory, parts) = (Box::new(Memory::new()), Parts::default());
    let board = BoardParts {
        model: Model::Ser160,
        debounce: Debounce::uniform(3),
        flash: BoardFlash::new(2),
        clock: Clock(NOT_BEFORE),
        id: None,
    };
    let (mut capture, node) = start(&mut memory, board, &parts.health());
    capture.sample(1, 0);
    for tick_ms in 2..=4 {
        capture.sample(tick_ms, 0x0001_0001);
        node.poll(tick_ms);
    }
    assert_eq!(node.events(), 0, "it may still bounce");
    for tick_ms in 5..=9 {
        capture.sample(tick_ms, 0x0001_0001);
        node.poll(tick_ms);
    }
    assert_eq!(node.events(), 1);
    let [entry] = &node.read(1, 1).entries[..] else { panic!("one event") };
    assert_eq!(entry.changed.0, 0x0000_0001, "a SER160 has 16 inputs");
}
