//! The recorder's command line, as a library. The program only calls [`run`].
//!
//! The readers of untrusted files can be used separately, so that tests and fuzzers reach them:
//! captures of a line ([`CaptureOptions`]), and the notes of an earlier run ([`Delivered`]).

mod appending;
#[cfg(feature = "archive")]
mod archive;
mod audit;
mod buses;
mod cli;
mod closed_stdout;
mod commands;
mod connection;
mod decoding;
mod delivery;
mod error;
mod extension;
mod filter_text;
mod gather;
mod interrupt;
mod keeper;
mod kept;
mod log_identity;
mod new_files;
mod original;
mod outage;
mod outlet;
mod output;
mod progress;
mod site_file;
mod state;
mod suppressed;
mod time;
mod unit_name;
mod values;
mod witness;

use std::process::ExitCode;

pub use decoding::{CaptureFormat, CaptureOptions, Listing, Side, Tally};
pub use output::Life;
pub use ser_observer::LogIdentity;
pub use state::{Delivered, NotDelivered};

/// Does what the command line says.
#[must_use]
pub fn run() -> ExitCode {
    match cli::Cli::from_command_line() {
        Ok(cli) => cli.run().map_or_else(|failure| failure.report(), |()| ExitCode::SUCCESS),
        Err(error) => ser_console::explain(error),
    }
}
