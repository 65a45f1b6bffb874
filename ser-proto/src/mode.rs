//! Mode and status, command `M` (manual, section "Mode and Status").
//!
//! ```text
//! | 4D | mode | version |    3 bytes; mode: 0 stopped, 1 recording; version: 100 is 1.00
//! ```

use core::fmt;

use nom::Parser;
use nom::number::complete::be_u8;

use crate::fields::{Bytes, byte, flag};
use crate::params::parse_params;
use crate::{Body, Code, ParseError};

/// The reply to `M`: whether the recorder records, and its firmware version.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Mode {
    /// Whether events are being recorded.
    pub recording: bool,
    /// Firmware version in hundredths: 125 is 1.25.
    pub version: u8,
}

impl Mode {
    pub(crate) fn parse(params: Bytes<'_>) -> Result<Mode, ParseError> {
        let fields = (byte(flag), be_u8).map(|(recording, version)| Mode { recording, version });
        parse_params(Code::Mode, params, 2, fields)
    }

    pub(crate) fn to_body(self) -> Body {
        let mut body = Body::new(Code::Mode);
        body.put(&[u8::from(self.recording), self.version]);
        body
    }
}

/// As `recording, version 1.25`.
impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mode = if self.recording { "recording" } else { "stopped" };
        write!(f, "{mode}, version {}.{:02}", self.version / 100, self.version % 100)
    }
}
