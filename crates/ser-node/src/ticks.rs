//! Milliseconds since power-up, widened so that they never wrap.
//!
//! The interrupt counts in 32 bits, which wrap after 49.7 days; the main loop works in 64.

/// Extends wrapping 32-bit ticks to 64 bits.
///
/// Correct as long as every tick given is less than 24.8 days away from the latest one.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ticks {
    latest_ms: u64,
}

impl Ticks {
    /// Starts at tick 0, power-up.
    #[must_use]
    pub const fn new() -> Ticks {
        Ticks { latest_ms: 0 }
    }

    /// The 64-bit tick that `tick_ms` stands for; it may lie a little before the latest one.
    pub fn extend(&mut self, tick_ms: u32) -> u64 {
        #[expect(clippy::cast_possible_truncation, reason = "the distance is taken modulo 2^32")]
        let ahead = tick_ms.wrapping_sub(self.latest_ms as u32);
        if ahead <= u32::MAX / 2 {
            self.latest_ms += u64::from(ahead);
            self.latest_ms
        } else {
            self.latest_ms.saturating_sub(u64::from(ahead.wrapping_neg()))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_go_on_where_32_bits_wrap() {
        let mut ticks = Ticks::new();
        assert_eq!(ticks.extend(0x7FFF_FFFF), 0x7FFF_FFFF);
        assert_eq!(ticks.extend(0xFFFF_FFFE), 0xFFFF_FFFE);
        assert_eq!(ticks.extend(0x0000_0001), 0x1_0000_0001);
        // A byte that arrived just before the wrap is looked at just after it.
        assert_eq!(ticks.extend(0xFFFF_FFFF), 0xFFFF_FFFF);
        assert_eq!(ticks.extend(0x0000_0002), 0x1_0000_0002);
    }

    #[test]
    fn nothing_lies_before_power_up() {
        assert_eq!(Ticks::new().extend(u32::MAX), 0);
    }
}
