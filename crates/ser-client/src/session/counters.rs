//! What a session has seen on the line. [`Diagnosis`](super::diagnosis::Diagnosis) derives the
//! cause from it when an answer does not come.

use ser_proto::FrameError;

/// Counts since the session began. The difference of two shows what happened in between.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Bytes of any kind.
    pub bytes: u64,
    /// Frames with a good checksum.
    pub frames: u64,
    /// Frames with a good checksum whose body is no message.
    pub not_understood: u64,
    /// Frames that were dropped because their checksum is wrong.
    pub bad_checksums: u64,
    /// Frames that were dropped for any other reason.
    pub broken_frames: u64,
    /// Read replies that nobody asked for.
    pub reports: u64,
    /// Other replies that nobody was waiting for, such as an answer that came too late.
    pub stray_replies: u64,
    /// Clean lines of text.
    pub lines: u64,
    /// Bytes outside frames that have no place in text.
    pub noise: u64,
}

impl Counters {
    pub(crate) fn dropped(&mut self, cause: FrameError) {
        match cause {
            FrameError::Checksum { .. } => self.bad_checksums += 1,
            _ => self.broken_frames += 1,
        }
    }

    /// What was counted after `earlier`.
    #[must_use]
    pub fn since(&self, earlier: &Counters) -> Counters {
        Counters {
            bytes: self.bytes.saturating_sub(earlier.bytes),
            frames: self.frames.saturating_sub(earlier.frames),
            not_understood: self.not_understood.saturating_sub(earlier.not_understood),
            bad_checksums: self.bad_checksums.saturating_sub(earlier.bad_checksums),
            broken_frames: self.broken_frames.saturating_sub(earlier.broken_frames),
            reports: self.reports.saturating_sub(earlier.reports),
            stray_replies: self.stray_replies.saturating_sub(earlier.stray_replies),
            lines: self.lines.saturating_sub(earlier.lines),
            noise: self.noise.saturating_sub(earlier.noise),
        }
    }
}
