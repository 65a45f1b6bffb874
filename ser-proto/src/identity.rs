//! Identity, command `I` of our extension: what a recorder is and can do.
//!
//! ```text
//! | 49 |                                                                  1 byte, the command
//! | 49 | level | inputs | firmware (3) | capabilities (4) | id (12) |
//!      | power-ups (4) | life (4) | log capacity (2) | guard |           33 bytes, the reply
//! ```
//! Everything but the life stays the same as long as a recorder has power, so a host asks once.

use core::fmt;

use nom::Parser;
use nom::combinator::map;
use nom::number::complete::{be_u8, be_u32};

use crate::capabilities::Capabilities;
use crate::fields::{Bytes, Fault, byte, word};
use crate::params::parse_growing;
use crate::recorder_id::RecorderId;
use crate::{Body, Code, MAX_SIZE, Model, ParseError};

/// The level of the extension that is described here.
pub const EXTENSION_LEVEL: u8 = 1;

/// The reply to `I`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Identity {
    /// The level of our extension that the recorder speaks, from 1. A higher level says more, and
    /// everything that a lower one says.
    pub level: u8,
    /// How many inputs it has.
    pub model: Model,
    /// The version of its firmware.
    pub firmware: FirmwareVersion,
    /// What it can be asked, and what it keeps.
    pub capabilities: Capabilities,
    /// The number that no other recorder has; `None` for a recorder that was not given one.
    pub id: Option<RecorderId>,
    /// Power-ups, this one included. They count from the making of the recorder with
    /// [`Capabilities::LASTING_COUNTS`]; otherwise this is 1.
    pub power_ups: u32,
    /// The life of the log now, from 1: each power-up and each erase begins another one. Lives go
    /// on after a power cut with [`Capabilities::LASTING_COUNTS`]; otherwise they begin anew.
    pub life: u32,
    /// The largest size that `C` can give the log, 1–2048 entries.
    pub log_capacity: u16,
    /// Whether the recorder guards its log and settings.
    pub guard: Guard,
}

/// The version of a firmware in three parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FirmwareVersion {
    /// Changes with what hosts have to know.
    pub major: u8,
    /// Changes with what is new.
    pub minor: u8,
    /// Changes with what is mended.
    pub patch: u8,
}

/// Whether a recorder refuses what would change its log or its settings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Guard {
    /// It has no guard. Code 0.
    #[default]
    None,
    /// A state that is not known here, by its code, 1–255.
    Other(u8),
}

impl Identity {
    pub(crate) fn parse(params: Bytes<'_>) -> Result<Identity, ParseError> {
        parse_growing(Code::Identify, params, fields)
    }

    pub(crate) fn to_body(self) -> Body {
        let FirmwareVersion { major, minor, patch } = self.firmware;
        let mut body = Body::new(Code::Identify);
        body.put(&[self.level, self.model.inputs(), major, minor, patch]);
        body.put_u32(self.capabilities.0);
        body.put(&RecorderId::to_bytes(self.id));
        body.put_u32(self.power_ups);
        body.put_u32(self.life);
        body.put_u16(self.log_capacity);
        body.put(&[self.guard.code()]);
        body
    }
}

fn fields(params: Bytes<'_>) -> nom::IResult<Bytes<'_>, Identity, Fault> {
    let level = byte(|level| (level > 0).then_some(level));
    let model = byte(|inputs| match inputs {
        16 => Some(Model::Ser160),
        32 => Some(Model::Ser320),
        _ => None,
    });
    let firmware =
        map((be_u8, be_u8, be_u8), |(major, minor, patch)| FirmwareVersion { major, minor, patch });
    let log_capacity = word(|size| (1..=MAX_SIZE).contains(&size).then_some(size));
    let counts = (be_u32, be_u32);
    (
        (level, model, firmware),
        map(be_u32, Capabilities),
        RecorderId::parser(),
        counts,
        log_capacity,
        map(be_u8, Guard::from_code),
    )
        .map(|((level, model, firmware), capabilities, id, (power_ups, life), capacity, guard)| {
            Identity {
                level,
                model,
                firmware,
                capabilities,
                id,
                power_ups,
                life,
                log_capacity: capacity,
                guard,
            }
        })
        .parse(params)
}

impl Guard {
    /// The state with wire code `code`.
    #[must_use]
    pub const fn from_code(code: u8) -> Guard {
        match code {
            0 => Guard::None,
            other => Guard::Other(other),
        }
    }

    /// The wire code.
    #[must_use]
    pub const fn code(self) -> u8 {
        match self {
            Guard::None => 0,
            Guard::Other(code) => code,
        }
    }
}

/// As `1.0.2`.
impl fmt::Display for FirmwareVersion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}.{}", self.major, self.minor, self.patch)
    }
}

/// As `no guard`.
impl fmt::Display for Guard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Guard::None => f.write_str("no guard"),
            Guard::Other(code) => write!(f, "guard in state {code}, which is not known here"),
        }
    }
}
