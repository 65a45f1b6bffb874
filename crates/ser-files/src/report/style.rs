//! How parts of a text stand out.

use anstyle::Style;

/// The styles of a report's text; by default none.
#[derive(Clone, Copy, Debug, Default)]
pub struct Styles {
    /// Headings and the titles of columns.
    pub title: Style,
    /// Details that are seldom needed.
    pub faint: Style,
    /// A state that is not the normal one.
    pub abnormal: Style,
    /// What is wrong, missing or in doubt.
    pub alarm: Style,
    /// What moved first.
    pub first_out: Style,
}
