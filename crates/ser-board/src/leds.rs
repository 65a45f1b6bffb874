//! What the four lamps on a recorder mean, and the pins behind them.
//!
//! | lamp          | slow blink (1 Hz)     | fast blink (5 Hz)             | steady         | dark            |
//! |---------------|-----------------------|-------------------------------|----------------|-----------------|
//! | run           | recording             | recording is switched off     | stands still   | stands still    |
//! | event         | –                     | one event after the other     | –              | nothing changes |
//! | communication | –                     | one message after the other   | –              | nobody asks     |
//! | fault         | something was lost    | reset by a fault, first 10 s  | broken now     | all is well     |
//!
//! A single event or message lights its lamp for 100 ms. The main loop makes the run lamp blink, so
//! a lamp that has stopped means a main loop that has stopped. The fault lamp shows the worst of
//! several faults: broken, then reset, then lost.

use embedded_hal::digital::{OutputPin, PinState};
use geni_board::SharedRam;
use ser_node::{Diagnostics, Node, Rtc, Storage};

use crate::genius::{GeniBoard, Genius};

/// How long a lamp is lit for one event, and then dark before the next event lights it again, in
/// milliseconds.
pub const PULSE_MS: u32 = 100;

/// Half a period of the slow blink, in milliseconds.
pub const SLOW_MS: u32 = 500;

/// Half a period of the fast blink, in milliseconds.
pub const FAST_MS: u32 = 100;

/// How long a reset by a fault is shown, in milliseconds.
pub const SHOW_RESET_MS: u32 = 10_000;

/// What the lamps show. Counts may wrap: they only need to differ when something has happened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Condition {
    /// Whether events are being recorded.
    pub recording: bool,
    /// Events recorded so far.
    pub events: u32,
    /// Messages received or sent so far, on any port.
    pub messages: u32,
    /// Something is broken now: see [`Health::is_broken`](crate::health::Health::is_broken), and
    /// what else the board knows.
    pub broken: bool,
    /// The previous run ended in a fault (panic, hard fault, stack overflow, watchdog).
    pub reset_by_fault: bool,
    /// Something that belonged in the log, or to a host, has been lost since power-up.
    pub lost: bool,
}

impl Condition {
    /// The condition that a recorder's lamps show. `line_bytes` counts bytes in both directions on
    /// RS-232. The board supplies whether anything is broken and how the previous run ended.
    pub fn of<S: Storage, R: Rtc, W: SharedRam, B: GeniBoard>(
        node: &Node<'_, S, R>,
        line_bytes: u32,
        genius: Option<&Genius<W, B>>,
        broken: bool,
        reset_by_fault: bool,
    ) -> Condition {
        let reports = genius.map_or(0, |genius| genius.diagnostics().reports_sent);
        Condition {
            recording: node.is_recording(),
            events: node.events(),
            messages: line_bytes.wrapping_add(node.commands()).wrapping_add(reports),
            broken,
            reset_by_fault,
            lost: has_lost(&node.diagnostics()),
        }
    }
}

/// Whether the counters report a loss of the user's data, or wrong stamps.
///
/// Garbled frames and refused commands are the other side's mistakes, not faults of the recorder.
#[must_use]
pub const fn has_lost(diagnostics: &Diagnostics) -> bool {
    let Diagnostics {
        edges_lost,
        samples_missed,
        settings_late,
        events_unreported,
        events_unprinted,
        storage_errors,
        // Without `..`, so that the compiler asks about every new counter here.
        frames_interrupted: _,
        frames_not_hex: _,
        frames_checksum: _,
        frames_too_long: _,
        frames_empty: _,
        line_errors: _,
        commands_unknown: _,
        commands_wrong_length: _,
        parameters_refused: _,
        commands_overrun: _,
    } = diagnostics;
    *edges_lost != 0
        || *samples_missed != 0
        || *settings_late != 0
        || *events_unreported != 0
        || *events_unprinted != 0
        || *storage_errors != 0
}

/// Which lamps are lit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Lamps {
    /// The recorder is at work.
    pub run: bool,
    /// An input has changed.
    pub event: bool,
    /// A host communicates with it.
    pub communication: bool,
    /// Something is wrong.
    pub fault: bool,
}

/// Lights a lamp whenever a count moves, and lets it flicker while it keeps moving.
#[derive(Clone, Copy, Debug, Default)]
struct Pulse {
    shown: u32,
    /// When the latest pulse began.
    began_ms: Option<u32>,
}

impl Pulse {
    fn lit(&mut self, now_ms: u32, count: u32) -> bool {
        if let Some(began_ms) = self.began_ms
            && now_ms.wrapping_sub(began_ms) < 2 * PULSE_MS
        {
            return now_ms.wrapping_sub(began_ms) < PULSE_MS;
        }
        let moved = count != self.shown;
        self.shown = count;
        self.began_ms = moved.then_some(now_ms);
        moved
    }
}

/// Decides which lamps are lit.
#[derive(Clone, Copy, Debug, Default)]
pub struct Leds {
    event: Pulse,
    communication: Pulse,
    /// The first tick seen, and whether the time for showing a reset is over. The tick wraps, and
    /// the lamp must not come back then.
    started_ms: Option<u32>,
    reset_shown: bool,
}

impl Leds {
    /// Nothing has been shown yet.
    #[must_use]
    pub const fn new() -> Leds {
        const DARK: Pulse = Pulse { shown: 0, began_ms: None };
        Leds { event: DARK, communication: DARK, started_ms: None, reset_shown: false }
    }

    /// The lamps that are lit at `now_ms`, a tick that may wrap. Called in every pass of the main
    /// loop.
    pub fn lamps(&mut self, now_ms: u32, condition: &Condition) -> Lamps {
        let started_ms = *self.started_ms.get_or_insert(now_ms);
        self.reset_shown |= now_ms.wrapping_sub(started_ms) >= SHOW_RESET_MS;
        Lamps {
            run: blink(now_ms, if condition.recording { SLOW_MS } else { FAST_MS }),
            event: self.event.lit(now_ms, condition.events),
            communication: self.communication.lit(now_ms, condition.messages),
            fault: self.fault(now_ms, condition),
        }
    }

    fn fault(&self, now_ms: u32, condition: &Condition) -> bool {
        if condition.broken {
            true
        } else if condition.reset_by_fault && !self.reset_shown {
            blink(now_ms, FAST_MS)
        } else {
            condition.lost && blink(now_ms, SLOW_MS)
        }
    }
}

const fn blink(now_ms: u32, half_period_ms: u32) -> bool {
    (now_ms / half_period_ms).is_multiple_of(2)
}

/// The pins of the lamps. `LIT` is the level that lights them.
pub struct Panel<P> {
    run: P,
    event: P,
    communication: P,
    fault: P,
    lit: PinState,
    shown: Option<Lamps>,
}

impl<P: OutputPin> Panel<P> {
    /// Lamps on these pins, lit by the level `lit`.
    pub const fn new(run: P, event: P, communication: P, fault: P, lit: PinState) -> Panel<P> {
        Panel { run, event, communication, fault, lit, shown: None }
    }

    /// Lights the lamps. Pins are touched only when something changes.
    ///
    /// # Errors
    /// When a pin cannot be set. The next call tries again.
    pub fn show(&mut self, lamps: Lamps) -> Result<(), P::Error> {
        if self.shown == Some(lamps) {
            return Ok(());
        }
        self.shown = None;
        let (lit, dark) = (self.lit, !self.lit);
        let level = |on| if on { lit } else { dark };
        self.run.set_state(level(lamps.run))?;
        self.event.set_state(level(lamps.event))?;
        self.communication.set_state(level(lamps.communication))?;
        self.fault.set_state(level(lamps.fault))?;
        self.shown = Some(lamps);
        Ok(())
    }

    /// Gives the pins back: run, event, communication, fault.
    pub fn release(self) -> [P; 4] {
        [self.run, self.event, self.communication, self.fault]
    }
}

#[cfg(test)]
mod tests {
    use std::io::ErrorKind;

    use embedded_hal_mock::eh1::MockError;
    use embedded_hal_mock::eh1::digital::{Mock, State, Transaction};

    use super::*;

    const RECORDING: Condition = Condition {
        recording: true,
        events: 0,
        messages: 0,
        broken: false,
        reset_by_fault: false,
        lost: false,
    };

    /// When a lamp goes on and off in the first `until_ms`.
    fn edges(
        until_ms: u32,
        mut condition: impl FnMut(u32) -> Condition,
        lamp: fn(&Lamps) -> bool,
    ) -> Vec<(u32, bool)> {
        let mut leds = Leds::new();
        let mut edges = Vec::new();
        let mut before = false;
        for now_ms in 0..until_ms {
            let lit = lamp(&leds.lamps(now_ms, &condition(now_ms)));
            if lit != before {
                edges.push((now_ms, lit));
                before = lit;
            }
        }
        edges
    }

    #[test]
    fn the_run_lamp_blinks_slowly_while_recording_and_fast_while_not() {
        let run = |lamps: &Lamps| lamps.run;
        assert_eq!(edges(1400, |_| RECORDING, run), [(0, true), (500, false), (1000, true)]);
        let stopped = Condition { recording: false, ..RECORDING };
        assert_eq!(
            edges(350, |_| stopped, run),
            [(0, true), (100, false), (200, true), (300, false)]
        );
    }

    #[test]
    fn one_event_is_a_pulse_and_many_are_a_flicker() {
        let event = |lamps: &Lamps| lamps.event;
        let once = |now_ms| Condition { events: u32::from(now_ms >= 50), ..RECORDING };
        assert_eq!(edges(1000, once, event), [(50, true), (150, false)]);
        let always = |now_ms| Condition { events: now_ms, ..RECORDING };
        assert_eq!(
            edges(450, always, event),
            [(1, true), (101, false), (201, true), (301, false), (401, true)]
        );
    }

    #[test]
    fn an_event_that_comes_while_the_lamp_is_between_pulses_is_not_forgotten() {
        let two = |now_ms| Condition {
            events: u32::from(now_ms >= 10) + u32::from(now_ms >= 150),
            ..RECORDING
        };
        let expected = [(10, true), (110, false), (210, true), (310, false)];
        assert_eq!(edges(1000, two, |lamps| lamps.event), expected);
        let messages = |now_ms| Condition { messages: two(now_ms).events, ..RECORDING };
        assert_eq!(edges(1000, messages, |lamps| lamps.communication), expected);
    }

    #[test]
    fn the_fault_lamp_shows_the_worst() {
        let fault = |lamps: &Lamps| lamps.fault;
        assert_eq!(edges(20_000, |_| RECORDING, fault), []);
        let lost = Condition { lost: true, ..RECORDING };
        assert_eq!(edges(1400, |_| lost, fault), [(0, true), (500, false), (1000, true)]);
        let broken = Condition { broken: true, reset_by_fault: true, ..lost };
        assert_eq!(edges(20_000, |_| broken, fault), [(0, true)]);
        let reset = Condition { reset_by_fault: true, ..RECORDING };
        let edges_of_reset = edges(30_000, |_| reset, fault);
        assert_eq!(edges_of_reset.len(), 100);
        assert_eq!(edges_of_reset.last(), Some(&(9900, false)));
    }

    #[test]
    fn a_reset_is_not_shown_again_when_the_tick_wraps() {
        let mut leds = Leds::new();
        let reset = Condition { reset_by_fault: true, ..RECORDING };
        assert!(leds.lamps(0, &reset).fault);
        for now_ms in [20_000, u32::MAX, 0, 200, 400] {
            assert!(!leds.lamps(now_ms, &reset).fault, "{now_ms}");
        }
    }

    #[test]
    fn what_the_other_side_did_wrong_is_no_loss() {
        let rude = Diagnostics {
            frames_checksum: 7,
            line_errors: 1,
            commands_unknown: 2,
            ..Diagnostics::default()
        };
        assert!(!has_lost(&rude));
        assert!(has_lost(&Diagnostics { edges_lost: 1, ..rude }));
        assert!(has_lost(&Diagnostics { samples_missed: 1, ..Diagnostics::default() }));
        assert!(has_lost(&Diagnostics { settings_late: 1, ..Diagnostics::default() }));
        assert!(has_lost(&Diagnostics { storage_errors: 1, ..Diagnostics::default() }));
    }

    #[test]
    fn pins_follow_the_lamps_and_are_left_alone_in_between() {
        let pin = |states: &[State]| {
            Mock::new(&states.iter().map(|&state| Transaction::set(state)).collect::<Vec<_>>())
        };
        let mut panel = Panel::new(
            pin(&[State::Low, State::High]),
            pin(&[State::High, State::High]),
            pin(&[State::High, State::High]),
            pin(&[State::High, State::Low]),
            PinState::Low,
        );
        let run = Lamps { run: true, ..Lamps::default() };
        let fault = Lamps { fault: true, ..Lamps::default() };
        for lamps in [run, run, fault, fault] {
            assert_eq!(panel.show(lamps), Ok(()));
        }
        for mut pin in panel.release() {
            pin.done();
        }
    }

    #[test]
    fn after_a_pin_that_could_not_be_set_all_are_set_anew() {
        let dark = Transaction::set(State::Low);
        let lit = Transaction::set(State::High);
        let broken = dark.clone().with_error(MockError::Io(ErrorKind::Other));
        let [event, communication] =
            [(); 2].map(|()| Mock::new(&[dark.clone(), dark.clone(), dark.clone()]));
        let run = Mock::new(&[lit.clone(), dark.clone(), lit.clone()]);
        let fault = Mock::new(&[dark.clone(), broken, dark]);
        let mut panel = Panel::new(run, event, communication, fault, PinState::High);
        let running = Lamps { run: true, ..Lamps::default() };
        assert_eq!(panel.show(running), Ok(()));
        assert!(panel.show(Lamps::default()).is_err());
        assert_eq!(panel.show(running), Ok(()));
        for mut pin in panel.release() {
            pin.done();
        }
    }
}
