//! Last broadcast, command `L` (manual, section "Last Broadcast Command").
//!
//! ```text
//! | 4C | code | hour | minute | second | millisecond (2) |    7 bytes; all zero: no broadcast yet
//! ```

use core::fmt;

use nom::Parser;
use nom::number::complete::be_u8;

use crate::fields::{Bytes, below, byte, word};
use crate::params::parse_params;
use crate::{Body, Code, ParseError};

/// The command last received as a broadcast, and the time of its reception.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LastBroadcast {
    /// The command byte of the broadcast.
    pub code: u8,
    /// Hour of reception, 0–23.
    pub hour: u8,
    /// Minute of reception, 0–59.
    pub minute: u8,
    /// Second of reception, 0–59.
    pub second: u8,
    /// Millisecond of reception, 0–999.
    pub millisecond: u16,
}

impl LastBroadcast {
    const NONE: LastBroadcast =
        LastBroadcast { code: 0, hour: 0, minute: 0, second: 0, millisecond: 0 };

    pub(crate) fn parse(params: Bytes<'_>) -> Result<Option<LastBroadcast>, ParseError> {
        let fields = (be_u8, byte(below(24)), byte(below(60)), byte(below(60)), word(below(1000)))
            .map(|(code, hour, minute, second, millisecond)| LastBroadcast {
                code,
                hour,
                minute,
                second,
                millisecond,
            });
        let reply = parse_params(Code::LastBroadcast, params, 6, fields)?;
        Ok((reply != LastBroadcast::NONE).then_some(reply))
    }

    pub(crate) fn to_body(reply: Option<LastBroadcast>) -> Body {
        let reply = reply.unwrap_or(LastBroadcast::NONE);
        let mut body = Body::new(Code::LastBroadcast);
        body.put(&[reply.code, reply.hour, reply.minute, reply.second]);
        body.put_u16(reply.millisecond);
        body
    }
}

/// As `erase at 14:30:50.250`.
impl fmt::Display for LastBroadcast {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match Code::from_byte(self.code) {
            Some(code) => write!(f, "{}", code.name())?,
            None => write!(f, "unknown command {:02X}h", self.code)?,
        }
        write!(
            f,
            " at {:02}:{:02}:{:02}.{:03}",
            self.hour, self.minute, self.second, self.millisecond
        )
    }
}
