//! The stack: where it is and how much of it has been in use.

use core::ptr;

use cortex_m_rt::STACK_PAINT_VALUE;

unsafe extern "C" {
    /// Lowest word of the stack.
    static _stack_end: u32;
    /// The word above the stack.
    static _stack_start: u32;
}

/// Whether all of `value` lies in the stack.
#[inline]
pub(crate) fn contains<T>(value: *const T) -> bool {
    let (end, start) = (&raw const _stack_end, &raw const _stack_start);
    value.addr() >= end.addr() && value.wrapping_add(1).addr() <= start.addr()
}

/// Bytes of the stack that have been in use at some time since boot.
pub(crate) fn high_water() -> usize {
    let start = (&raw const _stack_start).addr();
    let mut lowest = &raw const _stack_end;
    // SAFETY: from the stack's lowest word up to the frame of this function there is memory, all of it
    // painted by the start-up code or written since.
    while lowest.addr() < start && unsafe { ptr::read_volatile(lowest) } == STACK_PAINT_VALUE {
        lowest = lowest.wrapping_add(1);
    }
    start - lowest.addr()
}
