//! Checks that nothing which runs while the flash is being erased leads into flash.

use std::collections::BTreeSet;

use crate::calls::Calls;
use crate::checks::outcome::Outcome;
use crate::image::{Image, Piece};
use crate::limits::Limits;

/// The start of RAM. Below it processors of this family have flash, and other memory without code.
const RAM_BEGINS: u32 = 0x2000_0000;

/// Everything that the handlers and the functions named by the board can reach must be in RAM: what
/// they call, and the constants that they read.
pub(super) fn while_erasing(limits: &Limits, image: &Image, calls: &Calls<'_>) -> Outcome {
    const WHAT: &str = "while flash is erased";
    if limits.while_erasing.is_empty() {
        return Outcome::new(WHAT, "", vec![]);
    }
    let mut wrong = Vec::new();
    // The first vector is that of reset, which begins in flash.
    let mut roots: BTreeSet<u32> =
        image.vectors().into_iter().flat_map(|(_, vectors)| vectors.into_iter().skip(1)).collect();
    for name in limits.while_erasing {
        match image.function(name) {
            Some(function) => _ = roots.insert(function),
            None => wrong.push(format!("there is no function {name}")),
        }
    }
    let reached = calls.reachable(roots);
    for &function in &reached {
        if function < RAM_BEGINS {
            let name = image.name_of(function);
            match calls.calls_of(function).find(|call| call.at >= RAM_BEGINS) {
                Some(call) => {
                    wrong.push(format!("{name} is in flash; {} calls it", image.name_of(call.at)));
                }
                None => wrong.push(format!("{name} is in flash")),
            }
        }
        let constants = calls.walk(function).into_iter().flat_map(|walk| &walk.constants);
        for &constant in constants.filter(|constant| in_flash(image, **constant)) {
            wrong.push(format!(
                "{} has an address in flash, {constant:#010x}",
                image.name_of(function)
            ));
        }
    }
    let result = if wrong.is_empty() {
        format!("{} functions, all in RAM", reached.len())
    } else {
        format!("{} ways into flash", wrong.len())
    };
    Outcome::new(WHAT, result, wrong)
}

/// Whether the image has something in flash at this address. Other contents of the flash are not
/// the program's: the configuration, which is read only while nothing is erased.
fn in_flash(image: &Image, address: u32) -> bool {
    let holds = |piece: &Piece| !piece.bytes.is_empty() && piece.addresses().contains(&address);
    address < RAM_BEGINS && image.pieces.iter().any(holds)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::{MPS2_AN385, STM32F407};

    const BX_LR: u16 = 0x4770;
    const PUSH: u16 = 0xB510; // {r4, lr}
    const POP: u16 = 0xBD10; // {r4, pc}

    /// `main` and a handler in RAM, `flashed` in flash.
    fn outcome(main: &[u16], handler: &[u16]) -> Outcome {
        let image = Image::of_functions(RAM_BEGINS, &[("main", main), ("Tick", handler)]);
        let flash = Image::of_functions(0x0800_0000, &[("flashed", &[BX_LR, 0xBF00])]);
        let (main, tick) = (image.function("main").unwrap(), image.function("Tick").unwrap());
        let image = image.with_vectors(&[0, 0x0800_0001, tick | 1, main | 1]).joined_with(flash);
        while_erasing(&STM32F407, &image, &Calls::of(&image, &BTreeSet::new()))
    }

    #[test]
    fn a_board_that_erases_nothing_is_not_asked() {
        let image = Image::of_functions(0, &[("main", &[BX_LR])]);
        let outcome = while_erasing(&MPS2_AN385, &image, &Calls::of(&image, &BTreeSet::new()));
        assert_eq!((&*outcome.result, outcome.wrong), ("", vec![]));
    }

    #[test]
    fn what_begins_in_flash_and_goes_on_in_ram_is_fine() {
        let outcome = outcome(&[BX_LR], &[PUSH, POP]);
        assert_eq!((&*outcome.result, outcome.wrong), ("2 functions, all in RAM", vec![]));
    }

    #[test]
    fn a_call_into_flash_is_found_and_so_is_an_address() {
        // movw r3, #1; movt r3, #0x800; push; blx r3; pop
        let calls = [0xF240, 0x0301, 0xF6C0, 0x0300, PUSH, 0x4798, POP];
        let outcome_of_call = outcome(&[BX_LR], &calls);
        assert_eq!(
            outcome_of_call.wrong,
            ["flashed is in flash; Tick+0xa calls it", "Tick has an address in flash, 0x08000001"]
        );
        // mov.w r3, #0x8000000; bx lr
        let reads = outcome(&[0xF04F, 0x6300, BX_LR], &[BX_LR]);
        assert_eq!(reads.wrong, ["main has an address in flash, 0x08000000"]);
    }

    #[test]
    fn an_address_in_flash_where_the_program_has_nothing_is_fine() {
        // mov.w r3, #0x8008000; bx lr: the configuration
        let outcome = outcome(&[0xF640, 0x0300, 0xF6C0, 0x0300, BX_LR], &[BX_LR]);
        assert_eq!(outcome.wrong, Vec::<String>::new());
    }
}
