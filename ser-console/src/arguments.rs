//! Programs with arguments: what clap has to say, and standard output that is full or gone.

use std::fmt::Display;
use std::io::{self, ErrorKind, Write};
use std::process::ExitCode;

use crate::Harmless;

/// Prints what clap says instead of the arguments: help, a version, or what is wrong. Gives the
/// exit code.
///
/// clap repeats arguments and variables as they came. Where one of them has something that a
/// terminal would obey, the text is printed without colours, and with that escaped: in a text with
/// colours nobody can tell theirs from ours.
#[must_use]
pub fn explain(error: &clap::Error) -> ExitCode {
    let arguments = std::env::args_os().chain(std::env::vars_os().map(|(_, value)| value));
    let mut words = arguments.map(|word| word.to_string_lossy().into_owned());
    let text = rendered(error, words.any(|word| Harmless(word).differs()));
    if error.use_stderr() {
        // Nobody is left to be told when standard error is gone.
        let _ = anstream::stderr().write_all(text.as_bytes());
    } else if let Err(error) = print(text) {
        return unwritten(&error);
    }
    u8::try_from(error.exit_code()).map_or(ExitCode::FAILURE, ExitCode::from)
}

fn rendered(error: &clap::Error, hostile: bool) -> String {
    let text = error.render();
    if hostile { Harmless(text).lines() } else { text.ansi().to_string() }
}

/// Prints a text on standard output, with colours only where they are wanted.
///
/// # Errors
/// Those of writing it; see [`unwritten`].
pub fn print(text: impl Display) -> io::Result<()> {
    let mut out = anstream::stdout().lock();
    write!(out, "{text}")?;
    out.flush()
}

/// The exit code of a program whose standard output has failed. It is none of its business that
/// nobody reads any more (`| head`); anything else it tells.
#[must_use]
pub fn unwritten(error: &io::Error) -> ExitCode {
    if error.kind() == ErrorKind::BrokenPipe {
        return ExitCode::SUCCESS;
    }
    let _ = writeln!(anstream::stderr(), "error: cannot write standard output: {error}");
    ExitCode::FAILURE
}

#[cfg(test)]
mod tests {
    use clap::{Arg, Command};

    use super::*;

    #[test]
    fn arguments_are_repeated_so_that_no_terminal_obeys_them() {
        let command = || Command::new("program").arg(Arg::new("port").long("port").value_parser(["a"]));
        let hostile = "\u{1B}[2J\u{9B}2J\u{202E}";
        for words in [["--port", hostile], [&format!("--{hostile}"), "x"], [hostile, "x"]] {
            let error = command().try_get_matches_from(["program"].iter().chain(&words)).unwrap_err();
            let text = rendered(&error, true);
            assert!(!text.contains(['\u{1B}', '\u{9B}', '\u{202E}']), "{text:?}");
            assert!(text.contains(r"\u{9b}2J\u{202e}") && text.contains("\n\n"), "{text:?}");
        }
        let error = command().try_get_matches_from(["program", "--port", "b"]).unwrap_err();
        assert!(rendered(&error, false).contains("\u{1B}["), "the program's own colours stay");
    }
}
