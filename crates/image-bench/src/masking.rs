//! Instructions that write the registers that mask interrupts.
//!
//! `CPSID` and `CPSIE` say in their own bits what they do. What `MSR` writes is in a register,
//! which a trace of addresses does not show. An image may therefore use `MSR` only to restore what
//! was in force before. Anything else could mask capture without the trace showing it.

use std::ops::Range;

/// PRIMASK, BASEPRI, `BASEPRI_MAX`, FAULTMASK (ARMv7-M Architecture Reference Manual, B5.1.1).
const MASKING: Range<u16> = 0x10..0x14;

/// A transfer between a masking register and one of the processor's own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Transfer {
    at: u32,
    special: u16,
    register: u16,
}

/// The transfers in an image.
#[derive(Debug, Default)]
pub(super) struct Masking {
    reads: Vec<Transfer>,
    /// Transfers that do not write a 0, which would mask nothing.
    writes: Vec<Transfer>,
}

impl Masking {
    /// Notes an instruction if it is such a transfer. `before` is the first half of the instruction
    /// in front of it.
    pub(super) fn note(&mut self, at: u32, before: u16, first: u16, second: Option<u16>) {
        let Some(second) = second else { return };
        let special = second & 0xFF;
        if !MASKING.contains(&special) {
            return;
        }
        match (first, second & 0xF000) {
            // MRS Rd, special.
            (0xF3EF, 0x8000) => {
                self.reads.push(Transfer { at, special, register: second >> 8 & 0xF });
            }
            // MSR special, Rn.
            (0xF380..=0xF38F, 0x8000) => {
                let register = first & 0xF;
                let clears = before == 0x2000 | register << 8;
                if !clears {
                    self.writes.push(Transfer { at, special, register });
                }
            }
            _ => {}
        }
    }

    /// The first instruction that may mask more than before. `function_around` gives the bounds of
    /// functions.
    ///
    /// An instruction only restores if it writes a register into which its function has read the
    /// same masking register.
    pub(super) fn unseen(&self, function_around: impl Fn(u32) -> Range<u32>) -> Option<u32> {
        let gives_back = |write: &&Transfer| {
            let function = function_around(write.at);
            self.reads.iter().any(|read| {
                function.contains(&read.at)
                    && read.at < write.at
                    && (read.special, read.register) == (write.special, write.register)
            })
        };
        self.writes.iter().find(|write| !gives_back(write)).map(|write| write.at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const READ_BASEPRI_TO_R10: [u16; 2] = [0xF3EF, 0x8A11];

    /// The first instruction that masks unseen, in a row of wide instructions.
    fn unseen(code: &[[u16; 2]]) -> Option<u32> {
        let mut masking = Masking::default();
        let mut before = 0;
        for (at, &[first, second]) in (0x100..).step_by(4).zip(code) {
            masking.note(at, before, first, Some(second));
            before = first;
        }
        masking.unseen(|_| 0x100..0x200)
    }

    #[test]
    fn what_gives_back_what_was_in_force_masks_nothing() {
        assert_eq!(unseen(&[READ_BASEPRI_TO_R10, [0xF38A, 0x8811]]), None);
        // The cases: another register, another special register, the wrong order, and nothing read
        // at all. BASEPRI_MAX reads as BASEPRI.
        assert_eq!(unseen(&[READ_BASEPRI_TO_R10, [0xF38B, 0x8811]]), Some(0x104));
        assert_eq!(unseen(&[READ_BASEPRI_TO_R10, [0xF38A, 0x8810]]), Some(0x104));
        assert_eq!(unseen(&[[0xF38A, 0x8811], READ_BASEPRI_TO_R10]), Some(0x100));
        for special in MASKING {
            assert_eq!(unseen(&[[0xF380, 0x8800 | special]]), Some(0x100));
        }
        // MSP does not mask.
        assert_eq!(unseen(&[[0xF381, 0x8808]]), None);
    }

    #[test]
    fn a_zero_masks_nothing() {
        let written = |before| {
            let mut masking = Masking::default();
            masking.note(0x102, before, 0xF380, Some(0x8811));
            masking.unseen(|_| 0x100..0x200)
        };
        assert_eq!(
            (written(0x2000), written(0x2001), written(0x2100)),
            (None, Some(0x102), Some(0x102))
        );
    }
}
