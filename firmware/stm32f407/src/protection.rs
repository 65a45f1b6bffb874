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
//! Capture goes on during an erase only because *nothing runs from flash*, so this does not rely on
//! the linker alone. A jump or a load that leaves the RAM is a fault at once, on the bench, and not
//! a stalled sample once a year. The same region catches null pointers and a stack overflow.
//!
//! # Notes
//! By default the processor treats the external bus as ordinary memory, whose accesses may be
//! repeated, joined and delayed. In device memory every access is done once, in order and as
//! written.

use cortex_m::peripheral::MPU;
use ser_cortex_m::protection::{self, Region};

use crate::{flash, geni_bus};

const REGIONS: [Region; 4] = [
    Region::nothing(0, 0x1000_0000),
    Region::device(flash::BASE, flash::LEN),
    Region::nothing(geni_bus::BANK, 0x2000_0000),
    Region::device(geni_bus::BANK, geni_bus::WINDOW_LEN),
];

/// Switches the protection on, for good.
pub(crate) fn enable(mpu: &MPU) {
    // SAFETY: the regions forbid only what this program never does; the configuration and the
    // shared RAM are reached by volatile accesses of their drivers and by nothing else.
    unsafe { protection::enable(mpu, REGIONS) };
}
