//! A copy of `ser-evidence` and of what it needs, below the build folder.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::mistake::Mistake;
use crate::places;
use crate::steps::{Failure, Result};

/// The crates that are copied.
const CRATES: [&str; 3] = ["ser-proto", "crates/ser-console", "crates/ser-evidence"];

/// A workspace of its own, in which the crate may be made wrong.
#[derive(Debug)]
pub(crate) struct Copy {
    root: PathBuf,
}

impl Copy {
    /// Copies the crate anew.
    pub(crate) fn make() -> Result<Copy> {
        let copy = Copy { root: places::evidence_mistakes().join("workspace") };
        copy.fill().map_err(|error| copy.unmade(&error))?;
        Ok(copy)
    }

    /// The root of its workspace.
    pub(crate) fn root(&self) -> &Path {
        &self.root
    }

    fn fill(&self) -> io::Result<()> {
        if self.root.exists() {
            fs::remove_dir_all(&self.root)?;
        }
        for folder in CRATES {
            copy_folder(&places::root().join(folder), &self.root.join(folder))?;
        }
        fs::copy(places::root().join("Cargo.lock"), self.root.join("Cargo.lock"))?;
        let manifest = fs::read_to_string(places::root().join("Cargo.toml"))?;
        fs::write(self.root.join("Cargo.toml"), with_members(&manifest))
    }

    /// Makes the crate wrong. Returns the source as it was.
    pub(crate) fn plant(&self, mistake: &Mistake) -> Result<String> {
        let file = self.file(mistake);
        let right = fs::read_to_string(&file).map_err(|error| self.unmade(&error))?;
        let wrong = mistake.planted_in(&right)?;
        fs::write(file, wrong).map_err(|error| self.unmade(&error))?;
        Ok(right)
    }

    /// Makes it right again.
    pub(crate) fn mend(&self, mistake: &Mistake, right: &str) -> Result<()> {
        fs::write(self.file(mistake), right).map_err(|error| self.unmade(&error))
    }

    fn file(&self, mistake: &Mistake) -> PathBuf {
        self.root.join("crates/ser-evidence").join(&mistake.file)
    }

    fn unmade(&self, error: &io::Error) -> Failure {
        Failure::new(format!("cannot make a copy in {}: {error}", self.root.display()))
    }
}

/// The manifest of a workspace that has only the copied crates.
fn with_members(manifest: &str) -> String {
    let (before, list) = manifest.split_once("members = [").unwrap_or((manifest, "]"));
    let (_, after) = list.split_once(']').unwrap_or_default();
    format!("{before}members = {CRATES:?}{after}")
}

fn copy_folder(from: &Path, to: &Path) -> io::Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let to = to.join(entry.file_name());
        if entry.file_type()?.is_dir() {
            copy_folder(&entry.path(), &to)?;
        } else {
            fs::copy(entry.path(), to)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_copied_crates_are_members() {
        let manifest = "[workspace]\nmembers = [\n    \"a\",\n]\nexclude = [\"b\"]\n";
        let members = "[\"ser-proto\", \"crates/ser-console\", \"crates/ser-evidence\"]";
        let expected = format!("[workspace]\nmembers = {members}\nexclude = [\"b\"]\n");
        assert_eq!(with_members(manifest), expected);
    }
}
