//! Which format a file is in, by its content.

use super::{comtrade, cytime, prc002, sel};

/// A format that can be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Our own CSV.
    Csv,
    /// Our own JSON lines.
    Jsonl,
    /// The printed `SER` report of an SEL relay.
    SelSer,
    /// The compressed `CSER` list of an SEL relay.
    SelCser,
    /// The event log of a `CyTime` recorder as JSON.
    Cytime,
    /// COMTRADE: `.cfg` with `.dat`, or `.cff`.
    Comtrade,
    /// CSV as asked for with PRC-002.
    Prc002,
}

impl Format {
    /// The format of a file that begins like this; `None` if it is in none.
    #[must_use]
    pub fn of(head: &[u8]) -> Option<Format> {
        let text = String::from_utf8_lossy(head);
        let first = text.trim_start();
        if cytime::is_it(&text) {
            return Some(Format::Cytime);
        }
        if first.starts_with('{') {
            return Some(Format::Jsonl);
        }
        if crate::csv::is_header(first.lines().next().unwrap_or_default().as_bytes()) {
            return Some(Format::Csv);
        }
        if comtrade::is_cff(&text) || comtrade::is_cfg(&text) {
            return Some(Format::Comtrade);
        }
        if prc002::is_it(&text) {
            return Some(Format::Prc002);
        }
        if sel::compressed::is_it(head) {
            return Some(Format::SelCser);
        }
        sel::report::is_it(&text).then_some(Format::SelSer)
    }
}

impl std::fmt::Display for Format {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Format::Csv => "CSV of ser-cli",
            Format::Jsonl => "JSON lines of ser-cli",
            Format::SelSer => "an SEL report (SER)",
            Format::SelCser => "an SEL compressed list (CSER)",
            Format::Cytime => "a CyTime event log",
            Format::Comtrade => "COMTRADE",
            Format::Prc002 => "CSV for PRC-002",
        })
    }
}
