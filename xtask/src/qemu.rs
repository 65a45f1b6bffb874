//! `qemu`: runs the ARM image in the emulator, on a pseudo-terminal, a TCP port or a Genius bus.

use std::ffi::OsString;

use crate::setup::demand::Installing;
use crate::steps::{self, Result};
use crate::{images, ser_cli};

const EXAMPLES: &str = "\
Examples:
  cargo xtask qemu --pty /tmp/ser                    then: ser-cli -p /tmp/ser status
  cargo xtask qemu --tcp 127.0.0.1:4000              then: ser-cli -p tcp://127.0.0.1:4000 status
  cargo xtask qemu --pty /tmp/ser --log ser.log      then: cargo xtask log --follow ser.log
  cargo xtask qemu --genius /tmp/host --node 5       then: ser-cli -p 'geni:/tmp/host?node=5' status

`ser-cli sim --help` lists all options.";

/// Run the ARM image in QEMU until Ctrl-C; takes the options of `ser-cli sim`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {
    /// Options of `ser-cli sim`.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    options: Vec<OsString>,
}

pub(crate) fn run(arguments: &Arguments, installing: Installing) -> Result<()> {
    let image = images::build_emulated(installing)?;
    ser_cli::build()?;
    steps::become_program(
        ser_cli::command("sim").arg("--image").arg(image).args(&arguments.options),
    )
}
