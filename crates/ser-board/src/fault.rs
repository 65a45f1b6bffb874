//! What a hard fault was, a stack overflow or something else, and what the registers say about it.
//!
//! The board passes in what the processor shows (ARMv7-M: Cortex-M3, M4, M7). This module
//! interprets it.
//!
//! # Design
//! A stack overflows in three ways.
//!
//! 1. The processor finds no room for the registers that it saves when an interrupt comes.
//! 2. A function moves the stack pointer out of the stack and then writes there. When the processor
//!    takes that fault, it finds no room either.
//! 3. A function writes several registers at once. The write fails as a whole, while the stack
//!    pointer is still in the stack with room above it.
//!
//! Only the third one looks like any other bad access. Its address gives it away: it is right below
//! the stack's end.
//!
//! # Notes
//! An address counts only while its valid bit is set; otherwise the register holds an earlier
//! fault's address, or anything. A processor that delays writes may report them without an address
//! (`IMPRECISERR`). Such a fault gives no place and counts as a hard fault. It does not occur where
//! a memory protection unit watches the stack's end. (ARMv7-M architecture, B3.2.15, B3.2.18.)

use crate::last_words::{Fault, Text};

/// What the processor shows of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Evidence {
    /// The registers that the processor saved; `None` when the stack had no room for them.
    pub saved: Option<SavedRegisters>,
    /// Configurable fault status (CFSR).
    pub status: u32,
    /// Address of a memory management fault (MMFAR).
    pub protected_address: u32,
    /// Address of a bus fault (BFAR).
    pub bus_address: u32,
    /// Lowest address of the stack. Nothing below it can be written.
    pub stack_end: u32,
}

/// Registers that show where the program was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SavedRegisters {
    /// Program counter.
    pub pc: u32,
    /// Link register.
    pub lr: u32,
}

/// Status bits that report a failed saving of registers, floating-point registers included:
/// MSTKERR, MLSPERR, STKERR, LSPERR.
const SAVING_FAILED: u32 = 1 << 4 | 1 << 5 | 1 << 12 | 1 << 13;
/// MMARVALID.
const PROTECTED_ADDRESS_VALID: u32 = 1 << 7;
/// BFARVALID.
const BUS_ADDRESS_VALID: u32 = 1 << 15;

/// How far below the stack's end an access still counts as one of the stack, in bytes. Larger than
/// the largest frame of a function, and small enough to keep clear of null pointers.
pub const BELOW_STACK_LEN: u32 = 4096;

impl Evidence {
    /// The address that could not be accessed, if a valid one is known.
    #[must_use]
    pub const fn address(&self) -> Option<u32> {
        if self.status & PROTECTED_ADDRESS_VALID != 0 {
            Some(self.protected_address)
        } else if self.status & BUS_ADDRESS_VALID != 0 {
            Some(self.bus_address)
        } else {
            None
        }
    }

    /// The kind of fault.
    #[must_use]
    pub fn fault(&self) -> Fault {
        let below = self.stack_end.saturating_sub(BELOW_STACK_LEN)..self.stack_end;
        let is_of_stack = self.address().is_some_and(|address| below.contains(&address));
        if self.saved.is_none() || self.status & SAVING_FAILED != 0 || is_of_stack {
            Fault::StackOverflow
        } else {
            Fault::HardFault
        }
    }

    /// What is known about it, as in `pc 00001234 lr 00001200 status 00008200 address a0000000`.
    #[must_use]
    pub fn text(&self) -> Text {
        let saved = self.saved;
        let parts = [
            ("pc ", saved.map(|saved| saved.pc)),
            ("lr ", saved.map(|saved| saved.lr)),
            ("status ", Some(self.status)),
            ("address ", self.address()),
        ];
        let mut text = Text::EMPTY;
        for (name, value) in parts {
            let Some(value) = value else { continue };
            if !text.as_str().is_empty() {
                text.push_str(" ");
            }
            text.push_str(name);
            text.push_hex(value);
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DACCVIOL: u32 = 1 << 1;
    const MSTKERR: u32 = 1 << 4;
    const MLSPERR: u32 = 1 << 5;
    const PRECISERR: u32 = 1 << 9;
    const IMPRECISERR: u32 = 1 << 10;
    const STKERR: u32 = 1 << 12;
    const LSPERR: u32 = 1 << 13;
    const DIVBYZERO: u32 = 1 << 25;

    const STACK_END: u32 = 0x1000_0000;

    /// Registers are saved; both addresses are left over from earlier.
    const EVIDENCE: Evidence = Evidence {
        saved: Some(SavedRegisters { pc: 0x1234, lr: 0x1201 }),
        status: 0,
        protected_address: STACK_END - 4,
        bus_address: STACK_END - 4,
        stack_end: STACK_END,
    };

    #[test]
    fn an_access_elsewhere_is_a_hard_fault_with_its_address() {
        let bus = PRECISERR | BUS_ADDRESS_VALID;
        let fault = Evidence { status: bus, bus_address: 0xA000_0000, ..EVIDENCE };
        assert_eq!(fault.fault(), Fault::HardFault);
        assert_eq!(
            fault.text().as_str(),
            "pc 00001234 lr 00001201 status 00008200 address a0000000"
        );
        let protection = DACCVIOL | PROTECTED_ADDRESS_VALID;
        let fault = Evidence { status: protection, protected_address: 8, ..EVIDENCE };
        assert_eq!((fault.fault(), fault.address()), (Fault::HardFault, Some(8)), "a null pointer");
    }

    #[test]
    fn an_address_that_is_not_valid_is_neither_told_nor_believed() {
        for status in [0, DIVBYZERO, IMPRECISERR, PRECISERR, DACCVIOL] {
            let fault = Evidence { status, ..EVIDENCE };
            assert_eq!((fault.fault(), fault.address()), (Fault::HardFault, None), "{status:08x}");
        }
        let division = Evidence { status: DIVBYZERO, ..EVIDENCE };
        assert_eq!(division.text().as_str(), "pc 00001234 lr 00001201 status 02000000");
    }

    #[test]
    fn each_address_has_a_valid_bit_of_its_own() {
        let both = Evidence { protected_address: 1, bus_address: 2, ..EVIDENCE };
        assert_eq!(Evidence { status: PROTECTED_ADDRESS_VALID, ..both }.address(), Some(1));
        assert_eq!(Evidence { status: BUS_ADDRESS_VALID, ..both }.address(), Some(2));
    }

    #[test]
    fn a_stack_without_room_for_the_registers_has_run_out() {
        let none = Evidence { saved: None, status: STKERR, ..EVIDENCE };
        assert_eq!((none.fault(), none.text().as_str()), (Fault::StackOverflow, "status 00001000"));
        for status in [STKERR, MSTKERR, LSPERR, MLSPERR] {
            assert_eq!(
                Evidence { status, ..EVIDENCE }.fault(),
                Fault::StackOverflow,
                "{status:08x}"
            );
        }
    }

    #[test]
    fn a_store_right_below_the_stack_is_one_that_has_run_out_though_registers_are_saved() {
        let stores = [
            (DACCVIOL | PROTECTED_ADDRESS_VALID, Evidence { bus_address: 0, ..EVIDENCE }),
            (PRECISERR | BUS_ADDRESS_VALID, Evidence { protected_address: 0, ..EVIDENCE }),
        ];
        for (status, store) in stores {
            let store = Evidence { status, ..store };
            assert_eq!(
                (store.fault(), store.address()),
                (Fault::StackOverflow, Some(STACK_END - 4))
            );
            assert!(store.text().as_str().starts_with("pc 00001234 lr 00001201 status "));
        }
    }

    #[test]
    fn only_what_is_right_below_is_of_the_stack() {
        let status = DACCVIOL | PROTECTED_ADDRESS_VALID;
        let at = |protected_address| Evidence { status, protected_address, ..EVIDENCE }.fault();
        let stack_of = |address| at(address) == Fault::StackOverflow;
        assert!(stack_of(STACK_END - 1) && stack_of(STACK_END - BELOW_STACK_LEN));
        assert!(!stack_of(STACK_END) && !stack_of(STACK_END - BELOW_STACK_LEN - 1));
        // A stack at the start of all memory has nothing below it.
        let low = Evidence { status, protected_address: u32::MAX, stack_end: 8, ..EVIDENCE };
        assert_eq!(low.fault(), Fault::HardFault);
    }
}
