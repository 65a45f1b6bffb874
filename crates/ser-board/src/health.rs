//! The faults of a board's own parts: inputs, battery-backed clock, configuration memory.
//!
//! Each part counts in a static of its own, because an interrupt or the recorder owns the part
//! itself. [`Health`] combines the statics for the log (`report`) and for the fault lamp
//! ([`leds`](crate::leds)).

use crate::clock_chip::{ClockHealth, ClockState};
use crate::flash_log::FlashHealth;
use crate::inputs::InputHealth;
use crate::serialiser::SerialiserHealth;

/// The parts of a board; for a static.
#[derive(Clone, Copy, Debug)]
pub struct Health<'a> {
    /// The inputs, however they are read.
    pub inputs: &'a InputHealth,
    /// The chain of serialisers in front of the inputs, if there is one.
    pub serialisers: Option<&'a SerialiserHealth>,
    /// The battery-backed clock.
    pub clock: &'a ClockHealth,
    /// The configuration memory.
    pub storage: &'a FlashHealth,
}

/// The fault counts since power-up, as of one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Failures {
    /// Samples that could not be taken.
    pub samples_failed: u32,
    /// How often sampling began to fail.
    pub input_outages: u32,
    /// Transfers from serialisers that the bus reported as failed.
    pub serialiser_bus_errors: u32,
    /// Words of serialisers with a wrong check.
    pub serialiser_check_errors: u32,
    /// Samples without field supply.
    pub field_supply_lost: u32,
    /// Samples with too low a field supply.
    pub field_supply_low: u32,
    /// Samples of serialisers that are too hot.
    pub serialisers_too_hot: u32,
    /// How often the clock failed to take a new time.
    pub clock_writes_failed: u32,
    /// Accesses to the configuration memory that failed.
    pub storage_failed: u32,
}

impl Health<'_> {
    /// Whether something is broken now: inputs that cannot be read, or a clock or memory that does
    /// not answer.
    #[must_use]
    pub fn is_broken(&self) -> bool {
        self.inputs.is_failing()
            || self.clock.state() == ClockState::Silent
            || self.storage.is_failing()
    }

    /// The fault counts so far.
    #[must_use]
    pub fn failures(&self) -> Failures {
        let failures = Failures {
            samples_failed: self.inputs.failed.get(),
            input_outages: self.inputs.outages.get(),
            clock_writes_failed: self.clock.writes_failed.get(),
            storage_failed: self.storage.failed.get(),
            ..Failures::default()
        };
        let Some(serialisers) = self.serialisers else { return failures };
        Failures {
            serialiser_bus_errors: serialisers.bus_errors.get(),
            serialiser_check_errors: serialisers.check_errors.get(),
            field_supply_lost: serialisers.supply_lost.get(),
            field_supply_low: serialisers.supply_low.get(),
            serialisers_too_hot: serialisers.too_hot.get(),
            ..failures
        }
    }
}

#[cfg(test)]
mod tests {
    use core::cell::Cell;

    use super::*;
    use crate::inputs::{InputPorts, Sampler, Wiring};

    #[derive(Default)]
    struct Parts {
        inputs: InputHealth,
        serialisers: SerialiserHealth,
        clock: ClockHealth,
        storage: FlashHealth,
    }

    impl Parts {
        fn health(&self) -> Health<'_> {
            Health {
                inputs: &self.inputs,
                serialisers: Some(&self.serialisers),
                clock: &self.clock,
                storage: &self.storage,
            }
        }
    }

    /// A port that can be read while the cell is true.
    struct Port<'a>(&'a Cell<bool>);

    impl InputPorts for Port<'_> {
        type Error = ();

        fn read(&mut self) -> Result<u32, ()> {
            self.0.get().then_some(0).ok_or(())
        }
    }

    #[test]
    fn a_board_is_broken_for_as_long_as_its_inputs_cannot_be_read() {
        let parts = Parts::default();
        let readable = Cell::new(false);
        let mut sampler = Sampler::new(Port(&readable), Wiring::DIRECT, &parts.inputs);
        assert!(!parts.health().is_broken());
        sampler.sample();
        assert!(parts.health().is_broken());
        readable.set(true);
        sampler.sample();
        assert!(!parts.health().is_broken());
        let failures = Failures { samples_failed: 1, input_outages: 1, ..Failures::default() };
        assert_eq!(parts.health().failures(), failures);
    }

    #[test]
    fn every_count_of_every_part_is_told() {
        let parts = Parts::default();
        let counters = [
            &parts.inputs.failed,
            &parts.inputs.outages,
            &parts.serialisers.bus_errors,
            &parts.serialisers.check_errors,
            &parts.serialisers.supply_lost,
            &parts.serialisers.supply_low,
            &parts.serialisers.too_hot,
            &parts.clock.writes_failed,
            &parts.storage.failed,
        ];
        // Each counter gets a different count.
        for (number, counter) in (1..).zip(counters) {
            (0..number).for_each(|_| counter.count());
        }
        let expected = Failures {
            samples_failed: 1,
            input_outages: 2,
            serialiser_bus_errors: 3,
            serialiser_check_errors: 4,
            field_supply_lost: 5,
            field_supply_low: 6,
            serialisers_too_hot: 7,
            clock_writes_failed: 8,
            storage_failed: 9,
        };
        assert_eq!(parts.health().failures(), expected);
        let without = Health { serialisers: None, ..parts.health() };
        assert_eq!(without.failures().field_supply_lost, 0);
        assert_eq!(without.failures().samples_failed, 1);
    }
}
