//! How long bytes take on the line.

use std::time::Duration;

/// Bits per byte on the line: start bit, eight data bits, stop bit.
const BITS_PER_BYTE: u64 = 10;

/// The speed of the line to the recorder.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LineRate {
    /// The time is negligible or unknown (TCP).
    #[default]
    Instant,
    /// A serial line.
    BitsPerSecond(u32),
}

impl LineRate {
    /// How long `bytes` bytes take.
    #[must_use]
    pub fn time_for(self, bytes: usize) -> Duration {
        match self {
            LineRate::Instant | LineRate::BitsPerSecond(0) => Duration::ZERO,
            LineRate::BitsPerSecond(rate) => {
                let bits = u64::try_from(bytes).unwrap_or(u64::MAX).saturating_mul(BITS_PER_BYTE);
                Duration::from_nanos(bits.saturating_mul(1_000_000_000) / u64::from(rate))
            }
        }
    }
}

impl From<Option<u32>> for LineRate {
    fn from(bits_per_second: Option<u32>) -> LineRate {
        bits_per_second.map_or(LineRate::Instant, LineRate::BitsPerSecond)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ten_bits_to_a_byte() {
        assert_eq!(LineRate::BitsPerSecond(9600).time_for(96), Duration::from_millis(100));
        assert_eq!(
            LineRate::BitsPerSecond(300).time_for(341),
            Duration::from_nanos(11_366_666_666)
        );
        assert_eq!(LineRate::Instant.time_for(usize::MAX), Duration::ZERO);
        assert_eq!(LineRate::BitsPerSecond(0).time_for(1), Duration::ZERO);
    }
}
