//! rustfmt and clippy: a minimal Rust comes without them.

use crate::steps::{self, Failure, Result, heading, works};

/// Finds both, or has rustup install them.
pub(crate) fn find() -> Result<()> {
    let there = || ["fmt", "clippy"].into_iter().all(|tool| works(steps::cargo().args([tool, "--version"])));
    if there() {
        return Ok(());
    }
    heading("Installing rustfmt and clippy");
    if works(steps::unrelated("rustup").args(["component", "add", "rustfmt", "clippy"])) && there() {
        return Ok(());
    }
    Err(Failure::new("rustfmt and clippy are missing; get them with\n  rustup component add rustfmt clippy"))
}
