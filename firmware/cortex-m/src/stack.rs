//! The stack: its place, and how much of it has been in use. The board's linker script sets it
//! aside.

use core::ptr;

use cortex_m_rt::STACK_PAINT_VALUE;

unsafe extern "C" {
    /// Lowest word of the stack.
    static _stack_end: u32;
    /// The word above the stack.
    static _stack_start: u32;
}

/// Lowest address of the stack.
#[inline]
pub fn end() -> usize {
    (&raw const _stack_end).addr()
}

fn start() -> usize {
    (&raw const _stack_start).addr()
}

/// Whether all of `value` lies in the stack. `value` may point anywhere.
#[inline]
pub fn contains<T>(value: *const T) -> bool {
    value.addr() >= end()
        && value.addr().checked_add(size_of::<T>()).is_some_and(|above| above <= start())
}

/// Most bytes of the stack that have been in use since boot.
pub fn high_water() -> usize {
    let mut lowest = &raw const _stack_end;
    // SAFETY: from the stack's lowest word up to the frame of this function there is memory, all of
    // it painted by the start-up code or written since.
    while lowest.addr() < start() && unsafe { ptr::read_volatile(lowest) } == STACK_PAINT_VALUE {
        lowest = lowest.wrapping_add(1);
    }
    start() - lowest.addr()
}
