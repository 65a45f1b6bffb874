//! What a collector tells while it runs: lines on standard error.

use std::io::IsTerminal;

use tracing::level_filters::LevelFilter;

/// Tells from now on. Under systemd the journal knows the time.
pub(super) fn begin() {
    let is_coloured = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none();
    let lines = tracing_subscriber::fmt()
        .with_writer(std::io::stderr)
        .with_ansi(is_coloured)
        .with_target(false)
        .with_max_level(LevelFilter::INFO);
    // Another subscriber is only there if somebody called this twice.
    let _ = match std::env::var_os("JOURNAL_STREAM") {
        Some(_) => lines.without_time().try_init(),
        None => lines.try_init(),
    };
}
