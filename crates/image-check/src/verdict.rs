//! Whether images may be flashed, by the results of their checks.

use std::fmt;

use crate::check::Checked;

/// Images that must not be flashed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refused {
    /// The board of each, and the checks that it has failed.
    images: Vec<(&'static str, Vec<&'static str>)>,
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let images =
            self.images.iter().map(|(board, checks)| format!("{board} ({})", checks.join(", ")));
        write!(
            f,
            "not to be flashed: {}\n  \
             The lines above say why; llvm-addr2line -ife IMAGE ADDRESS shows the source of an \
             address.",
            images.collect::<Vec<_>>().join("; ")
        )
    }
}

impl std::error::Error for Refused {}

/// Returns whether all of these images may be flashed.
///
/// # Errors
/// If some have failed a check.
pub fn verdict(images: &[Checked]) -> Result<(), Refused> {
    let failed = |image: &Checked| {
        let failed = image.outcomes.iter().filter(|outcome| !outcome.wrong.is_empty());
        let checks: Vec<_> = failed.map(|outcome| outcome.what).collect();
        (!checks.is_empty()).then_some((image.board, checks))
    };
    let images: Vec<_> = images.iter().filter_map(failed).collect();
    if images.is_empty() { Ok(()) } else { Err(Refused { images }) }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::checks::Outcome;

    fn image(board: &'static str, wrong: [&[&str]; 2]) -> Checked {
        let outcome = |what, wrong: &[&str]| Outcome {
            what,
            result: String::new(),
            wrong: wrong.iter().map(|&line| line.to_owned()).collect(),
        };
        let outcomes = vec![outcome("flash", wrong[0]), outcome("panics", wrong[1])];
        let (file, stack_paths) = (PathBuf::new(), String::new());
        Checked { board, file, outcomes, stack_bytes: None, stack_paths }
    }

    #[test]
    fn an_image_is_refused_for_each_check_that_it_fails() {
        let good = image("a", [&[], &[]]);
        let bad = image("b", [&["too much"], &["one", "another"]]);
        let other = image("c", [&[], &["one"]]);
        assert_eq!(verdict(std::slice::from_ref(&good)), Ok(()));
        let refused = verdict(&[good, bad, other]).unwrap_err().to_string();
        assert!(
            refused.starts_with("not to be flashed: b (flash, panics); c (panics)\n"),
            "{refused}"
        );
    }
}
