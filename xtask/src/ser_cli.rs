//! `ser-cli`, which several verbs use.

use std::process::Command;

use crate::places;
use crate::steps::{self, Result, heading};

/// Builds `ser-cli`, showing the progress; the first time takes a while, so archives are left out.
/// [`command`] runs the same.
pub(crate) fn build() -> Result<()> {
    heading("ser-cli");
    steps::run(steps::cargo().args(["build", "--package", "ser-cli", "--no-default-features"]))?;
    steps::say(&"");
    Ok(())
}

/// `ser-cli` with this subcommand. File names in the options are relative to the user's folder.
pub(crate) fn command(subcommand: &str) -> Command {
    let mut command = steps::cargo();
    if let Ok(here) = std::env::current_dir() {
        command.current_dir(here);
    }
    command.args(["run", "--quiet", "--package", "ser-cli", "--no-default-features"]);
    command.arg("--manifest-path");
    command.arg(places::root().join("Cargo.toml"));
    command.args(["--", subcommand]);
    command
}
