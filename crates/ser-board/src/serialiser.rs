//! Inputs behind industrial digital-input serialisers on SPI: the MAX31912/MAX31913 family in
//! 16-bit mode.
//!
//! Each part turns eight 24 V inputs into a word of a shift register. Parts in a chain pass on what
//! comes in after their own word. All parts latch their inputs when chip select falls, so the
//! inputs of a whole chain are from one instant, however long it takes to shift them out.
//!
//! ```text
//!   | IN8 … IN1 |  CRC (5)  | UV1 | OT | UV2 |      most significant bit first, the part next to the controller first
//!   |   byte 0  |             byte 1           |
//! ```
//!
//! The check is a CRC over the eight inputs with the polynomial x⁵ + x⁴ + x² + 1 and initial value
//! zero. UV1 is 0 while the field supply is too low for the inputs to mean anything. UV2 is 0 while
//! the supply is lower than it should be. OT is 1 while the part is too hot. (Data sheets of the
//! MAX31912, 19-6925, and the MAX31913, "Reading Serial Data". The MAX31911 is not of this family:
//! its data sheet gives undervoltage the other way round and a stop bit in place of UV2.)
//!
//! # Design
//! A word whose check fails, or whose part is without supply, spoils the whole sample: a mix of new
//! and old inputs would be a state that never existed. Warnings are counted, and the sample is
//! good. A stuck data line is found either way: all zeros say no supply, all ones fail the check.
//!
//! # Tradeoffs
//! Without field supply the inputs are held, instead of all contacts seeming to open.
//! [`SerialiserHealth::supply_lost`] shows that the supply is gone.
//!
//! # Notes
//! Four parts take 64 clocks, 13 µs at 5 MHz, in the capture interrupt. The bus must not be shared
//! with anything that the main loop uses, because the capture interrupt waits for nobody. A
//! controller's SPI reports hardly any errors, so faults are found by the check. It finds every
//! change of up to three bits, and all but one in 32 words of pure noise.

use crc::{Algorithm, Crc, NoTable};
use embedded_hal::spi::{MODE_0, Mode, SpiDevice};

use crate::counter::Counter;
use crate::inputs::InputPorts;

const CHECK: Algorithm<u8> = Algorithm {
    width: 5,
    poly: 0x15,
    init: 0,
    refin: false,
    refout: false,
    xorout: 0,
    // The check of "123456789".
    check: 0x1C,
    residue: 0,
};
const CRC: Crc<u8, NoTable> = Crc::<u8, NoTable>::new(&CHECK);

const SUPPLY_OK: u8 = 1 << 2;
const TOO_HOT: u8 = 1 << 1;
const SUPPLY_GOOD: u8 = 1 << 0;
const CHECK_SHIFT: u32 = 3;

const WORD_LEN: usize = 2;
const INPUTS_PER_PART: usize = 8;

/// How the bus must be set up: the clock idles low, data are taken on its rising edge and change on
/// the falling one. The first bit is there as soon as chip select falls.
pub const MODE: Mode = MODE_0;

/// The fastest clock that the parts take, in hertz (data sheet, "SPI timing"; look it up for
/// yours). An isolator in the lines delays the returning data against the outgoing clock: 5 MHz
/// leave 100 ns for both ways.
pub const MAX_CLOCK_HZ: u32 = 25_000_000;

/// Why a sample is not usable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SerialiserError {
    /// The bus reported an error.
    Bus,
    /// The check of a part's word failed. Parts count from 0, the one next to the controller.
    Check {
        /// Which part.
        part: u8,
    },
    /// A part has no field supply.
    NoSupply {
        /// Which part.
        part: u8,
    },
}

/// Counts that the driver shares with the main loop; for a static.
#[derive(Debug, Default)]
pub struct SerialiserHealth {
    /// Transfers that the bus reported as failed.
    pub bus_errors: Counter,
    /// Words with a wrong check.
    pub check_errors: Counter,
    /// Samples without field supply.
    pub supply_lost: Counter,
    /// Samples with too low a field supply.
    pub supply_low: Counter,
    /// Samples of parts that are too hot.
    pub too_hot: Counter,
}

impl SerialiserHealth {
    /// Nothing has gone wrong yet.
    #[must_use]
    pub const fn new() -> SerialiserHealth {
        SerialiserHealth {
            bus_errors: Counter::new(),
            check_errors: Counter::new(),
            supply_lost: Counter::new(),
            supply_low: Counter::new(),
            too_hot: Counter::new(),
        }
    }
}

/// A chain of 1–4 parts that share chip select and clock. Inputs 1–8 are those of the part next to
/// the controller.
pub struct Serialisers<'a, SPI, const PARTS: usize> {
    spi: SPI,
    health: &'a SerialiserHealth,
}

impl<'a, SPI: SpiDevice, const PARTS: usize> Serialisers<'a, SPI, PARTS> {
    /// A chain behind `spi`. A length that is not 1–4 does not compile.
    pub const fn new(spi: SPI, health: &'a SerialiserHealth) -> Self {
        const {
            assert!(
                PARTS >= 1 && PARTS * INPUTS_PER_PART <= 32,
                "a recorder has at most 32 inputs"
            );
        };
        Serialisers { spi, health }
    }

    /// Ends the driver; returns the bus.
    pub fn release(self) -> SPI {
        self.spi
    }

    fn examine(&self, part: u8, inputs: u8, status: u8) -> Result<u8, SerialiserError> {
        if CRC.checksum(&[inputs]) != status >> CHECK_SHIFT {
            self.health.check_errors.count();
            return Err(SerialiserError::Check { part });
        }
        if status & SUPPLY_OK == 0 {
            self.health.supply_lost.count();
            return Err(SerialiserError::NoSupply { part });
        }
        if status & SUPPLY_GOOD == 0 {
            self.health.supply_low.count();
        }
        if status & TOO_HOT != 0 {
            self.health.too_hot.count();
        }
        Ok(inputs)
    }
}

impl<SPI: SpiDevice, const PARTS: usize> InputPorts for Serialisers<'_, SPI, PARTS> {
    type Error = SerialiserError;

    fn read(&mut self) -> Result<u32, SerialiserError> {
        let mut words = [[0; WORD_LEN]; PARTS];
        if self.spi.read(words.as_flattened_mut()).is_err() {
            self.health.bus_errors.count();
            return Err(SerialiserError::Bus);
        }
        let mut inputs = [0; size_of::<u32>()];
        for (part, ([data, status], byte)) in (0..).zip(words.into_iter().zip(&mut inputs)) {
            *byte = self.examine(part, data, status)?;
        }
        Ok(u32::from_le_bytes(inputs))
    }
}

#[cfg(test)]
mod tests {
    use embedded_hal_mock::eh1::spi::{Mock, Transaction};
    use ser_node::{Capture, CaptureChannel, CaptureReader, Debounce};

    use super::*;
    use crate::inputs::{InputHealth, Sample, Sampler, Wiring};

    const ALL_WELL: u8 = SUPPLY_OK | SUPPLY_GOOD;

    /// What a part shifts out. Its check is computed bit by bit, as in the part's shift register.
    fn word(inputs: u8, flags: u8) -> [u8; WORD_LEN] {
        let mut register = 0_u8;
        for bit in (0..8).rev() {
            let feedback = (register >> 4 ^ inputs >> bit) & 1;
            register = register << 1 & 0x1F;
            if feedback == 1 {
                register ^= 0b1_0101;
            }
        }
        [inputs, register << CHECK_SHIFT | flags]
    }

    fn transfer(bytes: &[u8]) -> [Transaction<u8>; 3] {
        [
            Transaction::transaction_start(),
            Transaction::read_vec(bytes.to_vec()),
            Transaction::transaction_end(),
        ]
    }

    /// A bus on which the chain shifts out these words, one sample after the other.
    fn bus<const PARTS: usize>(samples: &[[[u8; WORD_LEN]; PARTS]]) -> Mock<u8> {
        let transfers: Vec<_> =
            samples.iter().flat_map(|words| transfer(words.as_flattened())).collect();
        Mock::new(&transfers)
    }

    fn read<const PARTS: usize>(
        words: [[u8; WORD_LEN]; PARTS],
        health: &SerialiserHealth,
    ) -> Result<u32, SerialiserError> {
        let mut chain = Serialisers::<_, PARTS>::new(bus(&[words]), health);
        let inputs = chain.read();
        chain.release().done();
        inputs
    }

    fn counts(health: &SerialiserHealth) -> [u32; 5] {
        [
            &health.bus_errors,
            &health.check_errors,
            &health.supply_lost,
            &health.supply_low,
            &health.too_hot,
        ]
        .map(Counter::get)
    }

    #[test]
    fn the_check_is_that_of_the_shift_register() {
        assert_eq!(CRC.checksum(b"123456789"), CHECK.check);
        for inputs in 0..=u8::MAX {
            assert_eq!(CRC.checksum(&[inputs]), word(inputs, 0)[1] >> CHECK_SHIFT);
        }
    }

    #[test]
    fn inputs_1_to_8_come_from_the_part_next_to_the_controller() {
        let health = SerialiserHealth::new();
        let words = [
            word(0x01, ALL_WELL),
            word(0x80, ALL_WELL),
            word(0x00, ALL_WELL),
            word(0xA5, ALL_WELL),
        ];
        assert_eq!(read(words, &health), Ok(0xA500_8001));
        assert_eq!(read([word(0x5A, ALL_WELL), word(0xFF, ALL_WELL)], &health), Ok(0x0000_FF5A));
        assert_eq!(counts(&health), [0; 5]);
    }

    #[test]
    fn up_to_three_wrong_bits_in_a_word_are_always_found() {
        let health = SerialiserHealth::new();
        // The check covers inputs and check, not the three flags.
        let positions: Vec<u32> = (0..8).chain(8 + CHECK_SHIFT..16).collect();
        for inputs in 0..=u8::MAX {
            let good = u16::from_le_bytes(word(inputs, ALL_WELL));
            for &first in &positions {
                for &second in &positions {
                    for &third in &positions {
                        // The same position twice means a single bit.
                        let flipped = if second == third {
                            1 << first
                        } else {
                            1 << first ^ 1 << second ^ 1 << third
                        };
                        if flipped == 0 {
                            continue;
                        }
                        let [data, status] = (good ^ flipped).to_le_bytes();
                        let chain = Serialisers::<Mock<u8>, 1>::new(Mock::new(&[]), &health);
                        let examined = chain.examine(0, data, status);
                        chain.release().done();
                        assert_eq!(examined, Err(SerialiserError::Check { part: 0 }));
                    }
                }
            }
        }
    }

    #[test]
    fn a_data_line_that_is_stuck_is_no_state_of_the_inputs() {
        let health = SerialiserHealth::new();
        assert_eq!(read([[0x00; 2]; 4], &health), Err(SerialiserError::NoSupply { part: 0 }));
        assert_eq!(read([[0xFF; 2]; 4], &health), Err(SerialiserError::Check { part: 0 }));
        assert_eq!(counts(&health), [0, 1, 1, 0, 0]);
    }

    #[test]
    fn a_part_without_supply_spoils_the_sample_and_a_warning_does_not() {
        let health = SerialiserHealth::new();
        let dead = [word(0x01, ALL_WELL), word(0x00, 0)];
        assert_eq!(read(dead, &health), Err(SerialiserError::NoSupply { part: 1 }));
        let low = [word(0x01, SUPPLY_OK), word(0x02, ALL_WELL | TOO_HOT)];
        assert_eq!(read(low, &health), Ok(0x0201));
        assert_eq!(counts(&health), [0, 0, 1, 1, 1]);
    }

    /// A bus that reports an error, which the mock of embedded-hal cannot.
    struct Broken;

    impl embedded_hal::spi::ErrorType for Broken {
        type Error = embedded_hal::spi::ErrorKind;
    }

    impl SpiDevice for Broken {
        fn transaction(
            &mut self,
            _: &mut [embedded_hal::spi::Operation<'_, u8>],
        ) -> Result<(), embedded_hal::spi::ErrorKind> {
            Err(embedded_hal::spi::ErrorKind::ModeFault)
        }
    }

    #[test]
    fn an_error_of_the_bus_is_counted() {
        let health = SerialiserHealth::new();
        assert_eq!(Serialisers::<_, 4>::new(Broken, &health).read(), Err(SerialiserError::Bus));
        assert_eq!(counts(&health), [1, 0, 0, 0, 0]);
    }

    /// One sample after the other, as a board's capture interrupt takes them.
    fn run<P: InputPorts>(sampler: &mut Sampler<'_, P>, capture: &mut Capture<'_>, samples: u32) {
        for tick_ms in 1..=samples {
            match sampler.sample() {
                Sample::Fresh(inputs) | Sample::Held(inputs) => capture.sample(tick_ms, inputs),
                Sample::Unknown => {}
            }
        }
    }

    fn state_and_tick(reader: &CaptureReader<'_>) -> (u32, u32) {
        (reader.state(), reader.tick_ms())
    }

    #[test]
    fn samples_that_went_wrong_never_look_like_contacts_that_moved() {
        let garbled = [[0xFF, 0x00], word(0x00, ALL_WELL)];
        let dead = [word(0x00, 0), word(0x00, 0)];
        let closed = [word(0x0F, ALL_WELL), word(0x00, ALL_WELL)];
        let samples = [garbled, dead, closed, garbled, dead, dead, garbled, closed, dead];
        let (serialisers, inputs) = (SerialiserHealth::new(), InputHealth::new());
        let chain = Serialisers::<_, 2>::new(bus(&samples), &serialisers);
        let mut sampler = Sampler::new(chain, Wiring::DIRECT, &inputs);
        let mut channel = CaptureChannel::new();
        let (mut capture, reader) = channel.split(Debounce::OFF);
        run(&mut sampler, &mut capture, 9);
        // The tick has gone on, the contacts have not moved, and every fault has been counted.
        assert_eq!(state_and_tick(&reader), (0x000F, 9));
        assert_eq!((inputs.failed.get(), inputs.outages.get()), (7, 3));
        assert_eq!(counts(&serialisers), [0, 3, 4, 0, 0]);
        sampler.release().release().done();
    }
}
