//! Timing of the ARM image in the emulator, for `cargo xtask timing`: see `ser_tests::timing`.

use std::process::ExitCode;

#[cfg(target_os = "linux")]
fn main() -> ExitCode {
    measured::main()
}

#[cfg(not(target_os = "linux"))]
fn main() -> ExitCode {
    eprintln!("the emulator is driven through local sockets and shared memory: it takes Linux");
    ExitCode::FAILURE
}

#[cfg(target_os = "linux")]
mod measured {
    use std::num::NonZeroU32;
    use std::path::PathBuf;
    use std::process::ExitCode;
    use std::time::Instant;

    use clap::Parser;
    use ser_tests::timing::bench::Parts;
    use ser_tests::timing::report::Report;

    /// What `cargo xtask timing` runs when it has understood its options and built image and plugin.
    #[derive(Debug, Parser)]
    #[command(version)]
    struct Arguments {
        /// How long all inputs change in every millisecond, in seconds.
        #[arg(long, value_name = "N")]
        load_seconds: NonZeroU32,

        /// The image.
        #[arg(long, value_name = "ELF")]
        image: PathBuf,

        /// The emulator's plugin.
        #[arg(long, value_name = "FILE")]
        plugin: PathBuf,
    }

    pub(super) fn main() -> ExitCode {
        let Arguments { load_seconds, image, plugin } = Arguments::parse();
        let load_ms = u64::from(load_seconds.get()) * 1000;
        let began = Instant::now();
        let next = |what: &str| eprintln!("    {:3} s  {what}", began.elapsed().as_secs());
        match Report::measure(&Parts { image, plugin }, load_ms, &next) {
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
