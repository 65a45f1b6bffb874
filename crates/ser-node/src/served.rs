//! Which commands the recorder serves: those of the manual.
//!
//! Those of our extension are unknown to it: it stays silent and counts them so, whatever their
//! parameters are.

use ser_proto::{Code, Command, ParseError};

/// The command in a body that came from a host.
pub(crate) fn command_in(body: &[u8]) -> Result<Command, ParseError> {
    match body {
        [code, ..] if Code::from_byte(*code).is_some_and(Code::is_of_extension) => {
            Err(ParseError::UnknownCode { code: *code })
        }
        body => Command::parse(body),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_of_the_extension_are_unknown_whatever_their_parameters_are() {
        for code in *b"ITFD" {
            for parameters in 0..12 {
                let mut body = vec![code];
                body.resize(1 + parameters, 1);
                assert_eq!(command_in(&body), Err(ParseError::UnknownCode { code }));
            }
        }
    }

    #[test]
    fn those_of_the_manual_are_served() {
        assert_eq!(command_in(b"E"), Ok(Command::Erase));
        assert_eq!(command_in(&[]), Err(ParseError::Empty));
        assert_eq!(command_in(&[0x58]), Err(ParseError::UnknownCode { code: 0x58 }));
    }
}
