//! The straps: how the board is set up, read once at start-up. A strap is *set* when its jumper is
//! closed.
//!
//! | pin | strap     | open            | set             |
//! |-----|-----------|-----------------|-----------------|
//! | PE0 | model     | SER320          | SER160          |
//! | PE1 | GENI      | no GENI board   | GENI board      |
//! | PE2 | debounce  | see below       |                 |
//! | PE3 | debounce  |                 |                 |
//!
//! Debounce of all inputs: both open none, PE2 set 5 ms, PE3 set 10 ms, both set 20 ms.

use ser_node::Debounce;
use ser_proto::Model;
use stm32f4::stm32f407::GPIOE;

use crate::clocks;

/// Time for the pull-ups: 50 kΩ charge the 200 pF of jumper and wire in 10 µs.
const SETTLE_CLOCKS: u32 = clocks::HCLK_HZ / 1_000_000 * 50;

/// The straps as they were found.
#[derive(Clone, Copy)]
pub(crate) struct Straps {
    set: u32,
}

impl Straps {
    pub(crate) fn read(port: &GPIOE) -> Straps {
        cortex_m::asm::delay(SETTLE_CLOCKS);
        Straps { set: !port.idr().read().bits() }
    }

    const fn is_set(self, number: u32) -> bool {
        self.set >> number & 1 != 0
    }

    pub(crate) const fn model(self) -> Model {
        if self.is_set(0) { Model::Ser160 } else { Model::Ser320 }
    }

    pub(crate) const fn has_geni(self) -> bool {
        self.is_set(1)
    }

    pub(crate) const fn debounce(self) -> Debounce {
        Debounce::uniform(match (self.is_set(3), self.is_set(2)) {
            (false, false) => 0,
            (false, true) => 5,
            (true, false) => 10,
            (true, true) => 20,
        })
    }
}
