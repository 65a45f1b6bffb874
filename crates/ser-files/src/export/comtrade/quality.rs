//! The class of a clock's doubt, as COMTRADE and IRIG-B write it.

/// The classes 1 to B: what each is good to, in nanoseconds.
const CLASSES: [(u64, char); 11] = [
    (1, '1'),
    (10, '2'),
    (100, '3'),
    (1_000, '4'),
    (10_000, '5'),
    (100_000, '6'),
    (1_000_000, '7'),
    (10_000_000, '8'),
    (100_000_000, '9'),
    (1_000_000_000, 'A'),
    (10_000_000_000, 'B'),
];

/// The smallest class that holds this doubt, in microseconds; `F` if it is not known or larger.
/// Class 0, locked, is never claimed.
pub(super) fn code(doubt_us: Option<u64>) -> char {
    let Some(ns) = doubt_us.and_then(|us| us.checked_mul(1000)) else { return 'F' };
    CLASSES.iter().find(|(good_to, _)| ns <= *good_to).map_or('F', |&(_, code)| code)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_class_is_rounded_up_and_never_claims_to_be_locked() {
        let doubts = [Some(0), Some(1), Some(800), Some(1000), Some(1001), Some(10_000_001), None];
        assert_eq!(doubts.map(code), ['1', '4', '7', '7', '8', 'F', 'F']);
    }
}
