//! Differences of a millisecond count that wraps.

/// Milliseconds from `since_ms` to `now_ms`.
///
/// A count that seems to lie half the range ahead comes from a clock that went back a little; no
/// time has passed then.
pub(crate) fn elapsed_ms(now_ms: u32, since_ms: u32) -> u32 {
    let elapsed = now_ms.wrapping_sub(since_ms);
    if elapsed > u32::MAX / 2 { 0 } else { elapsed }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wraps_and_does_not_run_backwards() {
        assert_eq!(elapsed_ms(5, u32::MAX - 4), 10);
        assert_eq!(elapsed_ms(100, 101), 0);
        assert_eq!(elapsed_ms(101, 100), 1);
    }
}
