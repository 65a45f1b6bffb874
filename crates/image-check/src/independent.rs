//! Our instruction decoder against an independent one, `yaxpeax-arm`.
//!
//! If both know an instruction, they must agree on its length, its flow, its effect on the stack
//! pointer and the constant that it loads. Ours must also forget every register that the other one
//! sees written. [`accepted`] lists the permitted differences, each with its reason.

mod accepted;
mod encodings;
mod images;
mod theirs;

use theirs::Theirs;

use crate::thumb::{Instruction, decode};

const SP: u16 = 13;
const PC: u16 = 15;

/// The outcome for an instruction.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Verdict {
    Agreed,
    /// The other decoder knows no such instruction.
    Unknown,
    /// They differ, for this accepted reason.
    Accepted(&'static str),
    /// They differ, as described.
    Differs(String),
}

/// The respects in which they can differ.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Difference {
    Length,
    Flow,
    Stack,
    Constant,
    /// A register changes, but ours assumes that it keeps its value.
    Changes,
}

/// Compares both decoders on an instruction.
fn compare(address: u32, first: u16, second: u16) -> Verdict {
    let ours = decode(address, first, second);
    let Some(theirs) = Theirs::of(address, first, second) else { return Verdict::Unknown };
    let differences = differences(&ours, &theirs);
    if differences.is_empty() {
        return Verdict::Agreed;
    }
    match accepted::reason([first, second], &theirs, &differences) {
        Some(reason) => Verdict::Accepted(reason),
        None => Verdict::Differs(format!(
            "{first:04x} {second:04x} {}: {differences:?}\n  ours   {ours:x?}\n  theirs \
             {theirs:x?}",
            theirs.text
        )),
    }
}

fn differences(ours: &Instruction, theirs: &Theirs) -> Vec<Difference> {
    let written = theirs.moves.map_or(theirs.gives, |base| theirs.gives | 1 << base);
    // The stack pointer and the program counter are compared as stack and flow.
    let apart = 1 << SP | 1 << PC;
    let all = [
        (Difference::Length, ours.length == theirs.length),
        (Difference::Flow, ours.flow == theirs.flow),
        (Difference::Stack, ours.stack == theirs.stack),
        (Difference::Constant, ours.constant == theirs.constant),
        (Difference::Changes, written & !(ours.changes | apart) == 0),
    ];
    all.into_iter().filter(|(_, same)| !same).map(|(difference, _)| difference).collect()
}
