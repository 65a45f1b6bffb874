//! Names of functions, and which of them belong to a panic.
//!
//! The linker drops what is never referenced. An image without any of these functions cannot panic.

/// A symbol's name as the source has it, without the hash.
pub(crate) fn as_in_source(symbol: &str) -> String {
    format!("{:#}", rustc_demangle::demangle(symbol))
}

/// Crates of the standard library, in which every panic begins, even an explicit one.
const LIBRARIES: [&str; 3] = ["core", "alloc", "std"];

/// Where a panic ends: the image's handler, or that of the log.
const HANDLERS: [&str; 4] =
    ["rust_begin_unwind", "rust_panic", "_defmt_panic", "__defmt_default_panic"];

/// Whether a function exists only to panic. `name` is as in the source.
pub(crate) fn is_panic(name: &str) -> bool {
    let segments: Vec<&str> = name.trim_start_matches('<').split("::").collect();
    let (Some(first), Some(last)) = (segments.first(), segments.last()) else { return false };
    HANDLERS.contains(last) || LIBRARIES.contains(first) && segments.into_iter().any(panics)
}

/// Whether a module or function of the library exists only to panic, by its name.
fn panics(segment: &str) -> bool {
    // The modules `panic` and `panic_info` hold a panic's description, which is harmless.
    let begins = segment.starts_with("panic_") && segment != "panic_info";
    let others = ["panicking", "do_panic", "handle_alloc_error", "capacity_overflow"];
    begins || segment.contains("_fail") || others.contains(&segment)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panics_are_known_in_both_manglings() {
        let symbols = [
            "_ZN4core9panicking18panic_bounds_check17h0123456789abcdefE",
            "_ZN4core9panicking9panic_fmt17h0123456789abcdefE",
            "_ZN4core9panicking11panic_const23panic_const_rem_by_zero17h0123456789abcdefE",
            "_ZN4core6option13unwrap_failed17h0123456789abcdefE",
            "_ZN4core6option13expect_failed17h0123456789abcdefE",
            "_ZN4core6result13unwrap_failed17h0123456789abcdefE",
            "_ZN4core4cell22panic_already_borrowed17h0123456789abcdefE",
            "_RNvNtCs2fZl91Oq0qp_4core9panicking5panic",
            "_RNvNtCs2fZl91Oq0qp_4core6option13unwrap_failed",
            "_RNvNtNtCs2fZl91Oq0qp_4core5slice5index16slice_index_fail",
            "_RNvCsfLfy6EI15iL_7___rustc17rust_begin_unwind",
            "rust_begin_unwind",
            "_ZN5alloc7raw_vec17capacity_overflow17h0123456789abcdefE",
            "_defmt_panic",
        ];
        for symbol in symbols {
            assert!(is_panic(&as_in_source(symbol)), "{symbol}: {}", as_in_source(symbol));
        }
    }

    #[test]
    fn what_only_sounds_like_a_panic_is_none() {
        let symbols = [
            "_ZN4core3fmt9Formatter12pad_integral17h0123456789abcdefE",
            "_ZN4core5panic10panic_info9PanicInfo7message17h0123456789abcdefE",
            "_ZN4geni6driver13command_failed17h0123456789abcdefE",
            "_RNvNtNtCseL1MqMlhvy0_17compiler_builtins3mem6memcpy",
            "_ZN8ser_node7capture7Capture7make_up17hbc130e6690dead16E",
            "TIMER0",
        ];
        for symbol in symbols {
            assert!(!is_panic(&as_in_source(symbol)), "{symbol}: {}", as_in_source(symbol));
        }
    }
}
