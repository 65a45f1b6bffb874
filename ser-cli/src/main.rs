//! The recorder's command line.

use std::process::ExitCode;

fn main() -> ExitCode {
    ser_cli::run()
}
