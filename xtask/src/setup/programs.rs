//! External programs that single tests need. They read what this project writes, as users' programs
//! do.
//!
//! Such a test is in a module `needs_NAME` and ignored with the reason `needs NAME: cargo xtask
//! test`, so `cargo test` shows it as left out. `cargo xtask test` runs it if the program is
//! installed. A test that runs without its program fails.

use crate::setup::apt;
use crate::setup::demand::{Kind, Size, Tool};
use crate::steps::{Failure, Result, heading, unrelated, works};

/// A program, and the Debian package that contains it.
struct Program {
    tool: Tool,
    package: &'static str,
}

/// All programs. Sizes are those of Debian 12.
static PROGRAMS: [Program; 1] = [Program {
    tool: Tool {
        name: "sqlite3",
        serves: "the test that imports a log into SQLite",
        size: Size { download_mb: Some(2), disk_mb: 3 },
        instead: None,
        kind: Kind::Program,
    },
    package: "sqlite3",
}];

/// The programs that are not installed.
pub(crate) fn missing() -> impl Iterator<Item = &'static Tool> {
    PROGRAMS.iter().map(|program| &program.tool).filter(|tool| !there(tool.name))
}

/// Installs a program.
///
/// # Errors
/// If the program cannot be installed.
pub(crate) fn install(name: &str) -> Result<()> {
    let program = PROGRAMS.iter().find(|program| program.tool.name == name);
    let Some(Program { tool, package }) = program else {
        return Err(Failure::new(format!("xtask does not know how to install {name}")));
    };
    if apt::there() {
        heading(&format!("Installing {name} ({})", tool.size));
        match apt::install(&[package]) {
            Ok(()) if there(name) => return Ok(()),
            Ok(()) => {}
            Err(why) => return Err(Failure::new(why)),
        }
    }
    Err(Failure::new(format!(
        "{name} is missing; on Debian, get it with\n  sudo apt-get install {package}"
    )))
}

/// Arguments for the test harness that leave out the tests whose programs are missing.
pub(crate) fn skipped() -> Vec<String> {
    missing()
        .flat_map(|tool| ["--skip".to_owned(), format!("{}::", module_of(tool.name))])
        .collect()
}

fn there(name: &str) -> bool {
    works(unrelated(name).arg("--version"))
}

/// How the names of modules with such tests begin.
pub(crate) const MODULE: &str = "needs_";

/// The module with the tests that need a program.
fn module_of(name: &str) -> String {
    format!("{MODULE}{}", name.replace('-', "_"))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::fs;
    use std::path::{Path, PathBuf};

    use super::*;
    use crate::places;

    /// Finds all sources of tests.
    fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir()
                && path.file_name().is_some_and(|name| name != "target" && name != "xtask")
            {
                sources(&path, found);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                found.push(path);
            }
        }
    }

    /// The programs that tests need, by module and by reason.
    fn needed() -> (BTreeSet<String>, BTreeSet<String>) {
        let mut files = Vec::new();
        sources(places::root(), &mut files);
        let (mut modules, mut reasons) = (BTreeSet::new(), BTreeSet::new());
        for line in files.iter().filter_map(|file| fs::read_to_string(file).ok()).flat_map(|text| {
            let lines: Vec<String> = text.lines().map(|line| line.trim().to_owned()).collect();
            lines
        }) {
            if let Some(module) = line.strip_prefix("mod needs_") {
                modules.insert(module.trim_end_matches([' ', '{', ';']).to_owned());
            }
            let reason = line.strip_prefix("#[ignore = \"needs ");
            let reason = reason.and_then(|reason| reason.strip_suffix(": cargo xtask test\"]"));
            reasons.extend(reason.filter(|reason| !reason.starts_with("the ")).map(str::to_owned));
        }
        (modules, reasons)
    }

    #[test]
    fn every_program_that_a_test_needs_is_in_the_list_and_every_one_in_the_list_is_needed() {
        let known: BTreeSet<String> =
            PROGRAMS.iter().map(|program| program.tool.name.to_owned()).collect();
        let (modules, reasons) = needed();
        assert_eq!(reasons, known);
        assert_eq!(modules, known.iter().map(|name| name.replace('-', "_")).collect());
    }

    #[test]
    fn a_program_that_is_not_there_is_seen_to_be_missing() {
        assert!(!there("there-is-no-program-of-this-name"));
        assert_eq!(module_of("a-program"), "needs_a_program");
    }
}
