//! Arguments of a program: clap's messages, and standard output that is full or gone.

use std::error::Error as _;
use std::fmt::Display;
use std::io::{self, ErrorKind, Write};
use std::process::ExitCode;

use clap::error::{ContextKind, ContextValue};

use crate::Harmless;

/// Prints clap's help, version or error instead of running the program, and returns the exit code.
///
/// clap repeats arguments as they came. They are filtered, so that none of them moves a terminal or
/// passes for a line of the program's own. The program's colours stay.
#[must_use]
pub fn explain(error: clap::Error) -> ExitCode {
    let to_stderr = error.use_stderr();
    let code = u8::try_from(error.exit_code()).map_or(ExitCode::FAILURE, ExitCode::from);
    let text = rendered(error);
    if to_stderr {
        // When standard error is gone, nobody can be told.
        let _ = anstream::stderr().write_all(text.as_bytes());
    } else if let Err(error) = print(text) {
        return unwritten(&error);
    }
    code
}

fn rendered(mut error: clap::Error) -> String {
    let repeated: Vec<_> =
        error.context().map(|(kind, value)| (kind, harmless(kind, value))).collect();
    // clap would suggest the given words unfiltered.
    let is_hostile = repeated.iter().any(|(_, value)| value.is_some());
    for (kind, value) in repeated {
        if is_hostile && kind == ContextKind::Suggested {
            error.insert(kind, ContextValue::None);
        } else if let Some(value) = value {
            error.insert(kind, value);
        }
    }
    let mut text = error.render().ansi().to_string();
    if let Some(source) = error.source().map(ToString::to_string) {
        text = text.replace(&source, &Harmless(&source).to_string());
    }
    // Nothing from outside is left by now. If clap ever repeats more, the colours go, too, because
    // they could then come from either side.
    let plain = anstream::adapter::strip_str(&text).to_string();
    if Harmless(&plain).lines() == plain { text } else { Harmless(text).lines() }
}

/// The filtered form of a text that an error repeats, if that form is another one.
fn harmless(kind: ContextKind, value: &ContextValue) -> Option<ContextValue> {
    let line = |word: &String| Harmless(word).line();
    match value {
        // The usage text is the program's own.
        _ if kind == ContextKind::Usage => None,
        ContextValue::String(word) if line(word) != *word => Some(ContextValue::String(line(word))),
        ContextValue::Strings(words) if words.iter().any(|word| line(word) != *word) => {
            Some(ContextValue::Strings(words.iter().map(line).collect()))
        }
        _ => None,
    }
}

/// Prints a text on standard output, with colours only if they are wanted.
///
/// # Errors
/// Those of writing it; see [`unwritten`].
pub fn print(text: impl Display) -> io::Result<()> {
    let mut out = anstream::stdout().lock();
    write!(out, "{text}")?;
    out.flush()
}

/// The exit code of a program whose standard output has failed. A reader that is gone (`| head`) is
/// not an error; any other cause is reported.
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
    use clap::builder::PossibleValuesParser;
    use clap::{Arg, Command};

    use super::*;

    const HOSTILE: &str = "\u{1B}[2J\u{9B}2J\u{202E}\nerror: all is lost";

    fn said(words: &[&str]) -> String {
        let of_ab =
            Arg::new("letter").long("letter").value_parser(PossibleValuesParser::new(["a"]));
        let refused = |text: &str| Err::<u8, _>(format!("what is {text}?"));
        let number = Arg::new("number").short('n').long("number").value_parser(refused);
        let command = Command::new("program").bin_name("program").args([of_ab, number]);
        let command = command.subcommand(Command::new("read")).subcommand_required(true);
        let words = ["program"].iter().chain(words);
        rendered(command.try_get_matches_from(words).unwrap_err())
    }

    #[test]
    fn nothing_in_an_argument_moves_a_terminal_or_passes_for_a_line_of_ours() {
        let [option, with_value] = [format!("--{HOSTILE}"), format!("--letter={HOSTILE}")];
        let cluster = format!("-n{HOSTILE}");
        for words in [
            &[HOSTILE][..],
            &["read", HOSTILE],
            &[&option],
            &["read", &option],
            &[&with_value],
            &["--letter", HOSTILE],
            &["--number", HOSTILE],
            &[&cluster],
            &["--a\u{1B}[31mx"],
        ] {
            let text = said(words);
            let plain = anstream::adapter::strip_str(&text).to_string();
            assert!(!text.contains("\u{1B}[2J"), "{text:?}");
            assert!(!plain.contains(['\u{1B}', '\u{9B}', '\u{202E}']), "{text:?}");
            assert!(!plain.contains("\nerror: all"), "{plain}");
            assert!(plain.contains(r"\u{1b}"), "what was given is shown: {plain}");
            assert!(text.starts_with("\u{1B}["), "the program's own colours stay: {text:?}");
        }
    }

    #[test]
    fn what_is_harmless_is_repeated_as_it_came_with_a_proposal() {
        let text = said(&["--lettre", "b"]);
        let plain = anstream::adapter::strip_str(&text).to_string();
        assert!(plain.contains("unexpected argument '--lettre'"), "{plain}");
        assert!(plain.contains("a similar argument exists: '--letter'"), "{plain}");
        assert!(text.contains("\u{1B}["));
    }
}
