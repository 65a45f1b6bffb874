//! What the memory protection unit keeps the program from.
//!
//! | addresses            | what is there                                      | allowed                       |
//! |----------------------|----------------------------------------------------|-------------------------------|
//! | 00000000h–0FFFFFFFh  | nothing, flash, and what the stack would run into  | nothing                       |
//! | the configuration    | two sectors of the flash                           | data                          |
//! | 60000000h–7FFFFFFFh  | external bus                                       | nothing                       |
//! | 60000000h–60003FFFh  | shared RAM of the GENI board                       | data, one access at a time    |
//!
//! # Design
//! *That nothing runs from flash* is what capture stands on while a sector is erased, so it is not left to the linker's
//! word: a jump or a load that leaves the RAM is a fault at once, on the bench, and not a stalled sample once a year. The
//! same region catches null pointers and a stack that has run out.
//!
//! # Notes
//! By itself the processor takes the external bus for ordinary memory, whose accesses may be repeated, joined
//! and put off. Device memory has every access done once, in order and as it was written. Everything that is not listed
//! keeps the processor's own map. Faults end in the hard fault handler, for which the unit is off.
//! (ARMv7-M architecture, B3.5.)

use cortex_m::asm;
use cortex_m::peripheral::MPU;

use crate::{flash, geni_bus};

/// No access, and nothing runs from there.
const NOTHING: u32 = NEVER_EXECUTE;
/// Device memory for reading and writing.
const DEVICE: u32 = NEVER_EXECUTE | FULL_ACCESS | SHAREABLE | BUFFERABLE;

const NEVER_EXECUTE: u32 = 1 << 28;
const FULL_ACCESS: u32 = 0b011 << 24;
const SHAREABLE: u32 = 1 << 18;
const BUFFERABLE: u32 = 1 << 16;
const ENABLE: u32 = 1 << 0;

/// The unit is on, outside of fault handlers; what is in no region has the processor's own map.
const CONTROL: u32 = 1 << 2 | ENABLE;

struct Region {
    base: u32,
    len: u32,
    attributes: u32,
}

/// Where regions overlap, the later one holds.
const REGIONS: [Region; 4] = [
    Region { base: 0, len: 0x1000_0000, attributes: NOTHING },
    Region { base: flash::BASE, len: flash::LEN, attributes: DEVICE },
    Region { base: geni_bus::BANK, len: 0x2000_0000, attributes: NOTHING },
    Region { base: geni_bus::BANK, len: geni_bus::WINDOW_LEN, attributes: DEVICE },
];

impl Region {
    const fn size_and_attributes(&self) -> u32 {
        assert!(self.len.is_power_of_two() && self.len >= 32 && self.base.is_multiple_of(self.len));
        // The size is a power of two, given as its exponent less one.
        self.attributes | (self.len.ilog2() - 1) << 1 | ENABLE
    }
}

/// Switches the protection on, for good.
pub(crate) fn enable(mpu: &MPU) {
    const SIZES_AND_ATTRIBUTES: [u32; REGIONS.len()] = {
        let mut registers = [0; REGIONS.len()];
        let mut number = 0;
        while number < REGIONS.len() {
            registers[number] = REGIONS[number].size_and_attributes();
            number += 1;
        }
        registers
    };
    for (number, (region, register)) in (0..).zip(REGIONS.iter().zip(SIZES_AND_ATTRIBUTES)) {
        // SAFETY: the regions forbid only what this program never does, and take nothing from what it uses.
        #[expect(clippy::multiple_unsafe_ops_per_block, reason = "one reason for all three")]
        unsafe {
            mpu.rnr.write(number);
            mpu.rbar.write(region.base);
            mpu.rasr.write(register);
        }
    }
    // SAFETY: as above.
    unsafe { mpu.ctrl.write(CONTROL) };
    asm::dsb();
    asm::isb();
}
