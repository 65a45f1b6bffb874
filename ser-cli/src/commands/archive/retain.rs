//! Lets go of what is old.

use std::time::Duration;

use ser_archive::Keep;
use ser_evidence::time::Moment;
use ser_observer::host_reading;

use super::SCHEMA;
use crate::archive::{ArchiveArgs, parse_keep, parse_size};
use crate::error::{Failure, Result, inform};
use crate::output::{PROGRAM, json_to};

/// How much is kept.
#[derive(Debug, clap::Args)]
#[group(id = "kept", required = true, multiple = true, args = ["keep", "max_size"])]
pub(super) struct RetainArgs {
    #[command(flatten)]
    archive: ArchiveArgs,

    /// Keep what was added in this time: 90d, 26w, 5y.
    #[arg(long, value_name = "TIME", value_parser = parse_keep)]
    keep: Option<Duration>,

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

pub(super) fn run(args: &RetainArgs) -> Result<()> {
    let now = host_reading::now().utc;
    let since = args.keep.map(|time| {
        let us = i64::try_from(time.as_micros()).unwrap_or(i64::MAX);
        Moment::from_us(now.us().saturating_sub(us))
    });
    if !args.yes {
        args.archive.read()?;
        return Err(Failure::usage("entries that are let go do not come back")
            .hint("ser-cli archive backup makes a copy first")
            .hint("add --yes to let them go"));
    }
    let keep = Keep { since, bytes: args.max_size };
    let expired = args.archive.write()?.expire(keep, now)?;
    match args.format {
        super::Format::Text => inform(match (expired.entries, expired.is_held_back) {
            (0, false) => "nothing is that old".to_owned(),
            (0, true) => "nothing is let go that another archive is still to be given".to_owned(),
            (entries, _) => format!("let go: {entries} entries, which the archive tells as gaps"),
        }),
        super::Format::Json => json_to(
            &mut std::io::stdout().lock(),
            &serde_json::json!({
                "schema": SCHEMA,
                "program": PROGRAM,
                "entries": expired.entries,
                "gaps": expired.gaps,
                "held_back": expired.is_held_back,
            }),
        )?,
    }
    Ok(())
}
