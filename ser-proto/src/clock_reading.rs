//! What the clock shows, command `T` of our extension.
//!
//! ```text
//! | 54 |                                                        1 byte: a command with token 0
//! | 54 | token (2) |                                            3 bytes, the command
//! | 54 | token (2) | clock (8) | source | age (4) | doubt (4) | drift (4) |
//!      | tick (8) | life (4) | next sequence (8) | mark's token (2) | mark's clock (8) |
//!                                                              54 bytes, the reply
//! ```
//! Clock and tick are those of the moment at which the last byte of the question arrived. A
//! broadcast question is not answered: it is a mark, and the recorder keeps what its clock showed
//! at its arrival.

use nom::Parser;
use nom::combinator::map;
use nom::number::complete::{be_i32, be_i64, be_u8, be_u16, be_u32, be_u64};

use crate::clock_source::ClockSource;
use crate::fields::{Bytes, Fault};
use crate::params::{parse_growing, parse_params};
use crate::{Body, Code, Command, ParseError};

/// On the wire: the doubt is not known.
const DOUBT_UNKNOWN: u32 = u32::MAX;

/// On the wire: the drift is not known. No crystal is that slow.
const DRIFT_UNKNOWN: i32 = i32::MIN;

/// On the wire: there was no mark. No clock shows that.
const NO_MARK: i64 = i64::MIN;

/// The reply to `T`: what the recorder's clock showed when the question had arrived.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ClockReading {
    /// The token of the question, so that a late reply is not taken for that of a later question.
    pub token: u16,
    /// The recorder's clock, in microseconds since 1970 as if it were UTC. It is the clock that
    /// stamps entries: a stamp is this time cut to milliseconds.
    pub clock_us: i64,
    /// Where the clock has its time from.
    pub source: ClockSource,
    /// Seconds since the clock was last set or disciplined, whole ones; since power-up if it never
    /// was.
    pub age_s: u32,
    /// How far the clock may be off its source, in microseconds either way; `None` if that is not
    /// known.
    pub doubt_us: Option<u32>,
    /// How much faster the clock runs than its source, in parts per billion, where it has been
    /// measured. Never `i32::MIN`.
    pub drift_ppb: Option<i32>,
    /// Microseconds since power-up, which no setting of the clock moves.
    pub tick_us: u64,
    /// The life of the log, as in [`Identity`](crate::Identity).
    pub life: u32,
    /// The sequence of the next event in this life: 1 before the first one. The total of `R` is one
    /// less, modulo 65536.
    pub next_sequence: u64,
    /// The last mark since power-up.
    pub last_mark: Option<Mark>,
}

/// A broadcast `T` as a recorder received it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Mark {
    /// The token of the broadcast.
    pub token: u16,
    /// What the clock showed at its arrival, as in [`ClockReading::clock_us`]; never `i64::MIN`.
    pub clock_us: i64,
}

impl ClockReading {
    pub(crate) fn parse(params: Bytes<'_>) -> Result<ClockReading, ParseError> {
        parse_growing(Code::Time, params, fields)
    }

    pub(crate) fn to_body(self) -> Body {
        let mut body = Body::new(Code::Time);
        body.put_u16(self.token);
        body.put_i64(self.clock_us);
        body.put(&[self.source.code()]);
        body.put_u32(self.age_s);
        body.put_u32(self.doubt_us.unwrap_or(DOUBT_UNKNOWN));
        body.put(&self.drift_ppb.unwrap_or(DRIFT_UNKNOWN).to_be_bytes());
        body.put_u64(self.tick_us);
        body.put_u32(self.life);
        body.put_u64(self.next_sequence);
        let mark = self.last_mark.unwrap_or(Mark { token: 0, clock_us: NO_MARK });
        body.put_u16(mark.token);
        body.put_i64(mark.clock_us);
        body
    }
}

fn fields(params: Bytes<'_>) -> nom::IResult<Bytes<'_>, ClockReading, Fault> {
    let source = map(be_u8, ClockSource::from_code);
    let doubt = map(be_u32, |doubt_us| (doubt_us != DOUBT_UNKNOWN).then_some(doubt_us));
    let drift = map(be_i32, |drift_ppb| (drift_ppb != DRIFT_UNKNOWN).then_some(drift_ppb));
    let mark = map((be_u16, be_i64), |(token, clock_us)| {
        (clock_us != NO_MARK).then_some(Mark { token, clock_us })
    });
    (be_u16, be_i64, (source, be_u32, doubt, drift), be_u64, be_u32, be_u64, mark)
        .map(|(token, clock_us, quality, tick_us, life, next_sequence, last_mark)| {
            let (source, age_s, doubt_us, drift_ppb) = quality;
            ClockReading {
                token,
                clock_us,
                source,
                age_s,
                doubt_us,
                drift_ppb,
                tick_us,
                life,
                next_sequence,
                last_mark,
            }
        })
        .parse(params)
}

/// A `T` of a host.
pub(crate) fn parse_question(params: Bytes<'_>) -> Result<Command, ParseError> {
    let token = match params {
        [] => 0,
        params => parse_params(Code::Time, params, 2, be_u16)?,
    };
    Ok(Command::Time { token })
}
