//! The memory protection unit: makes an access to what a program never uses a fault.
//!
//! # Design
//! A board lists what it is kept from; the rest keeps the processor's own map. The range below the
//! stack belongs on every board's list. Where there is no memory, a store may be swallowed, and a
//! stack overflow would go unnoticed until something is read back.
//!
//! # Notes
//! Faults end in the hard fault handler, for which the unit is off. (ARMv7-M architecture, B3.5.)

use cortex_m::asm;
use cortex_m::peripheral::MPU;

/// Regions that the unit has.
const REGIONS: usize = 8;

const NEVER_EXECUTE: u32 = 1 << 28;
const FULL_ACCESS: u32 = 0b011 << 24;
const SHAREABLE: u32 = 1 << 18;
const BUFFERABLE: u32 = 1 << 16;
const ENABLE: u32 = 1 << 0;

/// The unit is on, except in fault handlers. What is in no region has the processor's own map.
const CONTROL: u32 = 1 << 2 | ENABLE;

/// A range of addresses and its permissions.
#[derive(Clone, Copy)]
pub struct Region {
    base: u32,
    size_and_attributes: u32,
}

impl Region {
    /// A region without any access.
    #[must_use]
    pub const fn nothing(base: u32, len: u32) -> Region {
        Region::new(base, len, NEVER_EXECUTE)
    }

    /// A data region with each access done once, in order and as written (device memory).
    #[must_use]
    pub const fn device(base: u32, len: u32) -> Region {
        Region::new(base, len, NEVER_EXECUTE | FULL_ACCESS | SHAREABLE | BUFFERABLE)
    }

    /// The length is a power of two, at least 32, and the base a multiple of it. For constants:
    /// anything else does not compile.
    const fn new(base: u32, len: u32, attributes: u32) -> Region {
        assert!(len.is_power_of_two() && len >= 32 && base.is_multiple_of(len));
        // The size is given as its exponent minus one.
        Region { base, size_and_attributes: attributes | (len.ilog2() - 1) << 1 | ENABLE }
    }
}

/// Switches the protection on, for good. Where regions overlap, the later one applies.
///
/// # Safety
/// The regions forbid nothing that the program uses. Memory that the program shares with nobody is
/// not declared device memory.
pub unsafe fn enable<const N: usize>(mpu: &MPU, regions: [Region; N]) {
    const { assert!(N <= REGIONS) };
    for (number, region) in (0..).zip(regions) {
        // SAFETY: promised by the caller.
        #[expect(clippy::multiple_unsafe_ops_per_block, reason = "one reason for all three")]
        unsafe {
            mpu.rnr.write(number);
            mpu.rbar.write(region.base);
            mpu.rasr.write(region.size_and_attributes);
        }
    }
    // SAFETY: as above.
    unsafe { mpu.ctrl.write(CONTROL) };
    asm::dsb();
    asm::isb();
}
