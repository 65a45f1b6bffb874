//! The contacts: three ports, read one right after the other.

use core::convert::Infallible;

use ser_board::inputs::{InputPorts, Wiring, join};
use ser_board::serialiser::SerialiserHealth;
use ser_proto::Model;
use stm32f4::stm32f407::{GPIOB, GPIOC, GPIOG};

/// There is no chain of serialisers.
pub(crate) const SERIALISERS: Option<&'static SerialiserHealth> = None;

/// Wiring of the contacts for a model: an optocoupler pulls its pin low while current flows.
pub(crate) const fn wiring(model: Model) -> Wiring {
    Wiring { connected: model.mask(), active_low: u32::MAX }
}

/// The ports that the inputs are on.
pub(crate) struct InputPins {
    /// Inputs 1–16.
    pub(crate) low: GPIOB,
    /// Inputs 17–24 on its lower half.
    pub(crate) middle: GPIOC,
    /// Inputs 25–32 on its upper half.
    pub(crate) high: GPIOG,
}

impl InputPorts for InputPins {
    type Error = Infallible;

    #[inline]
    fn read(&mut self) -> Result<u32, Infallible> {
        let low = self.low.idr().read().bits();
        let middle = self.middle.idr().read().bits();
        let high = self.high.idr().read().bits();
        #[expect(clippy::cast_possible_truncation, reason = "the upper halves of IDR are zero")]
        let inputs = join(low as u16, (middle & 0x00FF | high & 0xFF00) as u16);
        Ok(inputs)
    }
}
