//! The name that was probably meant.

use super::diagnostic::Findings;

/// Longer words are not compared: names are at most this long.
const LONGEST: usize = 200;

/// Words that differ more than this are not proposed.
const SIMILAR: f64 = 0.7;

/// So many letters are enough for the beginning of a name.
const BEGINNING: usize = 4;

/// The candidate that is most like `word`, if one is like it at all.
pub(super) fn nearest<'c>(
    word: &str,
    candidates: impl IntoIterator<Item = &'c str>,
    findings: &mut Findings,
) -> Option<&'c str> {
    if word.len() > LONGEST {
        return None;
    }
    let folded = word.to_lowercase();
    let mut best: Option<(f64, &str)> = None;
    for candidate in candidates {
        if !findings.may_compare(1) {
            break;
        }
        let candidate_folded = candidate.to_lowercase();
        let mut likeness = strsim::normalized_damerau_levenshtein(&folded, &candidate_folded);
        if word.len() >= BEGINNING && candidate_folded.starts_with(&folded) {
            likeness = likeness.max(SIMILAR);
        }
        let is_better = best.is_none_or(|(before, _)| likeness > before);
        if candidate.len() <= LONGEST && likeness >= SIMILAR && is_better {
            best = Some((likeness, candidate));
        }
    }
    best.map(|(_, candidate)| candidate)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(word: &str) -> Option<&'static str> {
        nearest(
            word,
            ["input", "inverted", "52-1 closed", "name", "Relay trip output"],
            &mut Findings::default(),
        )
    }

    #[test]
    fn a_misspelled_name_is_known_and_another_one_is_not() {
        assert_eq!(of("inptu"), Some("input"));
        assert_eq!(of("INPUT"), Some("input"));
        assert_eq!(of("52-1 close"), Some("52-1 closed"));
        assert_eq!(of("Relay trip"), Some("Relay trip output"));
        assert_eq!(of("colour"), None);
        assert_eq!(of(&"input".repeat(100)), None);
    }

    #[test]
    fn comparing_ends() {
        let mut findings = Findings::default();
        assert!(findings.may_compare(200_000));
        assert_eq!(nearest("inptu", ["input"], &mut findings), None);
    }
}
