//! Where things are in a chart, in pixels: names on the left, time on the right of them, lanes
//! below the axis.

/// Where the time begins, beside the names.
pub(super) const LEFT_PX: f64 = 250.0;
/// How wide the time is.
pub(super) const WIDTH_PX: f64 = 830.0;
/// The whole chart.
pub(super) const FULL_PX: f64 = 1100.0;
/// The axis, above the lanes.
pub(super) const TOP_PX: f64 = 34.0;
/// A lane.
pub(super) const LANE_PX: f64 = 32.0;
/// Below the lanes: when the chart begins and ends.
pub(super) const BOTTOM_PX: f64 = 24.0;
/// Names end here.
pub(super) const NAMES_PX: f64 = LEFT_PX - 12.0;

/// Where a lane begins.
pub(super) fn y_px(row: usize) -> f64 {
    let rows = f64::from(u32::try_from(row).unwrap_or(u32::MAX));
    TOP_PX + rows * LANE_PX
}

/// A place in the chart, to a tenth of a pixel.
pub(super) fn px(place: f64) -> String {
    format!("{place:.1}")
}

/// A name in so many characters.
pub(super) fn shortened(name: &str, most: usize) -> String {
    match name.chars().count() > most {
        true => name.chars().take(most.saturating_sub(1)).chain(['…']).collect(),
        false => name.to_owned(),
    }
}
