//! The memory protection unit: what a program never touches is a fault when it is touched all the
//! same.
//!
//! # Design
//! A board says what it is kept from; the rest keeps the processor's own map. What lies below the
//! stack belongs on every board's list: where there is no memory, a store may as well be swallowed,
//! and a stack that has run out would go unnoticed until something is read back.
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

/// The unit is on, outside of fault handlers; what is in no region has the processor's own map.
const CONTROL: u32 = 1 << 2 | ENABLE;

/// A range of addresses and what may be done there.
#[derive(Clone, Copy)]
pub struct Region {
    base: u32,
    size_and_attributes: u32,
}

impl Region {
    /// Nothing may be done there.
    #[must_use]
    pub const fn nothing(base: u32, len: u32) -> Region {
        Region::new(base, len, NEVER_EXECUTE)
    }

    /// Data, every access done once, in order and as it was written (device memory).
    #[must_use]
    pub const fn device(base: u32, len: u32) -> Region {
        Region::new(base, len, NEVER_EXECUTE | FULL_ACCESS | SHAREABLE | BUFFERABLE)
    }

    /// The length is a power of two, 32 at least, and the base a multiple of it. For constants: all
    /// else does not compile.
    const fn new(base: u32, len: u32, attributes: u32) -> Region {
        assert!(len.is_power_of_two() && len >= 32 && base.is_multiple_of(len));
        // The size is a power of two, given as its exponent less one.
        Region { base, size_and_attributes: attributes | (len.ilog2() - 1) << 1 | ENABLE }
    }
}

/// Switches the protection on, for good. Where regions overlap, the later one holds.
///
/// # Safety
/// The regions take nothing from the program that it uses, and what it shares with nobody is not
/// among device memory.
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
