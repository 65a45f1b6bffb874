//! One mistake, as it is written down.
//!
//! ```text
//! title: A sample is a millisecond shorter than it is.
//! file: src/timeline/delta.rs
//! --- right
//! const PERIOD_US: i64 = 1000;
//! --- wrong
//! const PERIOD_US: i64 = 0;
//! ```

use std::fs;
use std::path::Path;

use crate::places;
use crate::steps::{Failure, Result};

/// A mistake that can be planted.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Mistake {
    /// The name of its file.
    pub(crate) name: String,
    /// What is wrong, in a sentence.
    pub(crate) title: String,
    /// The source in which it is, below the crate.
    pub(crate) file: String,
    right: String,
    wrong: String,
}

impl Mistake {
    /// All mistakes whose file name has `filter` in it, by name.
    pub(crate) fn all(filter: &str) -> Result<Vec<Mistake>> {
        let folder = places::root().join("crates/ser-evidence/tests/mistakes");
        let unread = |error| Failure::new(format!("cannot read {}: {error}", folder.display()));
        let entries = fs::read_dir(&folder).map_err(unread)?;
        let mut mistakes = Vec::new();
        for entry in entries {
            let path = entry.map_err(unread)?.path();
            let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            if name.contains(filter) {
                mistakes.push(Mistake::read(&path, name)?);
            }
        }
        if mistakes.is_empty() {
            return Err(Failure::new(format!("no mistake is called {filter}")));
        }
        mistakes.sort_by(|one, other| one.name.cmp(&other.name));
        Ok(mistakes)
    }

    fn read(path: &Path, name: String) -> Result<Mistake> {
        let wrong = |what: &str| Failure::new(format!("{}: {what}", path.display()));
        let text = fs::read_to_string(path).map_err(|error| wrong(&error.to_string()))?;
        let form = "it is not in the form that xtask/src/evidence_mistakes/mistake.rs shows";
        Mistake::parsed(&text, name).ok_or_else(|| wrong(form))
    }

    fn parsed(text: &str, name: String) -> Option<Mistake> {
        let (head, code) = text.split_once("--- right\n")?;
        let (right, wrong) = code.split_once("--- wrong\n")?;
        let (title, file) = head.strip_prefix("title: ")?.split_once("\nfile: ")?;
        let [title, file, right, wrong] = [title, file, right, wrong].map(str::trim_end);
        let is_whole = !right.trim().is_empty() && right != wrong;
        let [title, file, right, wrong] = [title, file, right, wrong].map(str::to_owned);
        is_whole.then_some(Mistake { name, title, file, right, wrong })
    }

    /// The source with the mistake in it. What is right has to be there exactly once: mistakes
    /// follow the code.
    pub(crate) fn planted_in(&self, source: &str) -> Result<String> {
        match source.matches(&self.right).count() {
            1 => Ok(source.replacen(&self.right, &self.wrong, 1)),
            count => Err(Failure::new(format!(
                "crates/ser-evidence/tests/mistakes/{}.txt: what is right is {count} times in {}, \
                 not once",
                self.name, self.file
            ))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "title: Too short.\nfile: src/a.rs\n--- right\nlet a = 1;\n--- wrong\n\
                        let a = 0;\n";

    fn mistake() -> Mistake {
        Mistake::parsed(TEXT, "a".to_owned()).expect("a mistake")
    }

    #[test]
    fn a_mistake_takes_the_place_of_what_is_right() {
        let planted = mistake().planted_in("fn a() {\n    let a = 1;\n}\n");
        assert_eq!(planted.expect("it fits"), "fn a() {\n    let a = 0;\n}\n");
    }

    #[test]
    fn a_mistake_that_does_not_fit_the_code_is_told() {
        for source in ["", "let a = 1; let a = 1;"] {
            let told = mistake().planted_in(source).expect_err("it does not fit").to_string();
            assert!(told.contains("mistakes/a.txt"), "{told}");
        }
    }

    #[test]
    fn what_is_not_a_mistake_is_none() {
        for text in ["", "title: A.\nfile: a\n--- right\na\n--- wrong\na\n", &TEXT[1..]] {
            assert_eq!(Mistake::parsed(text, "a".to_owned()), None, "{text}");
        }
    }

    /// Otherwise it would be found only when the mistakes are planted, which takes a while.
    #[test]
    fn every_mistake_fits_the_code() {
        let mistakes = Mistake::all("").expect("the mistakes");
        assert!(mistakes.len() >= 10, "{}", mistakes.len());
        for mistake in mistakes {
            let file = places::root().join("crates/ser-evidence").join(&mistake.file);
            let source = fs::read_to_string(file).expect("a source");
            if let Err(failure) = mistake.planted_in(&source) {
                panic!("{failure}");
            }
        }
    }
}
