//! The four lamps: bits of a word on the external bus, where the bench sees them.

use core::convert::Infallible;

use embedded_hal::digital::{ErrorType, OutputPin, PinState};
use ser_board::leds::{Condition, Leds, Panel};

use crate::external_bus;

/// One lamp.
struct Lamp {
    bit: u32,
}

impl ErrorType for Lamp {
    type Error = Infallible;
}

impl OutputPin for Lamp {
    fn set_high(&mut self) -> Result<(), Infallible> {
        external_bus::change_lamps(|lamps| lamps | self.bit);
        Ok(())
    }

    fn set_low(&mut self) -> Result<(), Infallible> {
        external_bus::change_lamps(|lamps| lamps & !self.bit);
        Ok(())
    }
}

/// The lamps and what they show.
pub(crate) struct Lamps {
    panel: Panel<Lamp>,
    leds: Leds,
}

impl Lamps {
    /// Run, event, communication, fault: bits 0–3. The owner of this value is the only one to
    /// change the word.
    pub(crate) fn new() -> Lamps {
        let [run, event, communication, fault] =
            [0, 1, 2, 3].map(|number| Lamp { bit: 1 << number });
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
