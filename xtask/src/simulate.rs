//! `simulate`: runs the whole system in virtual time, with random operations.

use std::ffi::OsString;

use crate::steps::{self, Result};

/// Run recorders, hosts, lines, bus and contacts in virtual time with random operations and faults,
/// and account for every event.
#[derive(Debug, clap::Args)]
#[command(disable_help_flag = true)]
pub(crate) struct Arguments {
    /// Options of the simulation; `--help` lists them.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    options: Vec<OsString>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let mut simulate = steps::cargo();
    simulate.args(["run", "--release", "--quiet", "-p", "ser-trial", "--bin", "simulate", "--"]);
    steps::become_program(simulate.args(&arguments.options))
}
