//! Facts about the chip from ARM's application note AN385: interrupt numbers, clock, addresses.
//!
//! Replaces a generated device crate. The few registers in use are described where they are driven.

use cortex_m::interrupt::InterruptNumber;

/// Clock of processor and peripherals.
pub(crate) const CLOCK_HZ: u32 = 25_000_000;

/// Base addresses of the peripherals.
pub(crate) mod base {
    /// Timer of the capture interrupt.
    pub(crate) const TIMER0: usize = 0x4000_0000;
    /// Free-running timer.
    pub(crate) const TIMER1: usize = 0x4000_1000;
    /// RS-232.
    pub(crate) const UART0: usize = 0x4000_4000;
    /// Log.
    pub(crate) const UART1: usize = 0x4000_5000;
    /// Watchdog.
    pub(crate) const WATCHDOG: usize = 0x4000_8000;
    /// External bus: 16 MiB.
    pub(crate) const EXTERNAL_BUS: usize = 0x2100_0000;
}

/// Number of bits in an interrupt priority.
pub(crate) const NVIC_PRIO_BITS: u8 = 3;

/// The interrupts in use.
#[derive(Clone, Copy)]
#[repr(u16)]
#[expect(non_camel_case_types, reason = "RTIC takes the names of the tasks' interrupts from here")]
pub(crate) enum Interrupt {
    /// A byte has arrived.
    UART0_RX = 0,
    /// The transmitter has room.
    UART0_TX = 1,
    /// A millisecond is over.
    TIMER0 = 8,
}

pub(crate) use Interrupt as interrupt;

// SAFETY: every variant has a number of its own, and it is the one that the chip uses.
unsafe impl InterruptNumber for Interrupt {
    fn number(self) -> u16 {
        self as u16
    }
}

/// One entry of the vector table.
#[derive(Clone, Copy)]
#[repr(C)]
pub(crate) union Vector {
    handler: unsafe extern "C" fn(),
    reserved: usize,
}

unsafe extern "C" {
    fn UART0_RX();
    fn UART0_TX();
    fn TIMER0();
    fn DefaultHandler();
}

/// The chip's part of the vector table.
#[unsafe(no_mangle)]
#[unsafe(link_section = ".vector_table.interrupts")]
pub(crate) static __INTERRUPTS: [Vector; 32] = {
    let mut table = [Vector { handler: DefaultHandler }; 32];
    table[Interrupt::UART0_RX as usize] = Vector { handler: UART0_RX };
    table[Interrupt::UART0_TX as usize] = Vector { handler: UART0_TX };
    table[Interrupt::TIMER0 as usize] = Vector { handler: TIMER0 };
    table
};
