//! `site show`: what a site file says, as tables or as JSON.

mod json;
mod tables;

use std::io::{self, Write};
use std::path::Path;

use clap::ValueEnum;

use crate::error::{Failure, Result};
use crate::output::Palette;
use crate::site_file;

/// How a site is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    /// Tables.
    #[default]
    Table,
    /// One JSON object, with every value that is in force.
    Json,
}

pub(super) fn run(file: &Path, format: Format) -> Result<()> {
    let site = site_file::load(file)?;
    let mut out = io::stdout().lock();
    match format {
        Format::Table => tables::write(&mut out, &site, Palette::of_stdout())?,
        Format::Json => {
            let json = serde_json::to_string_pretty(&json::site(&site));
            let json = json.map_err(|error| Failure::new(error).hint("report this as a bug"))?;
            writeln!(out, "{json}")?;
        }
    }
    Ok(out.flush()?)
}
