//! From time to place: the one scale of a picture.

/// Which time is shown, and on how many pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Scale {
    from_us: i64,
    to_us: i64,
    left_px: f64,
    width_px: f64,
}

impl Scale {
    /// Shows this window on pixels from `left_px` on. A window without length is one of a
    /// millisecond.
    pub(super) fn new((from_us, to_us): (i64, i64), left_px: f64, width_px: f64) -> Scale {
        Scale { from_us, to_us: to_us.max(from_us.saturating_add(1_000)), left_px, width_px }
    }

    /// The pixel of a time. What is outside of the window is at its edge.
    pub(super) fn x_px(&self, at_us: i64) -> f64 {
        let at_us = at_us.clamp(self.from_us, self.to_us);
        let part = lossy(at_us.saturating_sub(self.from_us)) / lossy(self.to_us - self.from_us);
        self.left_px + part * self.width_px
    }

    /// The place and the width of a stretch of time; `None` if nothing of it is in the window.
    pub(super) fn stretch(&self, from_us: i64, to_us: i64) -> Option<(f64, f64)> {
        let (from, to) = (from_us.max(self.from_us), to_us.min(self.to_us));
        (from <= to).then(|| (self.x_px(from), self.x_px(to) - self.x_px(from)))
    }

    pub(super) fn contains(&self, at_us: i64) -> bool {
        (self.from_us..=self.to_us).contains(&at_us)
    }
}

/// A pixel needs no more than the 53 bits of a float.
#[expect(clippy::cast_precision_loss, reason = "places are rounded to tenths of a pixel anyway")]
const fn lossy(us: i64) -> f64 {
    us as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_window_fills_the_pixels_and_what_is_outside_stays_at_the_edge() {
        let scale = Scale::new((1_000, 3_000), 100.0, 800.0);
        let places = [0, 1_000, 1_500, 3_000, 9_000].map(|at| scale.x_px(at));
        assert_eq!(places, [100.0, 100.0, 300.0, 900.0, 900.0]);
        assert_eq!(scale.stretch(0, 2_000), Some((100.0, 400.0)));
        assert_eq!(scale.stretch(3_001, 4_000), None);
    }

    #[test]
    fn a_window_without_length_divides_by_nothing() {
        let scale = Scale::new((5, 5), 0.0, 100.0);
        assert_eq!(scale.x_px(5), 0.0);
    }
}
