//! `log`: shows the log of an image as text.

use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  cargo xtask qemu --pty /tmp/ser --log ser.log     leaves a log
  cargo xtask log ser.log                           as text
  cargo xtask log --follow ser.log                  and what follows, until Ctrl-C";

/// Print the log that an image has left in a file.
///
/// The log holds numbers instead of text, and the texts are in the image. So the image must be the
/// one that wrote the log.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {
    /// The file that `ser-cli sim --log` wrote.
    file: PathBuf,

    /// The image that wrote it; by default the one that was built last.
    #[arg(long, value_name = "ELF")]
    image: Option<PathBuf>,

    /// Wait for more.
    #[arg(long)]
    follow: bool,
}

/// Without the decoder, this program runs the one that has it.
#[cfg(not(feature = "log"))]
pub(crate) fn run(arguments: &Arguments) -> crate::steps::Result<()> {
    use crate::{places, steps};

    let mut again = steps::cargo();
    if let Ok(here) = std::env::current_dir() {
        again.current_dir(here);
    }
    again.args(["run", "--quiet", "--package", "xtask", "--features", "log", "--manifest-path"]);
    again.arg(places::root().join("Cargo.toml")).args(["--", "log"]).arg(&arguments.file);
    if let Some(image) = &arguments.image {
        again.arg("--image").arg(image);
    }
    if arguments.follow {
        again.arg("--follow");
    }
    steps::become_program(&mut again)
}

#[cfg(feature = "log")]
pub(crate) use decoding::run;

#[cfg(feature = "log")]
mod decoding {
    use std::fs::{self, File};
    use std::io::Read;
    use std::path::Path;
    use std::thread::sleep;
    use std::time::Duration;

    use defmt_decoder::{DecodeError, Table};
    use ser_console::Harmless;

    use super::Arguments;
    use crate::boards::MPS2_AN385;
    use crate::steps::{self, Failure, Result};

    const LOOK_EVERY: Duration = Duration::from_millis(100);

    /// Decodes the log.
    pub(crate) fn run(arguments: &Arguments) -> Result<()> {
        let image = arguments.image.clone().unwrap_or_else(|| MPS2_AN385.image());
        let elf = fs::read(&image).map_err(fails(&image))?;
        let table = Table::parse(&elf)
            .map_err(|error| Failure::new(format!("{}: {error}", image.display())))?
            .ok_or_else(|| Failure::new(format!("{}: this image logs nothing", image.display())))?;
        let mut file = File::open(&arguments.file).map_err(fails(&arguments.file))?;
        let mut decoder = table.new_stream_decoder();
        let mut buffer = [0; 4096];
        loop {
            let read = file.read(&mut buffer).map_err(fails(&arguments.file))?;
            if read == 0 && !arguments.follow {
                return Ok(());
            }
            if read == 0 {
                sleep(LOOK_EVERY);
            }
            decoder.received(buffer.get(..read).unwrap_or_default());
            loop {
                let line = match decoder.decode() {
                    Ok(frame) => frame.display(false).to_string(),
                    Err(DecodeError::UnexpectedEof) => break,
                    Err(DecodeError::Malformed) => {
                        "(a record that this image cannot have written)".to_owned()
                    }
                };
                // The file may come from anywhere and hold anything.
                steps::print(format_args!("{}\n", Harmless(line)))?;
            }
        }
    }

    fn fails(path: &Path) -> impl Fn(std::io::Error) -> Failure {
        move |error| Failure::new(format!("{}: {error}", path.display()))
    }
}
