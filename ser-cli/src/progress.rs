//! The progress bar of long downloads, on standard error.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use ser_client::Delivery;

/// A download of fewer events is over before anybody could read a bar.
const WORTH_A_BAR: u64 = 40;

/// A bar; nothing if standard error is not a terminal or the download is short.
pub(crate) struct Progress {
    bar: Option<ProgressBar>,
    wanted: bool,
    delivered: u64,
}

impl Progress {
    /// For a download of unknown length.
    pub(crate) fn new() -> Progress {
        Progress { bar: None, wanted: true, delivered: 0 }
    }

    /// For something without an end.
    pub(crate) fn none() -> Progress {
        Progress { bar: None, wanted: false, delivered: 0 }
    }

    /// Notes that these events have arrived and `pending` more are to come.
    pub(crate) fn advance(&mut self, deliveries: &[Delivery], pending: u32) {
        let events =
            deliveries.iter().filter(|delivery| matches!(delivery, Delivery::Event { .. })).count();
        self.delivered += u64::try_from(events).unwrap_or_default();
        let length = self.delivered + u64::from(pending);
        if self.wanted && self.bar.is_none() && length >= WORTH_A_BAR {
            self.bar = Some(bar());
        }
        if let Some(bar) = &self.bar {
            bar.set_length(length);
            bar.set_position(self.delivered);
        }
    }

    /// Writes to the terminal without tearing the bar.
    pub(crate) fn around<T>(&self, write: impl FnOnce() -> T) -> T {
        match &self.bar {
            Some(bar) => bar.suspend(write),
            None => write(),
        }
    }

    /// Removes the bar.
    pub(crate) fn finish(&mut self) {
        if let Some(bar) = self.bar.take() {
            bar.finish_and_clear();
        }
        self.wanted = false;
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.finish();
    }
}

fn bar() -> ProgressBar {
    let bar = ProgressBar::no_length();
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos}/{len} events, {eta} left") {
        bar.set_style(style);
    }
    // Keeps the bar moving while the recorder hesitates.
    bar.enable_steady_tick(Duration::from_millis(500));
    bar
}
