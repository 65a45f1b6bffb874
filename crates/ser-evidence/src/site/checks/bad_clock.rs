//! A `clock` that is neither `utc` nor `local` nor an offset such as `+05:30`.
//!
//! Why: it decides to what the clock is set, and how its stamps are read.
//!
//! Bad:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! clock = "+5:30"
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! clock = "+05:30"
//! ```

use crate::site::diagnostic::{Diagnostic, Findings, Span, quoted};
use crate::site::model::ClockRule;

/// The name of this check.
pub(in crate::site) const NAME: &str = "bad-clock";

/// What the clock is set to.
pub(in crate::site) fn rule(findings: &mut Findings, span: &Span, text: &str) -> Option<ClockRule> {
    let rule = match text {
        "utc" => Some(ClockRule::Utc),
        "local" => Some(ClockRule::Local),
        offset => offset_s(offset).map(ClockRule::Offset),
    };
    if rule.is_none() {
        let phrase = format!("{} is nothing that a clock is set to", quoted(text));
        let help = match text.to_ascii_lowercase().as_str() {
            "utc" | "gmt" | "z" => "write `clock = \"utc\"`",
            "local" => "write `clock = \"local\"`",
            _ => {
                "an offset has a sign, two digits, a colon and two digits, and is at most 14 hours"
            }
        };
        let diagnostic = Diagnostic::error(NAME, span.clone(), phrase);
        findings.add(diagnostic.label("must be `utc`, `local` or as in `+05:30`").help(help));
    }
    rule
}

/// Seconds east of UTC.
fn offset_s(text: &str) -> Option<i32> {
    let (sign, rest) = match text.split_at_checked(1)? {
        ("+", rest) => (1, rest),
        ("-", rest) => (-1, rest),
        _ => return None,
    };
    let (hours, minutes) = rest.split_once(':')?;
    let number = |digits: &str| {
        let is_number = digits.len() == 2 && digits.bytes().all(|digit| digit.is_ascii_digit());
        digits.parse::<i32>().ok().filter(|_| is_number)
    };
    let (hours, minutes) = (number(hours)?, number(minutes).filter(|&minutes| minutes < 60)?);
    Some(sign * (hours * 60 + minutes) * 60).filter(|seconds| seconds.abs() <= 14 * 3600)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_offset_is_hours_and_minutes_with_a_sign() {
        for (text, seconds) in [
            ("+05:30", Some(19_800)),
            ("-03:00", Some(-10_800)),
            ("+00:00", Some(0)),
            ("+14:00", Some(50_400)),
            ("+14:01", None),
            ("05:30", None),
            ("+5:30", None),
            ("+05:60", None),
            ("+0530", None),
            ("+ 5:30", None),
            ("−05:00", None),
            ("", None),
        ] {
            assert_eq!(offset_s(text), seconds, "{text}");
        }
    }
}
