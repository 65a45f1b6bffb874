//! The tasks of the project, each as one command: `cargo xtask --help`.
//!
//! Each verb is a file. The verbs share these modules: [`setup`] finds or installs tools. [`steps`]
//! runs them and tells how to repeat a failed step. [`boards`] lists what can be built. [`images`]
//! builds it and has `image-check` check it. [`plugin`] and [`ser_cli`] are built for several
//! verbs.

mod boards;
mod demo;
mod evidence_mistakes;
mod firmware;
mod flash;
mod fuzz;
mod images;
mod lint;
mod log;
mod places;
mod plugin;
mod qemu;
mod ser_cli;
mod setup;
mod simulate;
mod steps;
mod test;
mod timing;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use setup::demand::Installing;

/// The tasks of the project, each as one command. Missing tools are installed if possible.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask", version, max_term_width = 100)]
struct Arguments {
    /// Install no tools; only report what is missing.
    #[arg(long, global = true)]
    offline: bool,

    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    Demo(demo::Arguments),
    EvidenceMistakes(evidence_mistakes::Arguments),
    Qemu(qemu::Arguments),
    Test(test::Arguments),
    Firmware(firmware::Arguments),
    Flash(flash::Arguments),
    Fuzz(fuzz::Arguments),
    Lint(lint::Arguments),
    Log(log::Arguments),
    Simulate(simulate::Arguments),
    Timing(timing::Arguments),
}

fn main() -> ExitCode {
    let Arguments { offline, verb } = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return ser_console::explain(error),
    };
    let installing = if offline { Installing::Forbidden } else { Installing::Allowed };
    let done = match verb {
        Verb::Demo(arguments) => demo::run(&arguments, installing),
        Verb::EvidenceMistakes(arguments) => evidence_mistakes::run(&arguments),
        Verb::Qemu(arguments) => qemu::run(&arguments, installing),
        Verb::Test(arguments) => test::run(&arguments, installing),
        Verb::Firmware(arguments) => firmware::run(&arguments, installing),
        Verb::Flash(arguments) => flash::run(&arguments, installing),
        Verb::Fuzz(arguments) => fuzz::run(&arguments),
        Verb::Lint(arguments) => lint::run(&arguments, installing),
        Verb::Log(arguments) => log::run(&arguments),
        Verb::Simulate(arguments) => simulate::run(&arguments),
        Verb::Timing(arguments) => timing::run(&arguments, installing),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::Arguments;

    /// clap breaks prose at the width of the terminal. A line that was broken by hand at a greater
    /// width would be broken twice.
    #[test]
    fn examples_fit_the_narrowest_width_that_help_is_printed_in() {
        const WIDTH: usize = 100;
        let mut command = Arguments::command();
        command.build();
        for verb in command.get_subcommands() {
            let after = verb.get_after_help().map(ToString::to_string).unwrap_or_default();
            for line in after.lines().filter(|line| line.starts_with(' ')) {
                assert!(line.len() <= WIDTH, "{}: {line}", verb.get_name());
            }
        }
    }
}
