//! What a recorder takes for a command.

use ser_proto::{Command, ParseError};

/// The command in a body, as a recorder has to understand it: it knows the commands of the manual,
/// and those of our extension are unknown to it.
pub(crate) fn command_in(body: &[u8]) -> Result<Command, ParseError> {
    match body {
        &[code, ..] if b"ITFD".contains(&code) => Err(ParseError::UnknownCode { code }),
        body => Command::parse(body),
    }
}
