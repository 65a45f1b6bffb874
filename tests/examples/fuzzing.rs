//! What goes with the fuzzer: `plant` writes the seeds into its corpus, `replay` runs a target on single inputs, in an
//! ordinary build.

use std::error::Error;
use std::fs;
use std::path::Path;
use std::process::ExitCode;

use ser_tests::fuzzing::{TARGETS, Target, seeds};

const USAGE: &str = "\
usage: cargo run -p ser-tests --example fuzzing -- plant TARGET FOLDER
       cargo run -p ser-tests --example fuzzing -- replay TARGET FILE…
A file whose name ends with .hex is hex text.";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let done = match arguments[..] {
        ["plant", target, folder] => find(target).and_then(|target| plant(target, Path::new(folder))),
        ["replay", target, ref files @ ..] if !files.is_empty() => {
            find(target).and_then(|target| files.iter().try_for_each(|file| replay(target, Path::new(file))))
        }
        _ => Err(USAGE.into()),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
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
        fs::write(folder.join(seed.name), seed.bytes)?;
    }
    Ok(())
}

fn replay(target: Target, file: &Path) -> Result<(), Box<dyn Error>> {
    let seed = seeds::read(file)?;
    println!("{} on {} bytes of {}", target.name, seed.bytes.len(), file.display());
    (target.run)(&seed.bytes);
    println!("holds");
    Ok(())
}
