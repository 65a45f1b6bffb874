//! What the user chooses of a record.

/// How the rows are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Data {
    /// As text.
    #[default]
    Ascii,
    /// As binary numbers.
    Binary,
}

/// How a record is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// How the rows are written.
    pub data: Data,
    /// Whether there is a row for every millisecond.
    pub has_rate: bool,
    /// The line frequency that the record names, in hertz. Nothing is reckoned with it.
    pub line_hz: u8,
}
