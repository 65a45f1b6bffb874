//! The word of inputs: where its bits come from, and what happens when it cannot be read.
//!
//! Inputs on pins of the chip are read in one load per port and are always available. Inputs behind
//! a bus may fail to arrive, and a failed sample must never look like contacts that moved. The
//! [`Sampler`] then returns the inputs as they were last seen, marks them as held, and counts the
//! failure. The capture interrupt continues with these, because its tick is the recorder's clock
//! and feeds the watchdog. A recorder that cannot see its inputs can still report that.

use core::sync::atomic::{AtomicBool, Ordering};

use crate::counter::Counter;

/// Where the inputs come from. Input 1 is bit 0.
pub trait InputPorts {
    /// Why inputs cannot be read. `Infallible` for pins.
    type Error;

    /// Reads all inputs at once, as raw levels.
    ///
    /// # Errors
    /// When the inputs could not be read, or what was read cannot be trusted.
    fn read(&mut self) -> Result<u32, Self::Error>;
}

/// Two 16-bit ports as one word: inputs 1–16 from `low`, 17–32 from `high`.
///
/// The two loads are a few clock cycles apart, which does not matter to a sample every millisecond.
#[inline]
#[must_use]
pub const fn join(low: u16, high: u16) -> u32 {
    low as u32 | (high as u32) << 16
}

/// How contacts are wired to the inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Wiring {
    /// Inputs that exist. All others read as off, so that a floating pin is never an event.
    pub connected: u32,
    /// Inputs whose pin is low while the contact is on, such as those behind optocouplers.
    pub active_low: u32,
}

impl Wiring {
    /// All 32 inputs, high when on.
    pub const DIRECT: Wiring = Wiring { connected: u32::MAX, active_low: 0 };

    /// The inputs that are on, from the levels that were read.
    #[inline]
    #[must_use]
    pub const fn on(&self, read: u32) -> u32 {
        (read ^ self.active_low) & self.connected
    }
}

/// Counts that the sampler shares with the main loop; for a static.
#[derive(Debug, Default)]
pub struct InputHealth {
    /// Samples that could not be taken.
    pub failed: Counter,
    /// How often sampling began to fail, however long each failure lasted.
    pub outages: Counter,
    failing: AtomicBool,
}

impl InputHealth {
    /// Nothing has failed yet.
    #[must_use]
    pub const fn new() -> InputHealth {
        InputHealth {
            failed: Counter::new(),
            outages: Counter::new(),
            failing: AtomicBool::new(false),
        }
    }

    /// Whether the latest sample could not be taken.
    #[inline]
    #[must_use]
    pub fn is_failing(&self) -> bool {
        self.failing.load(Ordering::Relaxed)
    }
}

/// The inputs at one moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Sample {
    /// The inputs that are on.
    Fresh(u32),
    /// The inputs could not be read; these are the last ones seen.
    Held(u32),
    /// The inputs have never been read, so there is no first state yet.
    Unknown,
}

/// Reads inputs once per millisecond, in the capture interrupt.
pub struct Sampler<'a, P> {
    ports: P,
    wiring: Wiring,
    health: &'a InputHealth,
    latest: Option<u32>,
    /// A copy of the flag in `health`, which costs more to read.
    failing: bool,
}

impl<'a, P: InputPorts> Sampler<'a, P> {
    /// A sampler that has not read anything yet.
    pub const fn new(ports: P, wiring: Wiring, health: &'a InputHealth) -> Sampler<'a, P> {
        Sampler { ports, wiring, health, latest: None, failing: false }
    }

    /// Ends sampling; returns the ports.
    pub fn release(self) -> P {
        self.ports
    }

    /// Takes a sample.
    #[inline]
    pub fn sample(&mut self) -> Sample {
        match self.ports.read() {
            Ok(read) => {
                let inputs = self.wiring.on(read);
                self.latest = Some(inputs);
                if self.failing {
                    self.set_failing(false);
                }
                Sample::Fresh(inputs)
            }
            Err(_) => self.hold(),
        }
    }

    #[cold]
    fn hold(&mut self) -> Sample {
        self.health.failed.count();
        if !self.failing {
            self.set_failing(true);
            self.health.outages.count();
        }
        self.latest.map_or(Sample::Unknown, Sample::Held)
    }

    #[cold]
    fn set_failing(&mut self, failing: bool) {
        self.failing = failing;
        self.health.failing.store(failing, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use super::*;

    struct Script(VecDeque<Option<u32>>);

    impl InputPorts for Script {
        type Error = ();

        fn read(&mut self) -> Result<u32, ()> {
            self.0.pop_front().flatten().ok_or(())
        }
    }

    #[test]
    fn port_one_holds_inputs_1_to_16_and_port_two_the_rest() {
        assert_eq!(join(0x0001, 0x8000), 1 << 31 | 1);
        assert_eq!(join(0xFFFF, 0x0000), 0x0000_FFFF);
    }

    #[test]
    fn wiring_turns_levels_into_contacts_and_ignores_pins_without_one() {
        let wiring = Wiring { connected: 0x0000_FFFF, active_low: 0x0000_00FF };
        assert_eq!(wiring.on(0xFFFF_00FF), 0);
        assert_eq!(wiring.on(0x0000_8000), 0x0000_80FF);
        assert_eq!(Wiring::DIRECT.on(0xDEAD_BEEF), 0xDEAD_BEEF);
    }

    #[test]
    fn a_sample_that_could_not_be_taken_says_so_and_changes_nothing() {
        let health = InputHealth::new();
        let reads = [None, Some(0b01), None, None, Some(0b11), None];
        let mut sampler = Sampler::new(Script(reads.into()), Wiring::DIRECT, &health);
        let samples = reads.map(|_| sampler.sample());
        let expected = [
            Sample::Unknown,
            Sample::Fresh(0b01),
            Sample::Held(0b01),
            Sample::Held(0b01),
            Sample::Fresh(0b11),
            Sample::Held(0b11),
        ];
        assert_eq!(samples, expected);
        assert_eq!((health.failed.get(), health.outages.get()), (4, 3));
    }
}
