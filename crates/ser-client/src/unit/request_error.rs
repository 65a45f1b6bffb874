//! Why a request to a recorder did not succeed.

use std::error::Error;
use std::fmt;

use ser_proto::{Code, Configuration, InputFilter, InvalidTime};

use crate::reading::disturbed::Disturbed;
use crate::session::NoReply;
use crate::session::diagnosis::Diagnosis;
use crate::transport::transport_error::TransportError;

/// Why a request did not succeed.
#[derive(Debug)]
pub enum RequestError {
    /// No answer came in time.
    NoReply {
        /// The command that was not answered.
        command: Code,
        /// How often it was sent. Commands that must not be carried out twice are sent once.
        attempts: u32,
        /// What the line looked like.
        diagnosis: Diagnosis,
        /// Whether the command may have changed something if it arrived: an erase may or may not
        /// have been done.
        may_have_been_done: bool,
    },
    /// The recorder did not take the settings.
    Refused {
        /// The configuration in force.
        in_force: Configuration,
    },
    /// The recorder did not take the filter.
    FilterRefused {
        /// The input, or the first one where all were meant.
        input: u8,
        /// The filter in force there.
        in_force: InputFilter,
    },
    /// The answer belongs to the command but does not confirm what was asked for.
    UnexpectedReply {
        /// The command.
        command: Code,
    },
    /// The date or time does not exist. It was not sent, because a recorder would just not answer.
    InvalidTime(InvalidTime),
    /// The log was changed during the reading in a way that could not be followed.
    Disturbed(Disturbed),
    /// The line failed.
    Transport(TransportError),
}

impl RequestError {
    /// What a person can try next, if there is something to say.
    #[must_use]
    pub fn hint(&self) -> Option<&'static str> {
        match self {
            RequestError::NoReply { diagnosis, .. } => Some(diagnosis.hint()),
            RequestError::Refused { .. } => {
                Some("a recorder refuses all settings when one of them is out of range")
            }
            RequestError::FilterRefused { .. } => Some(
                "a recorder also refuses filters whose values it does not have, or that it guards",
            ),
            RequestError::Disturbed(disturbed) => Some(disturbed.hint()),
            RequestError::Transport(error) => error.hint(),
            RequestError::UnexpectedReply { .. } | RequestError::InvalidTime(_) => None,
        }
    }
}

impl fmt::Display for RequestError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RequestError::NoReply { command, attempts, diagnosis, may_have_been_done } => {
                let times = if *attempts == 1 { "once" } else { "repeatedly" };
                write!(f, "no answer to \"{}\" (sent {times}): {diagnosis}", command.name())?;
                if *may_have_been_done {
                    write!(f, "; it may or may not have been carried out")?;
                }
                Ok(())
            }
            RequestError::Refused { .. } => write!(f, "the recorder did not take the settings"),
            RequestError::FilterRefused { input, in_force } => {
                write!(f, "the recorder did not take the filter; input {input} has: {in_force}")
            }
            RequestError::UnexpectedReply { command } => {
                write!(f, "the answer to \"{}\" does not say what was asked for", command.name())
            }
            RequestError::InvalidTime(error) => error.fmt(f),
            RequestError::Disturbed(error) => error.fmt(f),
            RequestError::Transport(error) => error.fmt(f),
        }
    }
}

impl Error for RequestError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            RequestError::Transport(error) => error.source(),
            _ => None,
        }
    }
}

impl From<TransportError> for RequestError {
    fn from(error: TransportError) -> RequestError {
        RequestError::Transport(error)
    }
}

impl From<Disturbed> for RequestError {
    fn from(disturbed: Disturbed) -> RequestError {
        RequestError::Disturbed(disturbed)
    }
}

impl From<NoReply> for RequestError {
    fn from(no_reply: NoReply) -> RequestError {
        let NoReply { command, attempts, diagnosis, may_have_been_done } = no_reply;
        RequestError::NoReply { command, attempts, diagnosis, may_have_been_done }
    }
}
