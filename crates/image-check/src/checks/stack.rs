//! The stack: how deep it can get, and what happens if it gets deeper.
//!
//! # Design
//! The worst case is the deepest path of the main program, interrupted there by every handler at
//! its deepest, each with the registers that the processor saves for it. For a handler with its own
//! stack, only the saved registers count.
//!
//! # Tradeoffs
//! Priorities are ignored: handlers of the same priority cannot interrupt each other, so the sum is
//! too large for them. With one handler per priority it is exact.

use crate::calls::{Calls, Deepest};
use crate::checks::memory::against;
use crate::checks::outcome::Outcome;
use crate::image::Image;
use crate::limits::Limits;

/// Registers that the processor saves when it takes an exception (DDI 0403E, B1.5.6): r0–r3, r12,
/// lr, pc, xPSR, …
const SAVED_BYTES: u32 = 8 * 4;
/// The same with the registers of the floating-point unit. Room for these is made whether or not
/// they are saved later.
const SAVED_FLOATING_POINT_BYTES: u32 = 26 * 4;
/// The saved registers begin at an address that is a multiple of eight.
const ALIGNMENT_BYTES: u32 = 4;

/// Places in the vector table, from reset on.
const RESET: usize = 0;
const NON_MASKABLE: usize = 1;
const HARD_FAULT: usize = 2;

/// The most stack that one part of the program uses.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Share {
    /// Its index in the vector table, from reset on.
    vector: usize,
    /// Bytes that the processor saves before it begins, on the stack that it finds.
    pub(crate) saved: u32,
    pub(crate) deepest: Deepest,
}

impl Share {
    /// Bytes that it uses of the stack that it finds.
    pub(crate) fn bytes(&self) -> u32 {
        let own = if self.deepest.other_stack.is_none() { self.deepest.bytes } else { 0 };
        self.saved.saturating_add(own)
    }
}

/// The main program's share, and then that of each handler.
///
/// # Errors
/// What cannot be bounded, in words.
pub(crate) fn shares(image: &Image, calls: &Calls<'_>) -> Result<Vec<Share>, Vec<String>> {
    let Some((_, vectors)) = image.vectors() else {
        return Err(vec!["there is no vector table".to_owned()]);
    };
    let floating_point = calls.walks().any(|(_, walk)| walk.floating_point);
    let saved =
        if floating_point { SAVED_FLOATING_POINT_BYTES } else { SAVED_BYTES } + ALIGNMENT_BYTES;
    let mut shares: Vec<Share> = Vec::new();
    let mut unbounded = Vec::new();
    for (vector, &function) in vectors.iter().enumerate() {
        if vectors.iter().take(vector).any(|&earlier| earlier == function) {
            continue;
        }
        let saved = if vector == RESET { 0 } else { saved };
        match calls.deepest(function) {
            // Only for the hard fault handler is it known what may interrupt it on its own stack.
            Ok(Deepest { other_stack: Some(_), .. }) if vector != HARD_FAULT => {
                unbounded.push(format!("{} changes the stack", image.name_of(function)));
            }
            Ok(deepest) => shares.push(Share { vector, saved, deepest }),
            Err(why) => unbounded.push(calls.explain(&why)),
        }
    }
    unbounded.dedup();
    if unbounded.is_empty() { Ok(shares) } else { Err(unbounded) }
}

/// The worst case in bytes: the main program at its deepest, interrupted there by every handler at
/// its deepest.
///
/// # Errors
/// What cannot be bounded, in words.
pub(crate) fn bound(image: &Image, calls: &Calls<'_>) -> Result<u32, Vec<String>> {
    Ok(together(&shares(image, calls)?))
}

/// The sum of all shares.
pub(crate) fn together(shares: &[Share]) -> u32 {
    shares.iter().map(Share::bytes).fold(0, u32::saturating_add)
}

/// Checks the worst case against the stack in the memory map.
pub(super) fn depth(image: &Image, calls: &Calls<'_>) -> Outcome {
    const WHAT: &str = "stack at its deepest";
    let (Some(start), Some(end)) = (image.symbol("_stack_start"), image.symbol("_stack_end"))
    else {
        return Outcome::new(WHAT, "?", vec!["_stack_start or _stack_end is missing".to_owned()]);
    };
    match bound(image, calls) {
        Ok(bound) => against(WHAT, bound, start.saturating_sub(end)),
        Err(unbounded) => Outcome::new(WHAT, "no bound", unbounded),
    }
}

/// Checks the hard fault handler's own stack, if it has one. Only the non-maskable interrupt can
/// interrupt the handler there.
pub(super) fn fault_handler(image: &Image, calls: &Calls<'_>) -> Outcome {
    const WHAT: &str = "hard fault's own stack";
    let shares = shares(image, calls).unwrap_or_default();
    let own =
        shares.iter().find_map(|share| Some((share.deepest.bytes, share.deepest.other_stack?)));
    let Some((bytes, top)) = own else { return Outcome::new(WHAT, "", vec![]) };
    let interrupted =
        shares.iter().find(|share| share.vector == NON_MASKABLE).map_or(0, Share::bytes);
    match image.size_of_object_before(top) {
        Some(size) => against(WHAT, bytes.saturating_add(interrupted), size),
        None => Outcome::new(
            WHAT,
            "?",
            vec![format!("it begins at {top:#010x}, where no variable ends")],
        ),
    }
}

/// Checks that a stack which gets too deep runs into a fault and not into variables.
pub(super) fn overflow(limits: &Limits, image: &Image) -> Outcome {
    let mut wrong = Vec::new();
    let (start, end) = (image.symbol("_stack_start"), image.symbol("_stack_end"));
    if end != Some(limits.stack_floor) {
        wrong.push(format!("the stack ends at {}, but there is memory below it", shown(end)));
    }
    if image.vectors().map(|(stack, _)| stack) != start {
        wrong.push(format!(
            "the vector table does not begin with the stack's start, {}",
            shown(start)
        ));
    }
    let stack = end.unwrap_or(0)..start.unwrap_or(u32::MAX);
    for piece in &image.pieces {
        if piece.addresses().start < stack.end && stack.start < piece.addresses().end {
            wrong.push(format!("{} lies in the stack", piece.name));
        }
    }
    let result = if wrong.is_empty() { "ends in a fault" } else { "can do harm" };
    Outcome::new("stack overflow", result, wrong)
}

fn shown(address: Option<u32>) -> String {
    address.map_or("?".to_owned(), |address| format!("{address:#010x}"))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::limits::STM32F407 as BOARD;

    const PUSH: u16 = 0xB510; // {r4, lr}
    const POP: u16 = 0xBD10; // {r4, pc}
    const BX_LR: u16 = 0x4770;
    const VPUSH: [u16; 2] = [0xED2D, 0x8B04]; // {d8, d9}
    const VPOP: [u16; 2] = [0xECBD, 0x8B04];

    /// An image whose stack has 256 bytes and begins where the board's memory does.
    fn image(functions: &[(&str, &[u16])], vectors: &[&str]) -> Image {
        let image = Image::of_functions(0x2000_0000, functions);
        let vectors: Vec<_> =
            vectors.iter().map(|name| image.function(name).unwrap() | 1).collect();
        let floor = BOARD.stack_floor;
        image.with_vectors(&[&[floor + 256], &vectors[..]].concat()).with_stack(floor, floor + 256)
    }

    fn depth_of(image: &Image) -> Outcome {
        depth(image, &Calls::of(image, &BTreeSet::new()))
    }

    #[test]
    fn the_main_program_and_all_handlers_add_up_once_each() {
        let functions: [(&str, &[u16]); 3] =
            [("Reset", &[PUSH, POP]), ("Idle", &[BX_LR]), ("Tick", &[PUSH, PUSH, 0xB004, BX_LR])];
        let image = image(&functions, &["Reset", "Idle", "Tick", "Tick"]);
        let shares = shares(&image, &Calls::of(&image, &BTreeSet::new())).unwrap();
        let bytes: Vec<_> = shares.iter().map(|share| (share.saved, share.deepest.bytes)).collect();
        assert_eq!(bytes, [(0, 8), (36, 0), (36, 16)]);
        assert_eq!(depth_of(&image).result, "0.1 of 0.3 KiB (38 %)");
        assert_eq!(bound(&image, &Calls::of(&image, &BTreeSet::new())), Ok(8 + 36 + 36 + 16));
    }

    #[test]
    fn with_floating_point_the_processor_saves_more() {
        let code = [&VPUSH[..], &VPOP[..], &[BX_LR]].concat();
        let image = image(&[("Reset", &code), ("Tick", &[BX_LR])], &["Reset", "Tick"]);
        let shares = shares(&image, &Calls::of(&image, &BTreeSet::new())).unwrap();
        assert_eq!(shares[1].saved, 108);
    }

    #[test]
    fn a_stack_that_is_not_deep_enough_is_wrong() {
        // sub sp, #252; add sp, #252 below 4 more handlers than fit
        let functions: [(&str, &[u16]); 2] =
            [("Reset", &[0xB0BF, 0xB03F, BX_LR]), ("Tick", &[BX_LR])];
        let image = image(&functions, &["Reset", "Tick"]);
        assert_eq!(depth_of(&image).wrong, ["32 bytes too many"]);
    }

    #[test]
    fn the_hard_fault_handler_may_have_a_stack_of_its_own() {
        // movw r1, #0x400; movt r1, #0x2000; msr msp, r1; push; pop
        let hard_fault = [0xF240, 0x4100, 0xF2C2, 0x0100, 0xF381, 0x8808, PUSH, POP];
        let functions: [(&str, &[u16]); 3] =
            [("Reset", &[BX_LR]), ("NonMaskableInt", &[PUSH, POP]), ("HardFault", &hard_fault)];
        let image = image(&functions, &["Reset", "NonMaskableInt", "HardFault"]);
        let calls = Calls::of(&image, &BTreeSet::new());
        // The registers saved for two handlers, and 8 bytes of one of them.
        assert_eq!(depth_of(&image).result, "0.1 of 0.3 KiB (32 %)");
        assert_eq!(
            fault_handler(&image, &calls).wrong,
            ["it begins at 0x20000400, where no variable ends"]
        );
        let image = image.with_object(0x2000_0380, 0x80);
        let calls = Calls::of(&image, &BTreeSet::new());
        // 8 bytes of its own, 44 of the other handler.
        assert_eq!(fault_handler(&image, &calls).result, "0.1 of 0.2 KiB (41 %)");
    }

    #[test]
    fn a_stack_above_the_variables_can_do_harm() {
        let good = image(&[("Reset", &[BX_LR])], &["Reset"]);
        assert_eq!(overflow(&BOARD, &good).wrong, Vec::<String>::new());
        let floor = BOARD.stack_floor + 0x100;
        let moved = image(&[("Reset", &[BX_LR])], &["Reset"]).with_stack(floor, floor + 256);
        assert_eq!(
            overflow(&BOARD, &moved).wrong,
            [
                "the stack ends at 0x10000100, but there is memory below it",
                "the vector table does not begin with the stack's start, 0x10000200"
            ]
        );
        let over_code =
            image(&[("Reset", &[BX_LR])], &["Reset"]).with_stack(0x1000_0000, 0x2000_0002);
        assert!(overflow(&BOARD, &over_code).wrong.contains(&".text lies in the stack".to_owned()));
    }
}
