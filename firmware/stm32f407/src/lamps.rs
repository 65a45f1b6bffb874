//! The four lamps: their pins, and the conditions that light them.

use core::convert::Infallible;

use embedded_hal::digital::{ErrorType, OutputPin, PinState};
use ser_board::leds::{Condition, Leds, Panel};
use stm32f4::stm32f407::GPIOD;

use crate::pins;

/// One lamp.
pub(crate) struct Lamp {
    port: GPIOD,
    set: u32,
}

impl Lamp {
    fn on(number: u8) -> Lamp {
        // SAFETY: its set and reset register is all that is ever used, and that changes no pin but
        // the one asked for.
        Lamp { port: unsafe { GPIOD::steal() }, set: 1 << number }
    }

    fn drive(&self, bits: u32) {
        // SAFETY: the register takes any value; the bits are those of this lamp's pin.
        self.port.bsrr().write(|w| unsafe { w.bits(bits) });
    }
}

impl ErrorType for Lamp {
    type Error = Infallible;
}

impl OutputPin for Lamp {
    fn set_high(&mut self) -> Result<(), Infallible> {
        self.drive(self.set);
        Ok(())
    }

    fn set_low(&mut self) -> Result<(), Infallible> {
        self.drive(self.set << 16);
        Ok(())
    }
}

/// The lamps and what they show.
pub(crate) struct Lamps {
    panel: Panel<Lamp>,
    leds: Leds,
}

impl Lamps {
    /// All lamps; port D is set up and given away.
    pub(crate) fn new(_port: GPIOD) -> Lamps {
        let [run, event, communication, fault] =
            [pins::LAMP_RUN, pins::LAMP_EVENT, pins::LAMP_COMMUNICATION, pins::LAMP_FAULT]
                .map(Lamp::on);
        Lamps {
            panel: Panel::new(run, event, communication, fault, PinState::High),
            leds: Leds::new(),
        }
    }

    /// Called in every pass of the main loop.
    pub(crate) fn show(&mut self, now_ms: u32, condition: &Condition) {
        let lamps = self.leds.lamps(now_ms, condition);
        let Ok(()) = self.panel.show(lamps);
    }
}
