//! Checks that nothing can panic.

use std::collections::BTreeSet;

use crate::calls::Calls;
use crate::checks::outcome::Outcome;
use crate::image::Image;
use crate::limits::Limits;
use crate::names::is_panic;

/// The functions that end the program on purpose. Calls from them do not count.
pub(crate) fn forced(limits: &Limits, image: &Image) -> BTreeSet<u32> {
    limits.forced.iter().filter_map(|(name, _)| image.function(name)).collect()
}

/// The linker drops what is never referenced, so a function of the panic machinery that is still
/// there can be reached.
pub(super) fn none(limits: &Limits, image: &Image, calls: &Calls<'_>) -> Outcome {
    let forced = forced(limits, image);
    let missing = limits.forced.iter().filter(|(name, _)| image.function(name).is_none());
    let mut wrong: Vec<_> =
        missing.map(|(name, _)| format!("{name} is to panic but is not in the image")).collect();
    // Only the first cause of a panic matters; panics also call each other.
    let is_harmless = |at| {
        let Some((begin, function)) = image.function_around(at) else { return false };
        forced.contains(&begin) || function.names.iter().any(|name| is_panic(name))
    };
    for (&address, function) in &image.functions {
        let Some(name) = function.names.iter().find(|name| is_panic(name)) else { continue };
        let mut callers = calls.calls_of(address).peekable();
        if callers.peek().is_none() {
            wrong.push(format!("{name} is there, but nothing calls it directly"));
        }
        let callers = callers.filter(|call| !is_harmless(call.at));
        let places: Vec<_> =
            callers.map(|call| format!("{} ({:#x})", image.name_of(call.at), call.at)).collect();
        if !places.is_empty() {
            wrong.push(format!("{name} is called by {}", places.join(", ")));
        }
    }
    let result = match (wrong.len(), forced.len()) {
        (0, 0) => "none".to_owned(),
        (0, _) => "only on purpose".to_owned(),
        (count, _) => format!("{count} of them"),
    };
    Outcome::new("ways to panic", result, wrong)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::STM32F407 as BOARD;

    const FMT: &str = "_ZN4core9panicking9panic_fmt17h0123456789abcdefE";
    const BOUNDS: &str = "_ZN4core9panicking18panic_bounds_check17h0123456789abcdefE";
    const CALL_NEXT: [u16; 3] = [0xB510, 0xF000, 0xF800]; // push {r4, lr}; bl
    const CALL_AFTER_NEXT: [u16; 3] = [0xB510, 0xF000, 0xF803];

    fn outcome(limits: &Limits, functions: &[(&str, &[u16])]) -> Outcome {
        let image = Image::of_functions(0x100, functions);
        none(limits, &image, &Calls::of(&image, &forced(limits, &image)))
    }

    #[test]
    fn an_image_without_panics_has_none() {
        let outcome = outcome(&BOARD, &[("main", &[0x4770])]);
        assert_eq!((&*outcome.result, outcome.wrong), ("none", vec![]));
    }

    #[test]
    fn who_calls_a_panic_is_named_and_panics_that_call_each_other_are_not() {
        let outcome =
            outcome(&BOARD, &[("main", &CALL_NEXT), (BOUNDS, &CALL_NEXT), (FMT, &[0xDE00])]);
        assert_eq!(
            outcome.wrong,
            ["core::panicking::panic_bounds_check is called by main+0x2 (0x102)"]
        );
    }

    #[test]
    fn a_panic_that_nothing_seems_to_call_is_one_all_the_same() {
        let outcome = outcome(&BOARD, &[("main", &[0x4770]), ("rust_begin_unwind", &[0xDE00])]);
        assert_eq!(outcome.wrong, ["rust_begin_unwind is there, but nothing calls it directly"]);
    }

    #[test]
    fn a_function_may_panic_on_purpose_and_no_other_one() {
        let board = Limits { forced: &[("force", "a test")], ..BOARD };
        let forced = outcome(&board, &[("force", &CALL_NEXT), (FMT, &[0xDE00])]);
        assert_eq!((&*forced.result, forced.wrong), ("only on purpose", vec![]));
        let both = [("main", &CALL_AFTER_NEXT[..]), ("force", &CALL_NEXT), (FMT, &[0xDE00])];
        let both = outcome(&board, &both);
        assert_eq!(both.wrong, ["core::panicking::panic_fmt is called by main+0x2 (0x102)"]);
        let gone = outcome(&board, &[("main", &[0x4770])]);
        assert_eq!(gone.wrong, ["force is to panic but is not in the image"]);
    }
}
