//! `demo`: the whole system, from a cold clone.

use std::ffi::OsString;

use crate::setup::demand::Installing;
use crate::steps::{self, Result};
use crate::{firmware, qemu};

const EXAMPLES: &str = "\
Examples:
  cargo xtask demo           with the simulated recorder: needs Rust only
  cargo xtask demo --qemu    with the ARM image in QEMU; installs what is missing";

/// Play a breaker trip to a recorder and read the sequence of events from it.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {
    /// Take the ARM image in QEMU for the recorder.
    #[arg(long)]
    qemu: bool,

    /// Options of `ser-cli demo`.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    options: Vec<OsString>,
}

pub(crate) fn run(arguments: &Arguments, installing: Installing) -> Result<()> {
    let mut demo = qemu::ser_cli("demo");
    if arguments.qemu {
        demo.arg("--image").arg(firmware::build_emulated(installing)?);
    }
    qemu::build_ser_cli()?;
    steps::become_program(demo.args(&arguments.options))
}
