//! External programs that single tests need. They read what this project writes, as users' programs
//! do.
//!
//! Such a test is in a module `needs_NAME` and ignored with the reason `needs NAME: cargo xtask
//! test`, so `cargo test` shows it as left out. `cargo xtask test` runs it if the program is
//! installed. A test that runs without its program fails.

use std::path::PathBuf;

use crate::places;
use crate::setup::apt;
use crate::setup::demand::{Kind, Size, Tool};
use crate::steps::{self, Failure, Result, heading, unrelated, works};

/// A program, or what stands for one, and where it comes from.
struct Program {
    tool: Tool,
    source: Source,
}

enum Source {
    /// The Debian package that contains it.
    Debian(&'static str),
    /// The Debian package of a server, whose programs are in no path.
    Server(&'static str),
    /// Packages for Python, in an environment of their own.
    Python,
    /// A package for JavaScript, in a folder of its own.
    Npm,
}

/// The packages for Python, each in the version with which the tests were written.
const PYTHON: [&str; 4] =
    ["comtrade==0.2.0", "pywellen==0.25.7", "duckdb==2.0.1", "pyarrow==26.0.1"];

/// An older version that is still in use, in a folder of its own.
const OLDER_PYTHON: &str = "comtrade==0.1.2";

/// What says that the environment is whole.
const PYTHON_LIST: &str = "packages.txt";

/// The package for JavaScript that judges pages.
const AXE_CORE: &str = "axe-core@4.14.1";

const fn program(
    name: &'static str,
    serves: &'static str,
    (download_mb, disk_mb): (u32, u32),
    source: Source,
) -> Program {
    let size = Size { download_mb: Some(download_mb), disk_mb };
    Program { tool: Tool { name, serves, size, instead: None, kind: Kind::Program }, source }
}

/// All programs. Sizes are those of Debian 12.
static PROGRAMS: [Program; 9] = [
    program(
        "sqlite3",
        "the test that imports a log into SQLite",
        (2, 3),
        Source::Debian("sqlite3"),
    ),
    program(
        "minisign",
        "the tests that check signatures of reports with minisign",
        (1, 2),
        Source::Debian("minisign"),
    ),
    program(
        "vcd2fst",
        "the tests that read exported waveforms with GTKWave",
        (3, 6),
        Source::Debian("gtkwave"),
    ),
    program(
        "soffice",
        "the tests that open exported tables in LibreOffice",
        (92, 285),
        Source::Debian("libreoffice-calc"),
    ),
    program(
        "python-readers",
        "the tests that read exports with comtrade, pywellen, DuckDB and pyarrow",
        (130, 300),
        Source::Python,
    ),
    program(
        "chromedriver",
        "the tests that open the page of a report in a browser",
        (125, 398),
        Source::Debian("chromium-driver"),
    ),
    program(
        "pdftotext",
        "the test that reads the printed page of a report",
        (2, 6),
        Source::Debian("poppler-utils"),
    ),
    program(
        "postgres",
        "the tests that keep archives in PostgreSQL",
        (42, 171),
        Source::Server("postgresql"),
    ),
    program(
        "axe-core",
        "the test that asks whether everybody can read that page",
        (1, 4),
        Source::Npm,
    ),
];

/// The programs that are not installed.
pub(crate) fn missing() -> impl Iterator<Item = &'static Tool> {
    PROGRAMS.iter().filter(|program| !is_there(program)).map(|program| &program.tool)
}

/// Installs a program.
///
/// # Errors
/// If the program cannot be installed.
pub(crate) fn install(name: &str) -> Result<()> {
    let program = PROGRAMS.iter().find(|program| program.tool.name == name);
    let Some(program) = program else {
        return Err(Failure::new(format!("xtask does not know how to install {name}")));
    };
    heading(&format!("Installing {name} ({})", program.tool.size));
    match program.source {
        Source::Debian(package) | Source::Server(package) => install_package(program, package),
        Source::Python => install_python_readers(),
        Source::Npm => install_axe_core(),
    }
}

fn install_package(program: &Program, package: &str) -> Result<()> {
    if apt::there() {
        match apt::install(&[package]) {
            Ok(()) if is_there(program) => return Ok(()),
            Ok(()) => {}
            Err(why) => return Err(Failure::new(why)),
        }
    }
    let name = program.tool.name;
    Err(Failure::new(format!(
        "{name} is missing; on Debian, get it with\n  sudo apt-get install {package}"
    )))
}

/// Makes the environment anew, so that it holds these versions and nothing else.
fn install_python_readers() -> Result<()> {
    let (folder, python) = (places::python_readers(), python_of_readers());
    let make = || steps::run(unrelated("python3").args(["-m", "venv", "--clear"]).arg(&folder));
    if make().is_err() {
        // Debian has this part of Python in a package of its own.
        let _ = apt::there() && apt::install(&["python3-venv"]).is_ok();
        make()?;
    }
    let pip = || {
        let mut pip = unrelated(&python);
        pip.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]);
        pip
    };
    steps::run(pip().args(PYTHON))?;
    steps::run(pip().arg("--target").arg(folder.join("older")).arg(OLDER_PYTHON))?;
    let list = folder.join(PYTHON_LIST);
    std::fs::write(&list, python_list())
        .map_err(|error| Failure::new(format!("{}: {error}", list.display())))
}

fn install_axe_core() -> Result<()> {
    if !there("npm") {
        let _ = apt::there() && apt::install(&["npm"]).is_ok();
    }
    let mut npm = unrelated("npm");
    npm.args(["install", "--silent", "--no-audit", "--no-fund", "--prefix"]);
    steps::run(npm.arg(places::axe_core()).arg(AXE_CORE))
}

/// Whether this version is there.
fn axe_core_is_there() -> bool {
    let about = places::axe_core().join("node_modules/axe-core/package.json");
    let version = AXE_CORE.rsplit('@').next().unwrap_or_default();
    std::fs::read_to_string(about)
        .is_ok_and(|about| about.contains(&format!("\"version\": \"{version}\"")))
}

fn python_of_readers() -> PathBuf {
    places::python_readers().join("bin").join("python")
}

fn python_list() -> String {
    format!("{}\n{OLDER_PYTHON}\n", PYTHON.join("\n"))
}

/// Arguments for the test harness that leave out the tests whose programs are missing.
pub(crate) fn skipped() -> Vec<String> {
    missing()
        .flat_map(|tool| ["--skip".to_owned(), format!("{}::", module_of(tool.name))])
        .collect()
}

fn is_there(program: &Program) -> bool {
    match program.source {
        Source::Debian(_) => there(program.tool.name),
        Source::Server(_) => servers().next().is_some(),
        Source::Npm => axe_core_is_there(),
        // Of another version of this list, or half of it, is as good as nothing.
        Source::Python => {
            let list = std::fs::read_to_string(places::python_readers().join(PYTHON_LIST));
            list.is_ok_and(|list| list == python_list())
                && works(unrelated(python_of_readers()).arg("--version"))
        }
    }
}

/// The servers that Debian has installed, each in a folder of its version.
fn servers() -> impl Iterator<Item = PathBuf> {
    let versions = std::fs::read_dir("/usr/lib/postgresql").into_iter().flatten().flatten();
    versions.map(|version| version.path().join("bin/postgres")).filter(|server| server.is_file())
}

fn there(name: &str) -> bool {
    // Those of Poppler know the short form alone.
    ["--version", "-v"].iter().any(|version| works(unrelated(name).arg(version)))
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
