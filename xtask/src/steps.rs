//! Runs other programs: prints headings with the time, and tells how to repeat a failed step.

use std::ffi::OsStr;
use std::fmt;
use std::io::{self, Write};
use std::path::Path;
use std::process::{Command, ExitCode};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use ser_console::Harmless;

/// Why a verb ended early, with a hint at what to do.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The message for the user.
    Told(String),
    /// Standard output cannot be written any more.
    Unwritten(io::Error),
}

impl Failure {
    pub(crate) fn new(text: impl Into<String>) -> Failure {
        Failure::Told(text.into())
    }

    /// Tells the user and returns the exit code.
    pub(crate) fn report(&self) -> ExitCode {
        if let Failure::Unwritten(error) = self {
            return ser_console::unwritten(error);
        }
        say(self);
        ExitCode::FAILURE
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Failure::Told(text) => write!(f, "\nxtask: {}", Harmless(text)),
            Failure::Unwritten(error) => {
                write!(f, "\nxtask: cannot write standard output: {error}")
            }
        }
    }
}

/// Prints on standard error. When that is gone, nobody can be told.
pub(crate) fn say(line: &dyn fmt::Display) {
    let _ = writeln!(io::stderr(), "{line}");
}

/// Prints on standard output.
pub(crate) fn print(text: impl fmt::Display) -> Result<()> {
    ser_console::print(text).map_err(Failure::Unwritten)
}

pub(crate) type Result<T> = std::result::Result<T, Failure>;

/// The steps so far, each with its start.
static STEPS: Mutex<Vec<(String, Instant)>> = Mutex::new(Vec::new());

/// Announces the next step, with the time since the first one.
pub(crate) fn heading(text: &str) {
    let mut steps = STEPS.lock().unwrap_or_else(PoisonError::into_inner);
    steps.push((text.to_owned(), Instant::now()));
    let since_first = steps.first().map_or(Duration::ZERO, |(_, began)| began.elapsed());
    say(&format_args!("\n==> {}  {}", minutes(since_first), Harmless(text)));
}

/// Prints how long each step took.
pub(crate) fn print_durations() {
    let steps = STEPS.lock().unwrap_or_else(PoisonError::into_inner);
    say(&"\n==> Time of each step (minutes:seconds)");
    durations(&steps, Instant::now()).iter().for_each(|line| say(line));
}

/// A line for each step, and one for the sum.
fn durations(steps: &[(String, Instant)], end: Instant) -> Vec<String> {
    let ends = steps.iter().skip(1).map(|&(_, began)| began).chain([end]);
    let line = |took, text: &str| format!("{:>8}  {text}", minutes(took));
    let mut lines: Vec<String> =
        steps.iter().zip(ends).map(|((text, began), end)| line(end - *began, text)).collect();
    let total = steps.first().map_or(Duration::ZERO, |&(_, began)| end - began);
    lines.push(line(total, "together"));
    lines
}

/// As `3:07`.
fn minutes(time: Duration) -> String {
    let seconds = time.as_secs();
    format!("{}:{:02}", seconds / 60, seconds % 60)
}

/// Prints a note on what is not done, and why.
pub(crate) fn note(text: &str) {
    say(&format_args!("    {}", Harmless(text)));
}

/// Variables that cargo and rustup set for xtask, which would mislead other toolchains.
const OURS: [&str; 14] = [
    "CARGO",
    "CARGO_BIN_NAME",
    "CARGO_CRATE_NAME",
    "CARGO_MANIFEST_DIR",
    "CARGO_MANIFEST_PATH",
    "CARGO_PRIMARY_PACKAGE",
    "DYLD_FALLBACK_LIBRARY_PATH",
    "LD_LIBRARY_PATH",
    "OUT_DIR",
    "RUSTC",
    "RUSTDOC",
    "RUSTUP_TOOLCHAIN",
    "RUSTUP_TOOLCHAIN_SOURCE",
    "RUST_RECURSION_COUNT",
];

/// A program that must know nothing of the cargo that runs xtask.
pub(crate) fn unrelated(program: impl AsRef<OsStr>) -> Command {
    let mut command = Command::new(program);
    OURS.into_iter().for_each(|name| _ = command.env_remove(name));
    command
}

/// A program of the toolchain that runs xtask.
pub(crate) fn in_use(program: &str) -> Command {
    let mut command = unrelated(program);
    if let Some(toolchain) = std::env::var_os("RUSTUP_TOOLCHAIN") {
        command.env("RUSTUP_TOOLCHAIN", toolchain);
    }
    command
}

/// The host's cargo, in the root of the repository.
pub(crate) fn cargo() -> Command {
    let mut command = in_use("cargo");
    command.current_dir(crate::places::root());
    command
}

/// Runs a program to its end, with its output shown.
pub(crate) fn run(command: &mut Command) -> Result<()> {
    let status = command.status().map_err(|error| {
        Failure::new(format!("cannot run {}: {error}", command.get_program().display()))
    })?;
    if status.success() {
        Ok(())
    } else {
        Err(Failure::new(format!(
            "this failed ({status}); to repeat it alone:\n  {}",
            repeat(command)
        )))
    }
}

/// Replaces this process by the program, so that Ctrl-C and the exit status are its own.
pub(crate) fn become_program(command: &mut Command) -> Result<()> {
    #[cfg(unix)]
    {
        use std::os::unix::process::CommandExt;
        let error = command.exec();
        Err(Failure::new(format!("cannot run {}: {error}", command.get_program().display())))
    }
    #[cfg(not(unix))]
    run(command)
}

/// The output of a program, if it can be run and succeeds.
pub(crate) fn output(command: &mut Command) -> Option<String> {
    let output = command.output().ok().filter(|output| output.status.success())?;
    Some(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// Whether a program can be run and succeeds; its output is not shown.
pub(crate) fn works(command: &mut Command) -> bool {
    output(command).is_some()
}

/// The command as a person would type it.
fn repeat(command: &Command) -> String {
    let mut line = String::new();
    if let Some(directory) =
        command.get_current_dir().filter(|&directory| directory != Path::new("."))
    {
        line += &format!("cd {} && ", quoted(directory.as_os_str()));
    }
    for (name, value) in command.get_envs() {
        // A person who types the command has no variables to remove, and no toolchain chosen by
        // cargo.
        if let Some(value) = value.filter(|_| name != "RUSTUP_TOOLCHAIN") {
            line += &format!("{}={} ", name.display(), quoted(value));
        }
    }
    line += &quoted(command.get_program());
    for argument in command.get_args() {
        line += " ";
        line += &quoted(argument);
    }
    line
}

fn quoted(text: &OsStr) -> String {
    let text = text.to_string_lossy();
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@\\".contains(c);
    if !text.is_empty() && text.chars().all(plain) {
        text.into_owned()
    } else {
        format!("'{text}'")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_step_lasts_until_the_next_one_begins() {
        let began = Instant::now();
        let at = |seconds| began + Duration::from_secs(seconds);
        let steps = [
            ("Format".to_owned(), at(0)),
            ("Tests".to_owned(), at(5)),
            ("More".to_owned(), at(130)),
        ];
        assert_eq!(
            durations(&steps, at(131)),
            ["    0:05  Format", "    2:05  Tests", "    0:01  More", "    2:11  together"]
        );
    }

    #[test]
    fn a_command_is_repeated_as_one_would_type_it() {
        let mut command = unrelated("cargo");
        command.current_dir("/a b").env("RUSTDOCFLAGS", "-D warnings").args(["doc", "--no-deps"]);
        assert_eq!(repeat(&command), "cd '/a b' && RUSTDOCFLAGS='-D warnings' cargo doc --no-deps");
    }
}
