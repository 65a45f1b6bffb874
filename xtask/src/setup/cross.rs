//! A Rust that builds for the boards.
//!
//! For each target these are tried in order: the toolchain in use, if it has the target's library;
//! the same after `rustup target add`; Debian's own Rust, which comes with the library's source and
//! builds that as well.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::places;
use crate::setup::apt;
use crate::setup::components::{self, Component};
use crate::setup::demand::{Installing, Kind, Size, Tool};
use crate::steps::{self, Failure, Result, heading, note, output, unrelated, works};

/// Rust's name for a board's processor.
pub(crate) type Target = &'static str;

/// Cortex-M3.
pub(crate) const CORTEX_M3: Target = "thumbv7m-none-eabi";
/// Cortex-M4 with a floating-point unit.
pub(crate) const CORTEX_M4F: Target = "thumbv7em-none-eabihf";

/// The oldest Rust that `Cargo.toml` allows.
const OLDEST_RUST: (u32, u32) = (1, 89);

/// Time limit for a download. The target's library is a few megabytes, so a slower network is
/// useless.
const DOWNLOAD_WITHIN: Duration = Duration::from_secs(180);

/// Debian's packages for Rust. Those for building browsers are the newest. The plain names may
/// suffice on other systems.
const DEBIAN_RUST: [[&str; 3]; 2] =
    [["rustc-web", "cargo-web", "rust-web-src"], ["rustc", "cargo", "rust-src"]];
const DEBIAN_CLIPPY: [&str; 2] = ["rust-web-clippy", "rust-clippy"];

const DEBIAN_CARGO: &str = "/usr/bin/cargo";
const DEBIAN_RUSTC: &str = "/usr/bin/rustc";
const DEBIAN_CARGO_CLIPPY: &str = "/usr/bin/cargo-clippy";

/// The libraries of both targets. The size is that of rustup's for Rust 1.95.
pub(crate) static TOOL: Tool = Tool {
    name: "Rust's libraries for the boards",
    serves: "the images, their checks and the tests in the emulator",
    size: Size { download_mb: None, disk_mb: 123 },
    instead: Some(("Debian's Rust", DEBIAN_RUST_SIZE)),
    kind: Kind::CrossRust,
};

/// Clippy for the boards, which rustup's toolchains have.
pub(crate) static CLIPPY: Tool = Tool {
    name: "clippy for the boards",
    serves: "the check of the firmware's code",
    size: Size { download_mb: Some(4), disk_mb: 14 },
    instead: None,
    kind: Kind::CrossClippy,
};

/// Debian's Rust with the source of its library, as of Debian 12.
const DEBIAN_RUST_SIZE: Size = Size { download_mb: Some(143), disk_mb: 778 };

/// A Rust that builds for a target.
#[derive(Clone, Debug)]
pub(crate) struct CrossToolchain {
    target: Target,
    rust: Rust,
}

#[derive(Clone, Debug)]
enum Rust {
    /// The toolchain in use.
    InUse,
    /// Debian's Rust, with the linker that it must use.
    Debian { linker: PathBuf },
}

impl CrossToolchain {
    /// Cargo with this subcommand, for the target and in the firmware workspace.
    pub(crate) fn cargo(&self, subcommand: &str) -> Command {
        match &self.rust {
            Rust::InUse => {
                let mut cargo = steps::cargo();
                cargo.arg(subcommand);
                self.common(cargo)
            }
            Rust::Debian { linker } => self.debian(DEBIAN_CARGO, subcommand, linker),
        }
    }

    /// Clippy for the firmware workspace, if there is one.
    pub(crate) fn clippy(&self) -> Option<Command> {
        match &self.rust {
            Rust::InUse => components::has(Component::Clippy).then(|| self.cargo("clippy")),
            // With /usr/bin/cargo, rustup's clippy would be found first.
            Rust::Debian { linker } => {
                let there = Path::new(DEBIAN_CARGO_CLIPPY).exists();
                there.then(|| self.debian(DEBIAN_CARGO_CLIPPY, "clippy", linker))
            }
        }
    }

    fn common(&self, mut cargo: Command) -> Command {
        cargo.current_dir(places::firmware());
        cargo.args(["--target", self.target, "--target-dir"]).arg(places::firmware_target());
        cargo
    }

    fn debian(&self, program: &str, subcommand: &str, linker: &Path) -> Command {
        let mut cargo = unrelated(program);
        cargo.env("CARGO", DEBIAN_CARGO).env("RUSTC", DEBIAN_RUSTC);
        // Building the library is not a stable feature. It works here because compiler and source
        // have the same version.
        cargo.env("RUSTC_BOOTSTRAP", "1");
        cargo.env(linker_variable(self.target), linker);
        cargo.args([subcommand, "-Zbuild-std=core"]);
        self.common(cargo)
    }
}

/// The variable in which cargo finds the linker of a target.
fn linker_variable(target: Target) -> String {
    format!("CARGO_TARGET_{}_LINKER", target.to_uppercase().replace('-', "_"))
}

/// Whether there is a toolchain for each target.
pub(crate) fn there(targets: &[Target]) -> bool {
    find(targets, Installing::Forbidden).iter().all(Result::is_ok)
}

/// Whether each installed toolchain has clippy. A missing toolchain counts as [`TOOL`] only,
/// because it may come with clippy.
pub(crate) fn clippy_there(targets: &[Target]) -> bool {
    let found = find(targets, Installing::Forbidden);
    found.iter().flatten().all(|toolchain| toolchain.clippy().is_some())
}

/// Finds a toolchain for each target, or installs one.
pub(crate) fn find(targets: &[Target], installing: Installing) -> Vec<Result<CrossToolchain>> {
    let lacking: Vec<Target> =
        targets.iter().copied().filter(|target| !has_library(target)).collect();
    let debian = match installing {
        _ if lacking.is_empty() => None,
        Installing::Allowed if added(&lacking) => None,
        Installing::Allowed => found_or_installed_debian(),
        Installing::Forbidden => debian_rust(),
    };
    let toolchain = |&target: &Target| {
        if has_library(target) {
            return Ok(CrossToolchain { target, rust: Rust::InUse });
        }
        let linker = debian.clone().ok_or_else(|| missing(target))?;
        Ok(CrossToolchain { target, rust: Rust::Debian { linker } })
    };
    targets.iter().map(toolchain).collect()
}

/// A toolchain for one target.
pub(crate) fn find_one(target: Target, installing: Installing) -> Result<CrossToolchain> {
    find(&[target], installing).pop().unwrap_or_else(|| Err(missing(target)))
}

fn missing(target: Target) -> Failure {
    Failure::new(format!(
        "there is no Rust for {target}; get it with\n  rustup target add {target}\n\
         or, on Debian 12 without access to static.rust-lang.org, with\n  \
         sudo apt-get install --no-install-recommends {} {} lld",
        DEBIAN_RUST[0].join(" "),
        DEBIAN_CLIPPY[0]
    ))
}

/// Adds targets to the toolchain in use, if rustup can get them. Returns whether all of them are
/// there now.
fn added(targets: &[Target]) -> bool {
    if !works(unrelated("rustup").arg("--version")) {
        return false;
    }
    heading(&format!("Adding {} to the toolchain (together {})", targets.join(" and "), TOOL.size));
    let lacking: Vec<_> =
        targets.iter().filter(|target| !(add_target(target) && has_library(target))).collect();
    for target in &lacking {
        note(&format!("rustup cannot get {target}"));
    }
    lacking.is_empty()
}

/// Finds or installs Debian's Rust, which builds for all targets, and returns the linker that it
/// must use.
fn found_or_installed_debian() -> Option<PathBuf> {
    if !apt::there() {
        return None;
    }
    if let Some(linker) = debian_rust() {
        return Some(linker);
    }
    heading(&format!("Installing Debian's Rust for the firmware ({DEBIAN_RUST_SIZE})"));
    for packages in DEBIAN_RUST {
        match apt::install(&packages) {
            Ok(()) => break,
            Err(why) => note(&why),
        }
    }
    // Without clippy, only the check of the firmware's code is left out.
    if let Err(why) = install_clippy() {
        note(&why.to_string());
    }
    if rust_lld().is_none() && !on_path("ld.lld") {
        let _ = apt::install(&["lld"]).map_err(|why| note(&why));
    }
    debian_rust()
}

/// Debian's clippy, for Debian's Rust.
pub(crate) fn install_clippy() -> Result<()> {
    let mut why = "there is no apt".to_owned();
    for package in DEBIAN_CLIPPY.into_iter().filter(|_| apt::there()) {
        match apt::install(&[package]) {
            Ok(()) => return Ok(()),
            Err(reason) => why = reason,
        }
    }
    Err(Failure::new(format!("no clippy for Debian's Rust: {why}")))
}

/// Whether the toolchain in use has the target's library.
fn has_library(target: Target) -> bool {
    let library =
        output(steps::in_use("rustc").args(["--print", "target-libdir", "--target", target]));
    library.is_some_and(|library| {
        let mut files = Path::new(&library).read_dir().into_iter().flatten().flatten();
        files.any(|file| file.file_name().to_string_lossy().starts_with("libcore"))
    })
}

/// Runs `rustup target add` silently and with a time limit.
fn add_target(target: Target) -> bool {
    let mut rustup = steps::in_use("rustup");
    rustup.args(["target", "add", target]).env("RUSTUP_MAX_RETRIES", "0");
    rustup.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let Ok(mut child) = rustup.spawn() else { return false };
    let began = Instant::now();
    while began.elapsed() < DOWNLOAD_WITHIN {
        match child.try_wait() {
            Ok(Some(status)) => return status.success(),
            Ok(None) => sleep(Duration::from_millis(50)),
            Err(_) => break,
        }
    }
    // The process may still be running; xtask does not wait for it.
    let _ = child.kill();
    let _ = child.wait();
    false
}

/// The linker for Debian's Rust, if that is installed, new enough, and has the library's source.
fn debian_rust() -> Option<PathBuf> {
    let version = output(unrelated(DEBIAN_RUSTC).arg("--version"))?;
    let sysroot = PathBuf::from(output(unrelated(DEBIAN_RUSTC).args(["--print", "sysroot"]))?);
    let has_source = sysroot.join("lib/rustlib/src/rust/library/core").exists();
    let complete =
        parse_version(&version)? >= OLDEST_RUST && has_source && Path::new(DEBIAN_CARGO).exists();
    let linker = rust_lld().or_else(|| on_path("ld.lld").then(|| "ld.lld".into()))?;
    complete.then_some(linker)
}

/// The linker that comes with rustup's toolchain.
fn rust_lld() -> Option<PathBuf> {
    // The path is <sysroot>/lib/rustlib/<host>/lib; the programs are in the folder beside it.
    let libraries =
        PathBuf::from(output(steps::in_use("rustc").args(["--print", "target-libdir"]))?);
    Some(libraries.parent()?.join("bin/rust-lld")).filter(|linker| linker.exists())
}

fn on_path(program: &str) -> bool {
    works(unrelated(program).arg("--version"))
}

/// The version in a text such as `rustc 1.96.0 (ac68faa20 2026-05-25)`.
fn parse_version(text: &str) -> Option<(u32, u32)> {
    let mut numbers = text.split_whitespace().nth(1)?.split('.');
    Some((numbers.next()?.parse().ok()?, numbers.next()?.parse().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_target_has_its_own_variable_for_the_linker() {
        assert_eq!(linker_variable(CORTEX_M3), "CARGO_TARGET_THUMBV7M_NONE_EABI_LINKER");
        assert_eq!(linker_variable(CORTEX_M4F), "CARGO_TARGET_THUMBV7EM_NONE_EABIHF_LINKER");
    }

    #[test]
    fn versions_are_compared_as_numbers() {
        assert_eq!(
            parse_version("rustc 1.96.0 (ac68faa20 2026-05-25) (built from a source tarball)"),
            Some((1, 96))
        );
        assert!(parse_version("rustc 1.100.0") > Some(OLDEST_RUST));
        assert!(parse_version("rustc 1.63.0") < Some(OLDEST_RUST));
        assert_eq!(parse_version(""), None);
    }
}
