//! What the images have in common because of their processors, Cortex-M3 and Cortex-M4F alike: what
//! ends a run, what is left of it, and what the program is kept from.
//!
//! Everything here touches memory or registers of the processor itself. Everything that does not is
//! in `ser_board`.
#![no_std]

pub mod hard_fault;
pub mod held_off;
pub mod last_words;
pub mod protection;
pub mod stack;

#[doc(hidden)]
pub use cortex_m_rt::ExceptionFrame;
