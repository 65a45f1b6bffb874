//! `site show`: what a site file says, as tables or as JSON.

mod json;
mod tables;

use std::io::{self, Write};
use std::path::Path;

use clap::ValueEnum;

use crate::error::Result;
use crate::output::{Palette, json_to};
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
        Format::Json => json_to(&mut out, &json::site(&site))?,
    }
    Ok(out.flush()?)
}
