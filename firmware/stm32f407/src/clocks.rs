//! The clocks: 84 MHz from the 8 MHz crystal.
//!
//! ```text
//! 8 MHz crystal ÷4 ─┐
//!                   ├─ 2 MHz ×168 = 336 MHz ÷4 = 84 MHz ─┬─ HCLK (÷1) processor, memories, FSMC
//! 16 MHz RC ÷8 ─────┘                                    ├─ PCLK1 (÷8) 10.5 MHz serial line; its timers 21 MHz
//!                                                        └─ PCLK2 (÷2) 42 MHz
//! ```
//!
//! # Design
//! If the crystal does not oscillate, or stops later, the chip's RC oscillator takes its place: the
//! same clocks, 1 % off at 25 °C and by several percent where it is hot or cold (data sheet, "HSI
//! oscillator characteristics"). The recorder goes on recording, and the fault lamp is lit
//! meanwhile. RS-232 stops working when both ends together are off by more than some 4 %.
//!
//! # Tradeoffs
//! The chip could run twice as fast. But the external bus has the processor's clock, and holds what
//! it writes for one clock period and no more. At 168 MHz the buffers in front of the GENI board
//! would use that up (see `geni_bus`, which does not compile then). The recorder has time to spare
//! at either speed.
//!
//! PCLK1 is a quarter of its maximum, because the serial line's divider has 16 bits. At 42 MHz its
//! slowest rate is 641 bit/s, and the protocol needs 300.
//!
//! # Notes
//! Only the start-up code and the configuration read the flash. Its wait states are set
//! nevertheless; its caches stay off. (RM0090, chapters "Reset and clock control" and "Embedded
//! flash memory interface".)

use cortex_m::asm;
use stm32f4::stm32f407::{FLASH, RCC};

const CRYSTAL_HZ: u32 = 8_000_000;
const RC_HZ: u32 = 16_000_000;

const CRYSTAL_DIVIDER: u8 = 4;
const RC_DIVIDER: u8 = 8;
const MULTIPLIER: u16 = 168;
const OUTPUT_DIVIDER: u32 = 4;
/// For the 48 MHz of USB, which is not in use. 0 and 1 are not allowed.
const USB_DIVIDER: u8 = 7;

/// Clock of the processor and of the external bus.
pub(crate) const HCLK_HZ: u32 =
    CRYSTAL_HZ / CRYSTAL_DIVIDER as u32 * MULTIPLIER as u32 / OUTPUT_DIVIDER;
/// Clock of the serial line.
pub(crate) const PCLK1_HZ: u32 = HCLK_HZ / PCLK1_DIVIDER;
/// Clock of SPI1.
#[cfg(feature = "serialiser")]
pub(crate) const PCLK2_HZ: u32 = HCLK_HZ / 2;
/// Clock of the timers: twice that of their bus, which is divided.
pub(crate) const TIMER_HZ: u32 = 2 * PCLK1_HZ;

/// Wait states of the flash at 60–90 MHz and 2.7–3.6 V.
const FLASH_WAIT_STATES: u8 = 2;

const _: () = {
    assert!(HCLK_HZ == 84_000_000);
    // The PLL's input should be 2 MHz; its oscillator must stay within 100–432 MHz.
    assert!(
        CRYSTAL_HZ / CRYSTAL_DIVIDER as u32 == 2_000_000 && RC_HZ / RC_DIVIDER as u32 == 2_000_000
    );
    assert!(2 * MULTIPLIER >= 100 && 2 * MULTIPLIER <= 432);
    // The slowest rate must fit into the divider of the serial line.
    assert!(PCLK1_HZ / 300 < 1 << 16);
};

/// The divider from HCLK to PCLK1.
const PCLK1_DIVIDER: u32 = 8;

/// Looks at the crystal before it is given up, some 10 clocks of 16 MHz each: 125 ms, where 2 ms
/// are typical.
const CRYSTAL_LOOKS: u32 = 200_000;

/// The source of the clocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Source {
    Crystal,
    /// The crystal does not oscillate.
    RcOscillator,
}

/// Brings the clocks up. The watchdog ends whatever hangs here.
pub(crate) fn start(rcc: &RCC, flash: &FLASH) -> Source {
    // SAFETY: more wait states than needed are safe at any speed.
    flash.acr().modify(|_, w| unsafe { w.latency().bits(FLASH_WAIT_STATES) });
    while flash.acr().read().latency().bits() != FLASH_WAIT_STATES {}

    let source = start_crystal(rcc);
    let (divider, from_crystal) = match source {
        Source::Crystal => (CRYSTAL_DIVIDER, true),
        Source::RcOscillator => (RC_DIVIDER, false),
    };
    // SAFETY: the values are within their fields and checked above.
    #[expect(clippy::multiple_unsafe_ops_per_block, reason = "one reason for all three")]
    rcc.pllcfgr().write(|w| unsafe {
        w.pllsrc()
            .bit(from_crystal)
            .pllm()
            .bits(divider)
            .plln()
            .bits(MULTIPLIER)
            .pllp()
            .div4()
            .pllq()
            .bits(USB_DIVIDER)
    });
    rcc.cr().modify(|_, w| w.pllon().set_bit());
    while rcc.cr().read().pllrdy().bit_is_clear() {}

    rcc.cfgr().modify(|_, w| w.hpre().div1().ppre1().div8().ppre2().div2());
    rcc.cfgr().modify(|_, w| w.sw().pll());
    while !rcc.cfgr().read().sws().is_pll() {}
    if from_crystal {
        // A crystal that stops raises the non-maskable interrupt.
        rcc.cr().modify(|_, w| w.csson().set_bit());
    }
    source
}

/// Waits until a part whose clock has just been switched on can be written to: a clock of its bus,
/// and one more (device errata, "Delay after an RCC peripheral clock enabling"). An earlier write
/// may be lost.
pub(crate) fn settle() {
    asm::dsb();
    asm::delay(2 * PCLK1_DIVIDER + 2);
}

fn start_crystal(rcc: &RCC) -> Source {
    rcc.cr().modify(|_, w| w.hseon().set_bit());
    if (0..CRYSTAL_LOOKS).any(|_| rcc.cr().read().hserdy().bit_is_set()) {
        return Source::Crystal;
    }
    rcc.cr().modify(|_, w| w.hseon().clear_bit());
    Source::RcOscillator
}
