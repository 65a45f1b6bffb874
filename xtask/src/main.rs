//! Everything about the project that is one command: `cargo xtask --help`.
//!
//! A verb is a file. What verbs share: [`setup`] finds or installs tools, [`steps`] runs them and says how to repeat what
//! failed.

mod demo;
mod firmware;
mod lint;
mod log;
mod places;
mod qemu;
mod setup;
mod sizes;
mod steps;
mod test;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Everything about the project that is one command. Missing tools are installed where that can be done.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask", version)]
struct Arguments {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    Demo(demo::Arguments),
    Qemu(qemu::Arguments),
    Test(test::Arguments),
    Firmware(firmware::Arguments),
    Lint(lint::Arguments),
    Log(log::Arguments),
}

fn main() -> ExitCode {
    let done = match Arguments::parse().verb {
        Verb::Demo(arguments) => demo::run(&arguments),
        Verb::Qemu(arguments) => qemu::run(&arguments),
        Verb::Test(arguments) => test::run(&arguments),
        Verb::Firmware(arguments) => firmware::run(&arguments),
        Verb::Lint(arguments) => lint::run(&arguments),
        Verb::Log(arguments) => log::run(&arguments),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("{failure}");
            ExitCode::FAILURE
        }
    }
}
