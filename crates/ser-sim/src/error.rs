//! What can go wrong around a simulated recorder.

use std::path::PathBuf;
use std::time::Duration;
use std::{fmt, io};

use crate::contacts::scenario_error::ScenarioError;

/// Why a simulator did not start, or ended.
#[derive(Debug)]
pub enum SimError {
    /// The contact scenario is wrong.
    Scenario(ScenarioError),
    /// An operation failed.
    Io {
        /// What was being tried, as in `listen on 127.0.0.1:4000`.
        doing: String,
        /// Why it failed.
        source: io::Error,
    },
    /// No host of this name is known; `HOST:PORT`.
    NoSuchHost(String),
    /// Something that is not ours to replace stands where the link is to go.
    LinkTaken(PathBuf),
    /// Another simulator has the link.
    LinkInUse(PathBuf),
    /// The file that is to be the GENI window already exists and is something else.
    WindowTaken(PathBuf),
    /// Another simulator has the GENI window.
    WindowInUse(PathBuf),
    /// There is no place to note that a link or a window is in use.
    NoRecords(NoRecords),
    /// Something already exists under the name of the log.
    LogTaken(PathBuf),
    /// The emulator is not installed.
    EmulatorMissing {
        /// The program that was looked for.
        program: PathBuf,
    },
    /// The emulator ended by itself.
    EmulatorEnded {
        /// How it ended, as in `exit status: 1`.
        how: String,
        /// What it printed on standard error.
        printed: String,
    },
    /// The image runs but does not answer.
    NoAnswer {
        /// How long it had.
        waited: Duration,
        /// What the emulator printed on standard error.
        printed: String,
    },
    /// This operating system does not have it.
    Unsupported(&'static str),
    /// The simulator has ended; [`Simulator::stop`](crate::Simulator::stop) says why.
    Ended,
    /// The contacts have not finished moving in the time given.
    StillPlaying,
}

/// No place was found for the user's directory of notes on who has which link or window.
#[derive(Debug)]
pub struct NoRecords {
    /// The link or window.
    pub name: PathBuf,
    /// The directories that were tried, in order of preference.
    pub tried: Vec<(PathBuf, FolderFault)>,
}

/// Why a directory cannot be used for notes that nobody else may change.
#[derive(Debug)]
pub enum FolderFault {
    /// It belongs to another user.
    NotYours,
    /// Others can look into it or change it.
    OpenToOthers,
    /// Something else is there: a file, or a link.
    NoFolder,
    /// It cannot be made or opened.
    Other(io::Error),
}

impl NoRecords {
    /// What a person can do about it, one hint a line. There are none where only the reasons help.
    pub fn hints(&self) -> impl Iterator<Item = String> {
        self.tried.iter().filter_map(|(path, fault)| {
            let path = path.display();
            match fault {
                FolderFault::NotYours => Some(format!("remove {path}, which is not yours")),
                FolderFault::NoFolder => Some(format!("remove {path}, which is not a folder")),
                FolderFault::OpenToOthers => Some(format!("keep others out: chmod 700 {path}")),
                FolderFault::Other(_) => None,
            }
        })
    }
}

impl fmt::Display for NoRecords {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "cannot note that {} is in use", self.name.display())?;
        for (index, (path, fault)) in self.tried.iter().enumerate() {
            let between = if index == 0 { ": " } else { "; " };
            write!(f, "{between}{} ", path.display())?;
            match fault {
                FolderFault::NotYours => f.write_str("belongs to another user")?,
                FolderFault::OpenToOthers => f.write_str("is open to others")?,
                FolderFault::NoFolder => f.write_str("is not a folder")?,
                FolderFault::Other(error) => write!(f, "cannot be used: {error}")?,
            }
        }
        Ok(())
    }
}

impl SimError {
    /// Makes an error that says what was being tried, as in `listen on 127.0.0.1:4000`.
    pub fn io(doing: impl Into<String>) -> impl FnOnce(io::Error) -> SimError {
        let doing = doing.into();
        |source| SimError::Io { doing, source }
    }
}

impl fmt::Display for SimError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SimError::Scenario(error) => error.fmt(f),
            SimError::Io { doing, source } => write!(f, "cannot {doing}: {source}"),
            SimError::NoSuchHost(address) => {
                write!(f, "cannot listen on {address}: no host of this name is known")
            }
            SimError::NoRecords(no_records) => no_records.fmt(f),
            SimError::LinkInUse(path) | SimError::WindowInUse(path) => {
                write!(f, "another simulator uses {}", path.display())
            }
            SimError::LinkTaken(path) => {
                write!(
                    f,
                    "{} exists already, and no simulator of yours has made it: it is left alone",
                    path.display()
                )
            }
            SimError::WindowTaken(path) | SimError::LogTaken(path) => {
                write!(f, "{} exists already: it is left alone", path.display())
            }
            SimError::EmulatorMissing { program } => write!(
                f,
                "{} is not installed; it comes with the package qemu-system-arm (Debian, Ubuntu) \
                 or qemu (others)",
                program.display()
            ),
            SimError::EmulatorEnded { how, printed } => {
                write!(f, "the emulator ended ({how})")?;
                write_printed(f, printed)
            }
            SimError::NoAnswer { waited, printed } => {
                write!(
                    f,
                    "the image in the emulator did not answer within {} s",
                    waited.as_secs()
                )?;
                write_printed(f, printed)
            }
            SimError::Unsupported(what) => write!(f, "{what} is not available on this system"),
            SimError::Ended => write!(f, "the simulator has ended"),
            SimError::StillPlaying => write!(f, "the contacts have not finished moving"),
        }
    }
}

fn write_printed(f: &mut fmt::Formatter<'_>, printed: &str) -> fmt::Result {
    match printed.trim() {
        "" => write!(f, " and printed nothing"),
        printed => write!(f, " and printed: {printed}"),
    }
}

impl std::error::Error for SimError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            SimError::Scenario(error) => Some(error),
            SimError::Io { source, .. } => Some(source),
            _ => None,
        }
    }
}

impl From<ScenarioError> for SimError {
    fn from(error: ScenarioError) -> Self {
        SimError::Scenario(error)
    }
}
