//! What may go wrong while a recorder is read.

use std::fmt;

use ser_client::{OpenError, RequestError};

/// Why a recorder is not being read.
#[derive(Debug)]
pub enum Trouble {
    /// Its port cannot be opened.
    Port(OpenError),
    /// Its port is written wrongly.
    NoPort(ser_client::EndpointError),
    /// It does not answer as it should.
    Recorder(RequestError),
    /// Another recorder of the site is at its port.
    Elsewhere {
        /// The recorder that is there.
        other: String,
    },
    /// What is at its port does not say which recorder it is, and this one has done so before.
    Nameless,
    /// Nobody knows how many entries its log holds.
    SizeUnknown,
    /// What it says cannot be archived.
    Archive(ser_archive::Error),
    /// The system has no random numbers to give.
    NoRandom(std::io::Error),
    /// It has begun another log, and is met anew.
    NewLog,
    /// Nothing shows that its log is still the one that was read, so it is met anew.
    Unproven,
    /// So much is held back that the recorder is asked which log it has.
    Held,
    /// The collector is to end.
    Stopped,
}

impl Trouble {
    /// Whether nothing helps but somebody who looks after the archive.
    #[must_use]
    pub const fn is_of_archive_for_good(&self) -> bool {
        use ser_archive::Error::{Damaged, Missing, Newer, NotOurs, WriterGone};
        matches!(
            self,
            Trouble::Archive(
                Damaged { .. } | Missing { .. } | Newer { .. } | NotOurs { .. } | WriterGone
            )
        )
    }

    /// What to try, if there is something to say.
    #[must_use]
    pub fn hint(&self) -> Option<String> {
        match self {
            Trouble::Port(error) => Some(error.hint().to_owned()),
            Trouble::Recorder(error) => error.hint().map(str::to_owned),
            Trouble::Elsewhere { .. } => Some(
                "are two cables exchanged? If the recorder was moved on purpose, say so with --moved"
                    .to_owned(),
            ),
            Trouble::Nameless => Some(
                "is the line disturbed? If an original recorder is there now on purpose, say so with \
                 --moved"
                    .to_owned(),
            ),
            Trouble::SizeUnknown => Some(
                "say in the site file how many entries its log has: log_size (2048 as delivered)"
                    .to_owned(),
            ),
            _ => None,
        }
    }
}

impl fmt::Display for Trouble {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Trouble::Port(error) => error.fmt(f),
            Trouble::NoPort(error) => write!(f, "its port: {error}"),
            Trouble::Recorder(error) => error.fmt(f),
            Trouble::Elsewhere { other } => write!(
                f,
                "the recorder at its port is {other}, so nothing of it is filed under this name"
            ),
            Trouble::Nameless => f.write_str(
                "the recorder at its port does not say which it is, as it did before, so nothing of it \
                 is filed",
            ),
            Trouble::SizeUnknown => f.write_str("it does not say how many entries its log holds"),
            Trouble::Archive(error) => error.fmt(f),
            Trouble::NoRandom(error) => write!(f, "there are no random numbers: {error}"),
            Trouble::NewLog => f.write_str("its log has begun anew"),
            Trouble::Unproven => f.write_str("nothing shows that its log is still the same"),
            Trouble::Held => f.write_str("a part of its log waits to be confirmed"),
            Trouble::Stopped => f.write_str("the collector ends"),
        }
    }
}

impl std::error::Error for Trouble {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Trouble::Port(error) => Some(error),
            Trouble::Recorder(error) => Some(error),
            Trouble::Archive(error) => Some(error),
            Trouble::NoRandom(error) => Some(error),
            _ => None,
        }
    }
}

impl From<RequestError> for Trouble {
    fn from(error: RequestError) -> Trouble {
        Trouble::Recorder(error)
    }
}

impl From<ser_archive::Error> for Trouble {
    fn from(error: ser_archive::Error) -> Trouble {
        Trouble::Archive(error)
    }
}
