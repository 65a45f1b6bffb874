//! The contacts behind serialisers on SPI1, in place of `inputs` (feature `serialiser`).
//!
//! # Design
//! `ser_board::serialiser` interprets what the parts send; this file has the registers. The capture
//! interrupt waits for the bytes: four parts take 12 µs at 5.25 MHz. Nothing else uses the bus.
//!
//! # Notes
//! The program drives chip select as a pin. `pins` sets it low at first, which lets parts latch and
//! changes nothing: without a clock they shift nothing out.

use embedded_hal::spi::{ErrorKind, ErrorType, Operation, SpiDevice};
use ser_board::inputs::{InputPorts, Wiring};
use ser_board::serialiser::{MAX_CLOCK_HZ, MODE, SerialiserError, SerialiserHealth, Serialisers};
use ser_proto::Model;
use stm32f4::stm32f407::{GPIOA, RCC, SPI1};

use crate::clocks;
use crate::pins::SERIALISER_SELECT;

const CLOCK_HZ: u32 = clocks::PCLK2_HZ / 8;

const _: () = {
    assert!(CLOCK_HZ <= MAX_CLOCK_HZ);
    // The bus is set up for this mode below.
    assert!(matches!(MODE, embedded_hal::spi::MODE_0));
};

/// Looks at the receiver before a byte is given up; it takes some 130 clocks of the processor.
const MAX_LOOKS: u32 = 1000;

/// Health of the chain.
pub(crate) static CHAIN_HEALTH: SerialiserHealth = SerialiserHealth::new();

/// The same, for the board's health.
pub(crate) const SERIALISERS: Option<&'static SerialiserHealth> = Some(&CHAIN_HEALTH);

/// Wiring of the contacts for a model: a part shows a flowing current as 1.
pub(crate) const fn wiring(model: Model) -> Wiring {
    Wiring { connected: model.mask(), active_low: 0 }
}

/// The chain for the model.
pub(crate) enum InputPins {
    Two(Serialisers<'static, Bus, 2>),
    Four(Serialisers<'static, Bus, 4>),
}

impl InputPins {
    /// Sets the bus up.
    pub(crate) fn start(rcc: &RCC, spi: SPI1, port: GPIOA, model: Model) -> InputPins {
        rcc.apb2enr().modify(|_, w| w.spi1en().set_bit());
        clocks::settle();
        let bus = Bus { spi, port };
        bus.select(false);
        // 8 bits, the most significant one first. The pin that would select this chip is not in
        // use.
        bus.spi.cr1().write(|w| {
            w.mstr().set_bit().br().div8().cpol().clear_bit().cpha().clear_bit();
            w.ssm().set_bit().ssi().set_bit().spe().set_bit()
        });
        match model {
            Model::Ser160 => InputPins::Two(Serialisers::new(bus, &CHAIN_HEALTH)),
            Model::Ser320 => InputPins::Four(Serialisers::new(bus, &CHAIN_HEALTH)),
        }
    }
}

impl InputPorts for InputPins {
    type Error = SerialiserError;

    #[inline]
    fn read(&mut self) -> Result<u32, SerialiserError> {
        match self {
            InputPins::Two(chain) => chain.read(),
            InputPins::Four(chain) => chain.read(),
        }
    }
}

/// SPI1 with the parts' chip select.
pub(crate) struct Bus {
    spi: SPI1,
    port: GPIOA,
}

impl Bus {
    fn select(&self, selected: bool) {
        let bit = 1 << SERIALISER_SELECT;
        // SAFETY: the register takes any value; the bit is that of this pin.
        self.port.bsrr().write(|w| unsafe { w.bits(if selected { bit << 16 } else { bit }) });
    }

    fn exchange(&self, byte: u8) -> Result<u8, ErrorKind> {
        self.spi.dr().write(|w| w.dr().set(byte.into()));
        if (0..MAX_LOOKS).any(|_| self.spi.sr().read().rxne().bit_is_set()) {
            let [byte, ..] = self.spi.dr().read().bits().to_le_bytes();
            Ok(byte)
        } else {
            Err(ErrorKind::Other)
        }
    }
}

impl ErrorType for Bus {
    type Error = ErrorKind;
}

impl SpiDevice for Bus {
    /// Parts are only read; another operation is an error.
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        // A leftover byte of an aborted transfer would be taken for the first one of this transfer.
        let _ = self.spi.dr().read();
        self.select(true);
        let done = operations.iter_mut().try_for_each(|operation| match operation {
            Operation::Read(bytes) => bytes.iter_mut().try_for_each(|byte| {
                *byte = self.exchange(0)?;
                Ok(())
            }),
            _ => Err(ErrorKind::Other),
        });
        self.select(false);
        done
    }
}
