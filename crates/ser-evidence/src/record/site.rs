//! Versions of the site file.

use super::HostReading;

/// A version of the site file, by which the names that were valid at a time are found again. Which
/// version it is, its [digest](crate::site::SiteDigest::of) says. It takes no part in the timeline.
/// It is told of each recorder, as everything is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SiteRecord {
    /// From when on it was in use.
    pub at: HostReading,
    /// The whole file.
    pub text: String,
}

impl SiteRecord {
    /// The longest text, in bytes.
    pub const LONGEST: usize = 1 << 20;

    /// Whether a record can hold this text: it is short enough, and nothing in it controls anything
    /// but tabs and line ends. A site file that can be read has nothing else.
    #[must_use]
    pub fn holds(text: &str) -> bool {
        let is_fit = |letter: char| !letter.is_control() || matches!(letter, '\t' | '\n' | '\r');
        text.len() <= SiteRecord::LONGEST && text.chars().all(is_fit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_held_up_to_its_longest_and_with_nothing_that_controls() {
        for (text, is_held) in [
            ("", true),
            ("[[recorder]]\r\n\tname = \"Süd\"\n", true),
            ("\u{FEFF}# from an editor\n", true),
            ("# \u{1B}[2J", false),
            ("# \u{0}", false),
            ("# \u{9B}2J", false),
        ] {
            assert_eq!(SiteRecord::holds(text), is_held, "{text:?}");
        }
        assert!(SiteRecord::holds(&"x".repeat(SiteRecord::LONGEST)));
        assert!(!SiteRecord::holds(&"x".repeat(SiteRecord::LONGEST + 1)));
    }
}
