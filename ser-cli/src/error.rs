//! Failures as the user sees them: a message, what to try next, and the exit code.

use std::fmt::Display;
use std::io::{self, Write};
use std::process::ExitCode;

use anstyle::{AnsiColor, Style};
use ser_console::Harmless;

/// The result of everything that a command does.
pub(crate) type Result<T> = std::result::Result<T, Failure>;

/// The recorder did not answer or refused, or something else went wrong at run time.
pub(crate) const EXIT_FAILURE: u8 = 1;

/// The command line asks for something impossible. clap uses the same code.
const EXIT_USAGE: u8 = 2;

/// Everything worked, but events are missing in what was delivered. Used only if the user asked for
/// it.
const EXIT_INCOMPLETE: u8 = 3;

/// Why a command ended early.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The reader of our output has stopped (`| head`): nothing to report.
    OutputClosed,
    /// The user interrupted the command: nothing to report either.
    Interrupted,
    /// A failure to report.
    Told(Box<Report>),
}

/// A message and the advice that goes with it.
#[derive(Debug)]
pub(crate) struct Report {
    message: String,
    hints: Vec<String>,
    exit: u8,
    /// Nothing from the recorder was understood, if anything came at all.
    unanswered: bool,
    /// It may work again without any action here.
    may_pass: bool,
}

impl Failure {
    /// A failure while running: exit code 1.
    pub(crate) fn new(message: impl Display) -> Failure {
        Failure::with_exit(message, EXIT_FAILURE)
    }

    /// A senseless command line that clap does not recognise as one: exit code 2.
    pub(crate) fn usage(message: impl Display) -> Failure {
        Failure::with_exit(message, EXIT_USAGE)
    }

    /// Events are missing in what was delivered: exit code 3.
    pub(crate) fn incomplete(message: impl Display) -> Failure {
        Failure::with_exit(message, EXIT_INCOMPLETE).hint(
            "everything that could be read was delivered; what is missing is in the output, where \
             its place is known",
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

    /// Adds what to try next. Every failure has at least one such line.
    pub(crate) fn hint(mut self, hint: impl Display) -> Failure {
        if let Failure::Told(report) = &mut self {
            report.hints.push(hint.to_string());
        }
        self
    }

    /// Notes that nothing from the recorder was understood: the rate may be wrong.
    pub(crate) fn unanswered(mut self) -> Failure {
        if let Failure::Told(report) = &mut self {
            report.unanswered = true;
        }
        self
    }

    /// Whether nothing from the recorder was understood.
    pub(crate) fn is_unanswered(&self) -> bool {
        matches!(self, Failure::Told(report) if report.unanswered)
    }

    /// Notes whether waiting may help.
    pub(crate) fn passing(mut self, may_pass: bool) -> Failure {
        if let Failure::Told(report) = &mut self {
            report.may_pass = may_pass;
        }
        self
    }

    /// What happened, without advice.
    pub(crate) fn message(&self) -> String {
        match self {
            Failure::Told(report) => report.message.clone(),
            Failure::OutputClosed => "nobody reads the output".to_owned(),
            Failure::Interrupted => "interrupted".to_owned(),
        }
    }

    /// Whether waiting may help.
    pub(crate) fn may_pass(&self) -> bool {
        matches!(self, Failure::Told(report) if report.may_pass)
    }

    /// Reports the failure as a warning, because no action is needed yet.
    pub(crate) fn warn(&self) {
        if let Failure::Told(report) = self {
            warn(&report.message);
        }
    }

    /// The same for one of several recorders, with the advice.
    pub(crate) fn warn_of(&self, recorder: &str) {
        if let Failure::Told(report) = self {
            warn(format_args!("{recorder}: {}", report.message));
            report.hints.iter().for_each(advise);
        }
    }

    /// The failure to write to `what` (a file, standard output).
    pub(crate) fn writing(what: impl Display, error: &io::Error) -> Failure {
        match error.kind() {
            io::ErrorKind::BrokenPipe => Failure::OutputClosed,
            _ => Failure::new(format!("cannot write {what}: {error}"))
                .hint("check that its destination exists and has room"),
        }
    }

    /// The failure to read `what`.
    pub(crate) fn reading(what: impl Display, error: &io::Error) -> Failure {
        Failure::new(format!("cannot read {what}: {error}"))
            .hint("check its name and your rights to it")
    }

    /// Reports the failure; returns the exit code.
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

/// Tells the user about a problem that does not end the command.
pub(crate) fn warn(message: impl Display) {
    note("warning", AnsiColor::Yellow, message);
}

/// Adds advice to a warning.
pub(crate) fn advise(message: impl Display) {
    note("hint", AnsiColor::Cyan, message);
}

/// Tells the user something that is not a problem.
pub(crate) fn inform(message: impl Display) {
    // Without standard error there is nobody to tell.
    let _ = writeln!(anstream::stderr(), "{}", Harmless(message));
}

fn note(label: &str, color: AnsiColor, message: impl Display) {
    let style = Style::new().bold().fg_color(Some(color.into()));
    let _ = writeln!(anstream::stderr(), "{style}{label}:{style:#} {}", Harmless(message));
}
