//! Flash and variables against their budgets.

use crate::checks::outcome::Outcome;
use crate::image::Image;
use crate::limits::Limits;
use crate::sizes::Sizes;

const KIB: u32 = 1024;

/// Checks the flash: code, constants and first values.
pub(super) fn flash(limits: &Limits, image: &Image) -> Outcome {
    against("flash", Sizes::of(image).flash, limits.flash_budget)
}

/// Checks the variables: all writable memory except the stack.
pub(super) fn variables(limits: &Limits, image: &Image) -> Outcome {
    against("variables", Sizes::of(image).variables, limits.variables_budget)
}

/// The outcome of a size against its limit.
pub(super) fn against(what: &'static str, bytes: u32, limit: u32) -> Outcome {
    let result = format!("{} of {} KiB ({} %)", kib(bytes), kib(limit), percent(bytes, limit));
    let wrong = match bytes.checked_sub(limit) {
        Some(over) if over > 0 => vec![format!("{over} bytes too many")],
        _ => vec![],
    };
    Outcome::new(what, result, wrong)
}

/// In KiB with one decimal, rounded up, so that a size is never shown too small.
fn kib(bytes: u32) -> String {
    let tenths = (u64::from(bytes) * 10).div_ceil(KIB.into());
    format!("{}.{}", tenths / 10, tenths % 10)
}

fn percent(bytes: u32, limit: u32) -> u64 {
    (u64::from(bytes) * 100).div_ceil(u64::from(limit.max(1)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_use_is_shown_against_its_limit_and_rounded_up() {
        let within = against("flash", 22_193, 48 * KIB);
        assert_eq!((&*within.result, within.wrong), ("21.7 of 48.0 KiB (46 %)", vec![]));
        let full = against("flash", 48 * KIB, 48 * KIB);
        assert_eq!((&*full.result, full.wrong), ("48.0 of 48.0 KiB (100 %)", vec![]));
    }

    #[test]
    fn a_byte_over_the_limit_is_one_too_many() {
        let over = against("flash", 48 * KIB + 1, 48 * KIB);
        assert_eq!(over.result, "48.1 of 48.0 KiB (101 %)");
        assert_eq!(over.wrong, ["1 bytes too many"]);
    }
}
