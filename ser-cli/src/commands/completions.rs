//! `completions`: what a shell needs to complete the arguments.

use std::io::{self, Write};

use clap_complete::Shell;

use crate::error::Result;

const EXAMPLES: &str = "\
Examples:
  ser-cli completions bash > ser-cli.bash    then: source ser-cli.bash
  ser-cli completions zsh > ~/.zfunc/_ser-cli
  ser-cli completions fish > ~/.config/fish/completions/ser-cli.fish";

/// Print the completion script of a shell.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// Which shell.
    shell: Shell,
}

pub(crate) fn run(args: &Args, definition: &mut clap::Command) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, definition, "ser-cli", &mut script);
    let mut out = io::stdout().lock();
    out.write_all(&script)?;
    out.flush()?;
    Ok(())
}
