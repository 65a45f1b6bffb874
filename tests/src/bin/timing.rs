//! Timing of the ARM image in the emulator: see `ser_tests::timing`.

use std::process::ExitCode;

#[cfg(unix)]
fn main() -> ExitCode {
    measured::main()
}

#[cfg(not(unix))]
fn main() -> ExitCode {
    eprintln!("the emulator is driven through local sockets and shared memory: it takes Linux");
    ExitCode::FAILURE
}

#[cfg(unix)]
mod measured {
    use std::path::PathBuf;
    use std::process::ExitCode;
    use std::time::Instant;

    use clap::Parser;
    use ser_tests::timing::bench::Parts;
    use ser_tests::timing::report::Report;

    const EXAMPLES: &str = "\
Examples:
  cargo xtask timing                      all of it, with ten seconds of load
  cargo xtask timing --load-seconds 60    with a minute of load

Seconds are of virtual time, which counts instructions: the numbers are the same in every run and on every machine.
Exit code 1 when something is over budget, the capture interrupt late, or an event unaccounted for.";

    /// Count the instructions of the ARM image in the emulator, hold them against the budgets, and account for every
    /// event of a load.
    #[derive(Debug, Parser)]
    #[command(name = "cargo xtask timing", bin_name = "cargo xtask timing", version, after_help = EXAMPLES)]
    struct Arguments {
        /// How long all inputs change in every millisecond, in seconds.
        #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..=86_400))]
        load_seconds: u64,

        /// The image.
        #[arg(long, hide = true)]
        image: PathBuf,

        /// The emulator's plugin.
        #[arg(long, hide = true)]
        plugin: PathBuf,
    }

    pub(super) fn main() -> ExitCode {
        let Arguments { load_seconds, image, plugin } = Arguments::parse();
        let began = Instant::now();
        let next = |what: &str| eprintln!("    {:3} s  {what}", began.elapsed().as_secs());
        match Report::measure(&Parts { image, plugin }, load_seconds * 1000, &next) {
            Ok(report) => {
                println!("\n{report}");
                let wrong = report.wrong();
                wrong.iter().for_each(|wrong| eprintln!("over budget, late or missing: {wrong}"));
                if wrong.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
            }
            Err(what) => {
                eprintln!("{what}");
                ExitCode::FAILURE
            }
        }
    }
}
