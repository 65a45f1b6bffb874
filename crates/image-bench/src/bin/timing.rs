//! Timing of the ARM image in the emulator, for `cargo xtask timing`: see `image_bench`.

use std::process::ExitCode;

#[cfg(target_os = "linux")]
fn main() -> ExitCode {
    measured::main()
}

#[cfg(not(target_os = "linux"))]
fn main() -> ExitCode {
    use std::io::Write;
    // When standard error is gone, nobody is left to be told.
    let _ = std::io::stderr().write_all(
        b"the emulator is driven through local sockets and shared memory: it takes Linux\n",
    );
    ExitCode::FAILURE
}

#[cfg(target_os = "linux")]
mod measured {
    use std::fmt;
    use std::io::{self, Write};
    use std::num::NonZeroU32;
    use std::path::PathBuf;
    use std::process::ExitCode;
    use std::time::Instant;

    use clap::Parser;
    use image_bench::bench::Parts;
    use image_bench::report::Report;

    /// What `cargo xtask timing` runs when it has understood its options and built image and
    /// plugin.
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
        let Arguments { load_seconds, image, plugin } = match Arguments::try_parse() {
            Ok(arguments) => arguments,
            Err(error) => return ser_console::explain(error),
        };
        let load_ms = u64::from(load_seconds.get()) * 1000;
        let began = Instant::now();
        let next = |what: &str| tell(format_args!("    {:3} s  {what}", began.elapsed().as_secs()));
        match Report::measure(&Parts { image, plugin }, load_ms, &next) {
            Ok(report) => {
                let printed = ser_console::print(format_args!("\n{report}\n"));
                let wrong = report.wrong();
                wrong
                    .iter()
                    .for_each(|wrong| tell(format_args!("over budget, late or missing: {wrong}")));
                match printed {
                    _ if !wrong.is_empty() => ExitCode::FAILURE,
                    Ok(()) => ExitCode::SUCCESS,
                    Err(error) => ser_console::unwritten(&error),
                }
            }
            Err(what) => {
                tell(format_args!("{what}"));
                ExitCode::FAILURE
            }
        }
    }

    /// Prints on standard error. When that is gone, nobody is left to be told.
    fn tell(what: fmt::Arguments<'_>) {
        let _ = writeln!(io::stderr(), "{what}");
    }
}
