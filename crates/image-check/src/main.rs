//! The program that checks whether an image may be flashed.

use std::fmt::Display;
use std::io::{self, Write};
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use image_check::{ALL, Limits, check, table, verdict};
use ser_console::Harmless;

const EXAMPLES: &str = "\
Examples:
  image-check --board mps2-an385 ser-mps2-an385
  image-check --board stm32f407 --stack ser-stm32f407    also where the stack is used

`cargo xtask firmware` builds the images, checks them and prints their paths.

Exit code 1 when the image may not be flashed or cannot be read.";

/// Check whether an image may be flashed: its sizes, its stack, its panics, and what is in RAM.
#[derive(Debug, Parser)]
#[command(name = "image-check", version, after_help = EXAMPLES, max_term_width = 100)]
struct Arguments {
    /// The board that it is for.
    #[arg(long, value_parser = limits)]
    board: &'static Limits,

    /// Show the deepest paths through the program.
    #[arg(long)]
    stack: bool,

    /// An ELF file.
    image: PathBuf,
}

fn limits(board: &str) -> Result<&'static Limits, String> {
    let boards = ALL.map(|limits| limits.board);
    Limits::of(board).ok_or_else(|| format!("the boards are {}", boards.join(", ")))
}

fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return ser_console::explain(error),
    };
    run(&arguments)
}

fn run(arguments: &Arguments) -> ExitCode {
    let image = match check(arguments.board, &arguments.image) {
        Ok(image) => image,
        Err(error) => {
            return fail(format_args!(
                "{error}\nhint: cargo xtask firmware builds images, and prints their paths"
            ));
        }
    };
    let images = [image];
    let paths = images.iter().filter(|_| arguments.stack).map(|image| &*image.stack_paths);
    if let Err(error) = ser_console::print(table(&images) + &paths.collect::<String>()) {
        return ser_console::unwritten(&error);
    }
    match verdict(&images) {
        Ok(()) => ExitCode::SUCCESS,
        Err(refused) => fail(refused),
    }
}

/// Prints the reason and returns the exit code.
fn fail(why: impl Display) -> ExitCode {
    // When standard error is gone, nobody can be told.
    let _ = writeln!(io::stderr(), "image-check: {}", Harmless(why));
    ExitCode::FAILURE
}
