//! What an interrupt uses all the time and the main loop once in a while.
//!
//! The interrupt pays nothing for it, which a lock of RTIC would cost also in the task of the highest
//! priority. The main loop holds all interrupts off while it uses the thing.

use core::cell::UnsafeCell;

/// Something that belongs to one interrupt, and that the main loop may use while that is held off.
pub struct HeldOff<T>(UnsafeCell<T>);

// SAFETY: `get` is called in one interrupt only, and `with` lets none come.
unsafe impl<T: Send> Sync for HeldOff<T> {}

impl<T> HeldOff<T> {
    /// Belongs to an interrupt from now on.
    pub const fn new(value: T) -> HeldOff<T> {
        HeldOff(UnsafeCell::new(value))
    }

    /// The thing, for the interrupt.
    ///
    /// # Safety
    /// Called in one interrupt only, which can be masked, and once at a time.
    #[inline]
    #[expect(clippy::mut_from_ref, reason = "that is the contract")]
    pub unsafe fn get(&self) -> &mut T {
        // SAFETY: the main loop has no reference, because no interrupt comes while it has one.
        unsafe { &mut *self.0.get() }
    }

    /// Uses the thing in the main loop.
    pub fn with<R>(&self, use_it: impl FnOnce(&mut T) -> R) -> R {
        cortex_m::interrupt::free(|_| {
            // SAFETY: the interrupt does not come, and its reference does not outlive it.
            use_it(unsafe { &mut *self.0.get() })
        })
    }
}
