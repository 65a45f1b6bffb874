//! The recorder's command line.

mod cli;
mod commands;
mod connection;
mod decoding;
mod delivery;
mod error;
mod interrupt;
mod keeper;
mod outage;
mod output;
mod progress;
mod state;
mod time;
mod values;

use std::process::ExitCode;

fn main() -> ExitCode {
    match cli::Cli::from_command_line().run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}
