//! What the user is told when something does not work: a message, what to try next, and the exit
//! code.

use std::fmt::Display;
use std::io::{self, Write};
use std::process::ExitCode;

use anstyle::{AnsiColor, Style};
use ser_console::Harmless;

/// The result of everything that a command does.
pub(crate) type Result<T> = std::result::Result<T, Failure>;

/// The recorder did not answer or refused, or something else went wrong while running.
pub(crate) const EXIT_FAILURE: u8 = 1;

/// The command line asks for something that cannot be; clap uses the same code.
const EXIT_USAGE: u8 = 2;

/// Everything went well, and events are missing in what was delivered; only if the user asked for
/// that.
const EXIT_INCOMPLETE: u8 = 3;

/// Why a command ended early.
#[derive(Debug)]
pub(crate) enum Failure {
    /// Whoever read our output has had enough (`| head`): nothing to complain about.
    OutputClosed,
    /// The user has had enough: nothing to complain about either.
    Interrupted,
    /// Something to tell.
    Told(Box<Report>),
}

/// A message and the advice that goes with it.
#[derive(Debug)]
pub(crate) struct Report {
    message: String,
    hints: Vec<String>,
    exit: u8,
    /// Nothing that the recorder said was understood, if it said anything.
    unanswered: bool,
    /// It may work again without anybody doing anything here.
    may_pass: bool,
}

impl Failure {
    /// A failure while running: exit code 1.
    pub(crate) fn new(message: impl Display) -> Failure {
        Failure::with_exit(message, EXIT_FAILURE)
    }

    /// A command line that makes no sense, found after clap has had its look: exit code 2.
    pub(crate) fn usage(message: impl Display) -> Failure {
        Failure::with_exit(message, EXIT_USAGE)
    }

    /// Events are missing in what was delivered: exit code 3.
    pub(crate) fn incomplete(message: impl Display) -> Failure {
        Failure::with_exit(message, EXIT_INCOMPLETE).hint(
            "everything that could be read was delivered; each loss is in the output where \
             it belongs",
        )
    }

    fn with_exit(message: impl Display, exit: u8) -> Failure {
        Failure::Told(Box::new(Report {
            message: message.to_string(),
            hints: Vec::new(),
            exit,
            unanswered: false,
            may_pass: false,
        }))
    }

    /// Adds what to try next; every failure has at least one such line.
    pub(crate) fn hint(mut self, hint: impl Display) -> Failure {
        if let Failure::Told(report) = &mut self {
            report.hints.push(hint.to_string());
        }
        self
    }

    /// Notes that nothing was understood of the unit: the rate may be wrong.
    pub(crate) fn unanswered(mut self) -> Failure {
        if let Failure::Told(report) = &mut self {
            report.unanswered = true;
        }
        self
    }

    /// Whether nothing was understood of the recorder.
    pub(crate) fn is_unanswered(&self) -> bool {
        matches!(self, Failure::Told(report) if report.unanswered)
    }

    /// Notes whether it may work again if one waits.
    pub(crate) fn passing(mut self, may_pass: bool) -> Failure {
        if let Failure::Told(report) = &mut self {
            report.may_pass = may_pass;
        }
        self
    }

    /// Whether it may work again if one waits.
    pub(crate) fn may_pass(&self) -> bool {
        matches!(self, Failure::Told(report) if report.may_pass)
    }

    /// Tells the user, who need not do anything about it yet.
    pub(crate) fn warn(&self) {
        if let Failure::Told(report) = self {
            warn(&report.message);
        }
    }

    /// The failure to write to `what` (a file, standard output).
    pub(crate) fn writing(what: impl Display, error: &io::Error) -> Failure {
        match error.kind() {
            io::ErrorKind::BrokenPipe => Failure::OutputClosed,
            _ => Failure::new(format!("cannot write {what}: {error}"))
                .hint("check that the place it goes to exists and has room"),
        }
    }

    /// The failure to read `what`.
    pub(crate) fn reading(what: impl Display, error: &io::Error) -> Failure {
        Failure::new(format!("cannot read {what}: {error}"))
            .hint("check its name and your rights to it")
    }

    /// Tells the user; gives the exit code.
    pub(crate) fn report(&self) -> ExitCode {
        let Failure::Told(report) = self else { return ExitCode::SUCCESS };
        note("error", AnsiColor::Red, &report.message);
        for hint in &report.hints {
            note("hint", AnsiColor::Cyan, hint);
        }
        ExitCode::from(report.exit)
    }

    /// Message and hints as one text.
    #[cfg(test)]
    pub(crate) fn text(&self) -> String {
        match self {
            Failure::OutputClosed | Failure::Interrupted => String::new(),
            Failure::Told(report) => report
                .hints
                .iter()
                .fold(report.message.clone(), |text, hint| format!("{text}\nhint: {hint}")),
        }
    }

    /// Whether this is a mistake on the command line.
    #[cfg(test)]
    pub(crate) fn is_usage(&self) -> bool {
        matches!(self, Failure::Told(report) if report.exit == EXIT_USAGE)
    }
}

/// Writing to standard output is the only I/O that is not turned into a [`Failure`] where it
/// happens.
impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Failure {
        Failure::writing("standard output", &error)
    }
}

/// Tells the user something that does not end the command.
pub(crate) fn warn(message: impl Display) {
    note("warning", AnsiColor::Yellow, message);
}

/// Adds what to do about a warning.
pub(crate) fn advise(message: impl Display) {
    note("hint", AnsiColor::Cyan, message);
}

/// Tells the user something that is no problem.
pub(crate) fn inform(message: impl Display) {
    // Nobody is left to be told when standard error is gone.
    let _ = writeln!(anstream::stderr(), "{}", Harmless(message));
}

fn note(label: &str, color: AnsiColor, message: impl Display) {
    let style = Style::new().bold().fg_color(Some(color.into()));
    let _ = writeln!(anstream::stderr(), "{style}{label}:{style:#} {}", Harmless(message));
}
