//! What the line looked like while an answer did not come, and what a person can do about it.
//!
//! The difference of two counts tells silence from a wrong rate, from noise, and from a recorder
//! that sends something else.

use std::fmt;

use ser_proto::ParseError;

use super::counters::Counters;

/// Why there was no answer, as far as the bytes that did arrive can tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Diagnosis {
    /// Not one byte arrived. A recorder that is asked at a wrong baud rate hears garbage and is
    /// silent, too.
    Silent,
    /// The recorder is on the Genius bus and did not answer.
    SilentOnBus {
        /// Its bus address.
        node: u8,
    },
    /// The recorder is on the Genius bus, but the last datagram sent to it did not arrive.
    Unacknowledged {
        /// Its bus address.
        node: u8,
    },
    /// Bytes arrived, but none of them made sense: most likely the baud rate is wrong.
    Garbage {
        /// How many bytes.
        bytes: u64,
    },
    /// Frames arrived damaged and none arrived whole: there is noise on the line.
    Damaged {
        /// How many frames had a wrong checksum or were incomplete.
        frames: u64,
    },
    /// The recorder answered this command, but the answer is not such a message.
    NotUnderstood(ParseError),
    /// The recorder sends frames or lines of text, but does not answer this command. An original
    /// recorder does not answer the queries that this project added to the protocol, nor any
    /// command that it refuses.
    Ignored {
        /// Frames with other contents.
        frames: u64,
        /// Lines of text.
        lines: u64,
    },
}

impl Diagnosis {
    /// Judges what was counted while the answer was awaited. `not_understood` is the error of the
    /// last answer to the command; `unfinished` says whether a frame had begun but not ended.
    pub(crate) fn of(
        seen: &Counters,
        not_understood: Option<ParseError>,
        unfinished: bool,
    ) -> Diagnosis {
        if seen.bytes == 0 {
            return Diagnosis::Silent;
        }
        if let Some(error) = not_understood {
            return Diagnosis::NotUnderstood(error);
        }
        if seen.frames > 0 || seen.lines > 0 {
            return Diagnosis::Ignored { frames: seen.frames, lines: seen.lines };
        }
        // At a wrong rate an ESC may appear by chance, but hardly ever a length and a body of
        // digits after it.
        if seen.bad_checksums > 0 || unfinished {
            let frames = seen.bad_checksums + seen.broken_frames + u64::from(unfinished);
            return Diagnosis::Damaged { frames };
        }
        Diagnosis::Garbage { bytes: seen.bytes }
    }

    /// What a person can try next.
    #[must_use]
    pub const fn hint(&self) -> &'static str {
        match self {
            Diagnosis::Silent => {
                "check power, port, cable (null modem?) and baud rate (recorders are delivered \
                 with 9600)"
            }
            Diagnosis::SilentOnBus { .. } => {
                "is this device a recorder, is it running, and is the bus free of errors? Or \
                 wait longer for the answer"
            }
            Diagnosis::Unacknowledged { .. } => {
                "try again; if it persists, look for errors on the bus: cable, terminators, a \
                 bus address that is used twice"
            }
            Diagnosis::Garbage { .. } => "try another baud rate; recorders are delivered with 9600",
            Diagnosis::Damaged { .. } => {
                "check cable, shielding and ground, or choose a lower baud rate"
            }
            Diagnosis::NotUnderstood(_) => {
                "is this a sequential event recorder, and nothing else on the line?"
            }
            Diagnosis::Ignored { .. } => {
                "original recorders do not know this query, or refused what was asked"
            }
        }
    }
}

impl fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Diagnosis::Silent => write!(f, "not one byte came back"),
            Diagnosis::SilentOnBus { node } => {
                write!(f, "device {node} is on the bus and does not reply")
            }
            Diagnosis::Unacknowledged { node } => {
                write!(f, "device {node} is on the bus and the datagram did not get through to it")
            }
            Diagnosis::Garbage { bytes } => {
                write!(f, "{bytes} bytes came back and none made sense")
            }
            Diagnosis::Damaged { frames } => write!(f, "{frames} damaged frames came back"),
            Diagnosis::NotUnderstood(error) => write!(f, "the answer was not understood: {error}"),
            Diagnosis::Ignored { frames, lines } => {
                write!(
                    f,
                    "the recorder talks ({frames} frames, {lines} lines of text) but does not \
                     answer this"
                )
            }
        }
    }
}
