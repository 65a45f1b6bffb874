//! What may go wrong.

use std::fmt;
use std::path::Path;

/// A result of the archive.
pub type Result<T> = std::result::Result<T, Error>;

/// Why the archive did not do what was asked for. Unless it says otherwise, nothing was changed.
#[derive(Debug)]
pub enum Error {
    /// There is nothing at this place, and nothing was to be made there.
    Missing {
        /// The archive.
        archive: String,
    },
    /// This is something else than an archive of ours.
    NotOurs {
        /// Its name.
        archive: String,
        /// What it is.
        what: String,
    },
    /// A newer program has made it.
    Newer {
        /// The archive.
        archive: String,
        /// The program that made it what it is.
        program: String,
        /// Its schema.
        schema: i64,
        /// The newest schema that this program knows.
        known: i64,
    },
    /// Somebody else is writing, and did not end in time.
    Busy {
        /// The archive.
        archive: String,
    },
    /// The connection to the server is lost. What was being written is there whole or not at all,
    /// and adding it again changes nothing. This archive stays lost: open it anew.
    Lost {
        /// The archive.
        archive: String,
    },
    /// What retention never lets go takes more than is to be kept in all.
    KeepsTooLittle {
        /// The archive.
        archive: String,
        /// How many bytes were to be kept.
        bytes: u64,
        /// About how many everything besides entries takes.
        evidence: u64,
    },
    /// The disk, or the quota, is full.
    Full {
        /// The archive.
        archive: String,
    },
    /// What is stored cannot be understood: it is damaged, or somebody has changed it.
    Damaged {
        /// The archive.
        archive: String,
        /// Where, and what.
        what: String,
    },
    /// An entry whose life or sequence is not known has no place in an archive.
    NoPlace {
        /// The recorder.
        recorder: String,
    },
    /// The database says no for another reason.
    Database {
        /// The archive.
        archive: String,
        /// What it says.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The writer has ended, so nobody knows whether this was written.
    WriterGone,
}

impl Error {
    /// What is damaged, and where.
    pub(crate) fn damaged(archive: &str, what: impl Into<String>) -> Error {
        Error::Damaged { archive: archive.to_owned(), what: what.into() }
    }

    /// Whether the same may succeed later, without anybody doing anything about this archive. After
    /// [`Error::Lost`] it may in one that is opened anew.
    #[must_use]
    pub const fn may_pass(&self) -> bool {
        matches!(self, Error::Busy { .. } | Error::Full { .. } | Error::Lost { .. })
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::Missing { archive } => write!(f, "there is no archive {archive}"),
            Error::NotOurs { archive, what } => write!(f, "{archive} is no archive: {what}"),
            Error::Newer { archive, program, schema, known } => write!(
                f,
                "{archive} was made by a newer program ({program}): it has schema {schema}, and \
                 this program knows schemas up to {known}"
            ),
            Error::Busy { archive } => write!(f, "another program is writing to {archive}"),
            Error::Lost { archive } => write!(f, "the connection to {archive} is lost"),
            Error::KeepsTooLittle { archive, bytes, evidence } => write!(
                f,
                "{bytes} bytes are too few for {archive}: what is known besides entries stays, and \
                 takes about {evidence}"
            ),
            Error::Full { archive } => write!(f, "there is no room left for {archive}"),
            Error::Damaged { archive, what } => write!(f, "{archive} is damaged: {what}"),
            Error::NoPlace { recorder } => write!(
                f,
                "an entry of {recorder} has no place: its life or its sequence is not known"
            ),
            Error::Database { archive, source } => write!(f, "{archive}: {source}"),
            Error::WriterGone => f.write_str("the archive's writer has ended"),
        }
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Error::Database { source, .. } => Some(&**source),
            _ => None,
        }
    }
}

/// The name of a file, for messages.
pub(crate) fn named(path: &Path) -> String {
    path.display().to_string()
}
