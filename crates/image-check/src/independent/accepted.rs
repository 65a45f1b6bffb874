//! The permitted differences of the two decoders, each with its reason. Sections are those of the
//! ARMv7-M manual (DDI 0403E).

use yaxpeax_arm::armv7::Opcode;

use super::theirs::Theirs;
use super::{Difference, PC, SP};
use crate::thumb::is_wide;

/// Whether a reason applies, by the encoding, the other decoder's result and the differences.
type Applies = fn([u16; 2], &Theirs, &[Difference]) -> bool;

/// All reasons.
pub(super) const REASONS: [(&str, Applies); 8] = [
    (
        "eight bits are no address: the walk may forget them, as it does any other value",
        |[first, _], _, differences| {
            first & 0xF800 == 0x2000 && differences == [Difference::Constant]
        },
    ),
    (
        "special registers are others on ARMv7-M (B5.1.1): the two stack pointers and the choice \
         of one",
        |[first, second], _, differences| {
            let is_stack_pointer = matches!(second & 0xFF, 8 | 9 | 20);
            first & 0xFFE0 == 0xF380 && is_stack_pointer && differences == [Difference::Stack]
        },
    ),
    (
        "UNDEFINED: only application processors have such an instruction (A5.3)",
        |[first, _], theirs, _| {
            match theirs.opcode {
                Opcode::RFE(..) | Opcode::SRS(..) | Opcode::BXJ | Opcode::ERET => true,
                // With the address in a register, both processors have it.
                Opcode::BLX => is_wide(first),
                _ => false,
            }
        },
    ),
    (
        "UNPREDICTABLE: a return from an exception of application processors, here a hint with \
         bits \
         that have to be 0 (A5.3.4)",
        |[first, _], theirs, _| theirs.opcode == Opcode::SUB && first & 0xFFF0 == 0xF3D0,
    ),
    (
        "UNPREDICTABLE: it gives the program counter or the stack pointer a value, which of wide \
         instructions only loads of words and sums may (d, t IN {13, 15} throughout A7.7)",
        |[first, _], theirs, _| is_wide(first) && gives_what_it_may_not(theirs),
    ),
    (
        "UNPREDICTABLE: it writes back the program counter, or a register that it loads, too \
         (n == 15, wback && n == t throughout A7.7)",
        |_, theirs, _| theirs.moves.is_some_and(|base| base == PC || theirs.gives >> base & 1 == 1),
    ),
    (
        "UNDEFINED: a store with an index that is neither register nor immediate (A5.3.10), or an \
         immediate that is added afterwards and not written back (A7.7.161)",
        |[first, second], _, _| {
            let is_indexed = first & 0xFF90 == 0xF800 && second & 0x0FC0 != 0;
            is_indexed && (second & 0x0800 == 0 || second & 0x0500 == 0)
        },
    ),
    (
        "UNPREDICTABLE: bits of a table branch that have to be 1 or 0 are not (A7.7.185)",
        |[_, second], theirs, _| {
            matches!(theirs.opcode, Opcode::TBB | Opcode::TBH) && second & 0xFF00 != 0xF000
        },
    ),
];

/// The reason that permits the differences, if there is one.
pub(super) fn reason(
    encoding: [u16; 2],
    theirs: &Theirs,
    differences: &[Difference],
) -> Option<&'static str> {
    let (reason, _) = REASONS.iter().find(|(_, applies)| applies(encoding, theirs, differences))?;
    Some(reason)
}

fn gives_what_it_may_not(theirs: &Theirs) -> bool {
    let gives = |register: u16| theirs.gives >> register & 1 == 1;
    let is_list = matches!(theirs.opcode, Opcode::LDM(..) | Opcode::POP);
    let is_load = theirs.opcode == Opcode::LDR;
    let is_sum = matches!(theirs.opcode, Opcode::ADD | Opcode::SUB);
    gives(SP) && !is_load && !is_sum || gives(PC) && !is_load && !is_list
}
