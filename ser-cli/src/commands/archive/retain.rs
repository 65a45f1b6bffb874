//! Lets go of what is old.

use ser_archive::Keep;
use ser_evidence::time::Moment;

use super::SCHEMA;
use crate::archive::ArchiveArgs;
use crate::error::{Failure, Result, inform};
use crate::host_reading;
use crate::output::{PROGRAM, json_to};

/// A day, in microseconds.
const DAY_US: i64 = 86_400_000_000;

/// How much is kept.
#[derive(Debug, clap::Args)]
#[group(id = "kept", required = true, multiple = true, args = ["keep", "max_size"])]
pub(super) struct RetainArgs {
    #[command(flatten)]
    archive: ArchiveArgs,

    /// Keep what was added in this time: 90d, 26w, 5y.
    #[arg(long, value_name = "TIME", value_parser = parse_keep)]
    keep: Option<i64>,

    /// Keep as much as fits: 500MB, 10GB.
    #[arg(long, value_name = "SIZE", value_parser = parse_size)]
    max_size: Option<u64>,

    /// Do it.
    #[arg(long)]
    yes: bool,

    /// How the result is shown.
    #[arg(long, value_enum, default_value_t)]
    format: super::Format,
}

/// Days, weeks, or years of 366 days, in microseconds.
fn parse_keep(text: &str) -> std::result::Result<i64, String> {
    let wrong = "not a number of days, weeks or years like 90d, 26w or 5y";
    let units = [('d', 1), ('w', 7), ('y', 366)];
    let unit = units.iter().find_map(|(unit, days)| Some((text.strip_suffix(*unit)?, *days)));
    let (number, days) = unit.ok_or(wrong)?;
    let number: i64 = number.parse().map_err(|_| wrong)?;
    let us = number.checked_mul(days).and_then(|days| days.checked_mul(DAY_US));
    us.filter(|us| *us > 0).ok_or_else(|| wrong.to_owned())
}

/// Bytes; a megabyte has a million.
fn parse_size(text: &str) -> std::result::Result<u64, String> {
    let wrong = "not a size like 500MB or 10GB";
    let units = [("MB", 1_000_000), ("GB", 1_000_000_000), ("TB", 1_000_000_000_000)];
    let unit = units.iter().find_map(|(unit, bytes)| Some((text.strip_suffix(unit)?, *bytes)));
    let (number, bytes) = unit.ok_or(wrong)?;
    let number: u64 = number.parse().map_err(|_| wrong)?;
    number.checked_mul(bytes).filter(|bytes| *bytes > 0).ok_or_else(|| wrong.to_owned())
}

pub(super) fn run(args: &RetainArgs) -> Result<()> {
    let now = host_reading::now().utc;
    let since = args.keep.map(|us| Moment::from_us(now.us().saturating_sub(us)));
    if !args.yes {
        args.archive.read()?;
        return Err(Failure::usage("entries that are let go do not come back")
            .hint("ser-cli archive backup makes a copy first")
            .hint("add --yes to let them go"));
    }
    let keep = Keep { since, bytes: args.max_size };
    let expired = args.archive.write()?.expire(keep, now)?;
    match args.format {
        super::Format::Text => inform(match expired.entries {
            0 => "nothing is that old".to_owned(),
            entries => format!("let go: {entries} entries, which the archive tells as gaps"),
        }),
        super::Format::Json => json_to(
            &mut std::io::stdout().lock(),
            &serde_json::json!({
                "schema": SCHEMA,
                "program": PROGRAM,
                "entries": expired.entries,
                "gaps": expired.gaps,
            }),
        )?,
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_and_sizes_are_read_with_their_units() {
        assert_eq!(parse_keep("5y"), Ok(5 * 366 * DAY_US));
        assert_eq!(parse_keep("26w"), Ok(26 * 7 * DAY_US));
        assert_eq!(parse_size("10GB"), Ok(10_000_000_000));
        for wrong in ["", "5", "y", "-5y", "0d", "5m", "99999999999999y"] {
            assert!(parse_keep(wrong).is_err(), "{wrong}");
        }
        for wrong in ["", "10", "GB", "-1GB", "0MB", "1.5GB", "99999999999TB"] {
            assert!(parse_size(wrong).is_err(), "{wrong}");
        }
    }
}
