//! `decode`: turns a capture of the line, or bodies, back into messages.

use std::fs::File;
use std::io::{self, BufWriter, Read};
use std::path::PathBuf;

use crate::decoding::{CaptureFormat, CaptureOptions, Listing, Side, Tally};
use crate::error::{Failure, Result, advise, inform};
use crate::output::Palette;

const EXAMPLES: &str = "\
Examples:
  ser-cli decode capture.bin                    a capture of the line
  ser-cli decode --from recorder capture.bin    only the recorder's side
  echo '1B 30 31 34 35 34 35' | ser-cli decode  hex text
  echo 52 01 F4 05 | ser-cli decode --body      bodies, one per line";

/// Show what the bytes of a capture mean, damaged ones included.
///
/// Each line of the list gives the place (bytes from the start; in hex text line:column), the
/// sender, and the message. Damage is listed where it is found, and decoding continues after it; a
/// summary goes to standard error. The exit code is 0 even when something was damaged, because the
/// decoding itself worked.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// What to decode; `-` is standard input.
    #[arg(default_value = "-")]
    file: PathBuf,

    /// Who sent the bytes; without it, messages that both sides could have sent are shown with both
    /// readings.
    #[arg(long, value_name = "SIDE")]
    from: Option<Side>,

    /// What the input looks like; without it, it is hex text if its first line is and no ESC byte
    /// (1Bh) is in the first 64 KiB.
    #[arg(long)]
    format: Option<CaptureFormat>,

    /// The input holds bodies without framing: in hex text one per line, raw a single one.
    #[arg(long)]
    body: bool,
}

pub(crate) fn run(args: &Args) -> Result<()> {
    let (name, input) = open(args)?;
    let out = BufWriter::new(io::stdout());
    let mut list = Listing::new(out, Palette::of_stdout());
    let options = CaptureOptions { from: args.from, format: args.format, bodies: args.body };
    let input_error = options.decode(input, &mut list)?;
    list.flush()?;
    match input_error {
        Some(error) => Err(Failure::reading(name, &error)),
        None => {
            summarize(list.tally());
            Ok(())
        }
    }
}

fn open(args: &Args) -> Result<(String, Box<dyn Read>)> {
    if args.file.as_os_str() == "-" {
        return Ok(("standard input".to_string(), Box::new(io::stdin())));
    }
    let name = args.file.display().to_string();
    let file = File::open(&args.file).map_err(|error| Failure::reading(&name, &error))?;
    Ok((name, Box::new(file)))
}

fn summarize(tally: Tally) {
    inform(tally);
    if tally.is_empty() {
        advise("nothing to decode in the input; bodies without ESC frames need --body");
    }
}
