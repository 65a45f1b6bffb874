//! Counters of everything that was dropped, refused or lost.
//!
//! The protocol has no negative reply, so these are the only trace of bad input. A board logs them
//! when they change.

use ser_proto::{FrameError, ParseError};

/// Counts since power-up; they stop at the largest value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Diagnostics {
    /// Frames given up because a new one began.
    pub frames_interrupted: u32,
    /// Frames given up at a character that is no hexadecimal digit.
    pub frames_not_hex: u32,
    /// Frames with a wrong checksum.
    pub frames_checksum: u32,
    /// Frames longer than any command.
    pub frames_too_long: u32,
    /// Frames without a command byte.
    pub frames_empty: u32,
    /// Bytes that the UART lost or could not read.
    pub line_errors: u32,
    /// Bodies with an unknown command byte.
    pub commands_unknown: u32,
    /// Bodies that have a wrong length for their command.
    pub commands_wrong_length: u32,
    /// Commands with a parameter that is out of range.
    pub parameters_refused: u32,
    /// Commands that found no place to wait for their reply.
    pub commands_overrun: u32,
    /// Input changes that found the capture queue full.
    pub edges_lost: u32,
    /// Milliseconds in which no sample was taken.
    pub samples_missed: u32,
    /// Settings of clock or mode that were read too late: changes after their arrival had already
    /// been recorded. Those changes have the old clock and mode.
    pub settings_late: u32,
    /// Events overwritten before auto report had sent them.
    pub events_unreported: u32,
    /// Events overwritten before auto print had printed them.
    pub events_unprinted: u32,
    /// Configurations that could not be stored.
    pub storage_errors: u32,
}

impl Diagnostics {
    /// All of them, in the order of the fields.
    pub(crate) const fn all(&self) -> [u32; 16] {
        [
            self.frames_interrupted,
            self.frames_not_hex,
            self.frames_checksum,
            self.frames_too_long,
            self.frames_empty,
            self.line_errors,
            self.commands_unknown,
            self.commands_wrong_length,
            self.parameters_refused,
            self.commands_overrun,
            self.edges_lost,
            self.samples_missed,
            self.settings_late,
            self.events_unreported,
            self.events_unprinted,
            self.storage_errors,
        ]
    }

    pub(crate) fn count_frame_error(&mut self, cause: FrameError) {
        let counter = match cause {
            FrameError::Interrupted | FrameError::Incomplete => &mut self.frames_interrupted,
            FrameError::NotHex { .. } => &mut self.frames_not_hex,
            FrameError::Checksum { .. } => &mut self.frames_checksum,
            FrameError::TooLong { .. } => &mut self.frames_too_long,
            FrameError::Empty => &mut self.frames_empty,
        };
        count(counter, 1);
    }

    pub(crate) fn count_parse_error(&mut self, error: ParseError) {
        let counter = match error {
            ParseError::Empty => &mut self.frames_empty,
            ParseError::UnknownCode { .. } => &mut self.commands_unknown,
            ParseError::WrongLength { .. }
            | ParseError::TooShort { .. }
            | ParseError::EntrySize { .. } => &mut self.commands_wrong_length,
            ParseError::BadValue { .. } => &mut self.parameters_refused,
        };
        count(counter, 1);
    }
}

/// Adds to a counter that stops at its largest value.
pub(crate) fn count(counter: &mut u32, by: u64) {
    *counter = counter.saturating_add(u32::try_from(by).unwrap_or(u32::MAX));
}
