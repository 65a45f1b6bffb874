//! Copies an archive.

use std::path::Path;

use crate::archive::ArchiveArgs;
use crate::error::{Failure, Result, inform};

pub(super) fn run(archive: &ArchiveArgs, output: &Path) -> Result<()> {
    if output.exists() {
        return Err(Failure::new(format!("{} exists already", output.display()))
            .hint("name a new file: a backup takes the place of no other"));
    }
    archive.read()?.back_up(output)?;
    inform(format_args!("{} is written", output.display()));
    Ok(())
}
