//! What goes with the fuzzer: `plant` writes the seeds into its corpus, `replay` runs a target on
//! single inputs, in an ordinary build.

use std::error::Error;
use std::fs::{self, File};
use std::io::{self, ErrorKind, Write};
use std::path::Path;
use std::process::ExitCode;

use ser_console::Harmless;
use ser_trial::fuzzing::{TARGETS, Target, seeds};

const USAGE: &str = "\
usage: cargo run -p ser-trial --example fuzzing -- plant TARGET FOLDER
       cargo run -p ser-trial --example fuzzing -- replay TARGET FILE…
A file whose name ends with .hex is hex text.";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let done = match arguments[..] {
        ["plant", target, folder] => {
            find(target).and_then(|target| plant(target, Path::new(folder)))
        }
        ["replay", target, ref files @ ..] if !files.is_empty() => find(target)
            .and_then(|target| files.iter().try_for_each(|file| replay(target, Path::new(file)))),
        _ => Err(USAGE.into()),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // Nobody is left to be told when standard error is gone.
            let _ = writeln!(io::stderr(), "{}", Harmless(error));
            ExitCode::FAILURE
        }
    }
}

fn find(name: &str) -> Result<Target, Box<dyn Error>> {
    let names = TARGETS.map(|target| target.name).join(", ");
    let target = TARGETS.into_iter().find(|target| target.name == name);
    target.ok_or_else(|| format!("there is no target {name}; there are {names}").into())
}

fn plant(target: Target, folder: &Path) -> Result<(), Box<dyn Error>> {
    fs::create_dir_all(folder)?;
    for seed in seeds::of(target.name)? {
        write_new(&folder.join(seed.name), &seed.bytes)?;
    }
    Ok(())
}

/// Writes a file unless it is there already. One that is something else stays: it may be anybody's.
fn write_new(path: &Path, bytes: &[u8]) -> Result<(), Box<dyn Error>> {
    match File::options().write(true).create_new(true).open(path) {
        Ok(mut file) => Ok(file.write_all(bytes)?),
        Err(error) if error.kind() == ErrorKind::AlreadyExists && is(path, bytes) => Ok(()),
        Err(error) if error.kind() == ErrorKind::AlreadyExists => Err(format!(
            "{} is something else than this seed: remove it, or name another folder",
            path.display()
        )
        .into()),
        Err(error) => Err(error.into()),
    }
}

fn is(path: &Path, bytes: &[u8]) -> bool {
    let len = fs::metadata(path).map(|found| found.len());
    len.is_ok_and(|len| len == bytes.len() as u64)
        && fs::read(path).is_ok_and(|found| found == bytes)
}

fn replay(target: Target, file: &Path) -> Result<(), Box<dyn Error>> {
    let seed = seeds::read(file)?;
    let what = format!("{} on {} bytes of {}", target.name, seed.bytes.len(), file.display());
    ser_console::print(Harmless(what).line() + "\n")?;
    (target.run)(&seed.bytes);
    Ok(ser_console::print("holds\n")?)
}
