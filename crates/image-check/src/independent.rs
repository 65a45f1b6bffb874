//! Our decoder of instructions against an independent one, `yaxpeax-arm`.
//!
//! Wherever both know an instruction, they have to agree on its length, where it goes, what it does
//! to the stack pointer, and which constant it loads; and ours has to forget every register that
//! the other one sees written. [`accepted`] lists what they may differ in, each with the reason.

mod accepted;
mod encodings;
mod images;
mod theirs;

use theirs::Theirs;

use crate::thumb::{Instruction, decode};

const SP: u16 = 13;
const PC: u16 = 15;

/// What became of an instruction.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Verdict {
    Agreed,
    /// They know no such instruction.
    Unknown,
    /// They differ, for this reason.
    Accepted(&'static str),
    /// They differ, as told.
    Differs(String),
}

/// What they can differ in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Difference {
    Length,
    Flow,
    Stack,
    Constant,
    /// A register changes that ours takes to keep its value.
    Changes,
}

/// Asks both about an instruction.
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
    // What becomes of these two is compared as the stack and as the flow.
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
