//! The contacts: a latch on the external bus, all inputs in one word.

use core::convert::Infallible;

use ser_board::inputs::{InputHealth, InputPorts, Wiring};
use ser_proto::Model;

use crate::external_bus;

pub(crate) static HEALTH: InputHealth = InputHealth::new();

/// Wiring of the contacts for a model: closed is 1.
pub(crate) const fn wiring(model: Model) -> Wiring {
    Wiring { connected: model.mask(), active_low: 0 }
}

/// The latch.
pub(crate) struct InputLatch;

impl InputPorts for InputLatch {
    type Error = Infallible;

    #[inline]
    fn read(&mut self) -> Result<u32, Infallible> {
        Ok(external_bus::read_inputs())
    }
}
