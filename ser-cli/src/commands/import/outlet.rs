//! Where an import goes: to standard output, or to a file that appears as a whole.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use ser_files::import::Imported;

use crate::closed_stdout;
use crate::error::{Failure, Result, inform};
use crate::new_files::NewFiles;
use crate::output::PROGRAM;

/// Where records go.
pub(super) enum Outlet {
    Stdout,
    File { files: NewFiles, file: File, path: PathBuf },
}

impl Outlet {
    /// The file of this name; standard output without one, and for `-`. A file that is there is
    /// refused before anything is read, unless it may be overwritten; `inputs` never are.
    pub(super) fn of(
        path: Option<&Path>,
        overwrites: bool,
        inputs: Vec<PathBuf>,
    ) -> Result<Outlet> {
        let Some(path) = path.filter(|path| path.as_os_str() != "-") else {
            closed_stdout::check()?;
            return Ok(Outlet::Stdout);
        };
        let mut files = NewFiles::new(overwrites).sparing(inputs);
        let file = files.create(path)?;
        Ok(Outlet::File { files, file, path: path.to_owned() })
    }

    /// Writes all records.
    pub(super) fn write(self, imported: &Imported) -> Result<()> {
        match self {
            Outlet::Stdout => {
                let mut out = BufWriter::new(io::stdout().lock());
                imported.write(&mut out, PROGRAM)?;
                Ok(out.flush()?)
            }
            Outlet::File { files, file, path } => {
                let failed = |error: io::Error| Failure::writing(path.display(), &error);
                let mut out = BufWriter::new(file);
                imported.write(&mut out, PROGRAM).and_then(|()| out.flush()).map_err(failed)?;
                files.finish()?;
                inform(format_args!("{} is written", path.display()));
                Ok(())
            }
        }
    }
}
