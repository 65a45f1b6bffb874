//! All instructions of 16 bits, and a sample of those of 32 bits.

use std::collections::BTreeMap;

use super::accepted::REASONS;
use super::{Verdict, compare};

const AT: u32 = 0x1002;

/// The first halfword of wide instructions is at least this.
const WIDE: u16 = 0xE800;

/// How many second halfwords are tried with each first one.
const SECONDS: u16 = 256;

/// How many differences are shown.
const SHOWN: usize = 10;

#[derive(Debug, Default)]
struct Tally {
    agreed: u32,
    unknown: u32,
    accepted: BTreeMap<&'static str, u32>,
    differs: Vec<String>,
}

impl Tally {
    fn of(encodings: impl Iterator<Item = (u16, u16)>) -> Tally {
        let mut tally = Tally::default();
        for (first, second) in encodings {
            match compare(AT, first, second) {
                Verdict::Agreed => tally.agreed += 1,
                Verdict::Unknown => tally.unknown += 1,
                Verdict::Accepted(reason) => *tally.accepted.entry(reason).or_default() += 1,
                Verdict::Differs(how) => tally.differs.push(how),
            }
        }
        tally
    }

    fn assert_no_difference(&self) {
        let shown: Vec<&str> = self.differs.iter().take(SHOWN).map(String::as_str).collect();
        assert!(
            shown.is_empty(),
            "{} differences, such as:\n{}",
            self.differs.len(),
            shown.join("\n")
        );
    }
}

fn narrow() -> impl Iterator<Item = (u16, u16)> {
    (0..WIDE).map(|first| (first, 0))
}

/// Two odd numbers as steps eventually reach all second halfwords, and different ones for each
/// first halfword.
fn wide() -> impl Iterator<Item = (u16, u16)> {
    let seconds = |first: u16| {
        (0..SECONDS)
            .map(move |count| count.wrapping_mul(40_503).wrapping_add(first.wrapping_mul(25_173)))
    };
    (WIDE..=u16::MAX).flat_map(move |first| seconds(first).map(move |second| (first, second)))
}

#[test]
fn all_instructions_of_16_bits_are_read_as_others_read_them() {
    let tally = Tally::of(narrow());
    tally.assert_no_difference();
    // The rest is UNDEFINED.
    assert!(tally.agreed > u32::from(WIDE) / 100 * 90, "{tally:?}");
}

#[test]
fn instructions_of_32_bits_are_read_as_others_read_them() {
    let tally = Tally::of(wide());
    tally.assert_no_difference();
    // Many are UNDEFINED, and a third are for coprocessors that neither decoder knows.
    let all = tally.agreed + tally.unknown + tally.accepted.values().sum::<u32>();
    assert_eq!(all, u32::from(u16::MAX - WIDE + 1) * u32::from(SECONDS));
    assert!(tally.agreed > all / 2, "{tally:?}");
}

#[test]
fn every_reason_for_a_difference_is_needed() {
    let tally = Tally::of(narrow().chain(wide()));
    for (reason, _) in REASONS {
        assert!(tally.accepted.contains_key(reason), "never needed: {reason}");
    }
}
