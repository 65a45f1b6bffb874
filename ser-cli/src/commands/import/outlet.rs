//! Where an import goes: to standard output, or to a file that appears as a whole.

use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use ser_files::import::Imported;

use crate::closed_stdout;
use crate::error::{Failure, Result, inform};
use crate::output::PROGRAM;

/// Where records go.
pub(super) enum Outlet {
    Stdout,
    File { path: PathBuf, force: bool },
}

impl Outlet {
    /// The file of this name; standard output without one, and for `-`. A file that is there is refused
    /// before anything is read, unless it may be overwritten.
    pub(super) fn of(path: Option<&Path>, force: bool) -> Result<Outlet> {
        match path.filter(|path| path.as_os_str() != "-") {
            None => {
                closed_stdout::check()?;
                Ok(Outlet::Stdout)
            }
            Some(path) if !force && path.symlink_metadata().is_ok() => Err(exists(path)),
            Some(path) => Ok(Outlet::File { path: path.to_owned(), force }),
        }
    }

    /// Writes all records.
    pub(super) fn write(&self, imported: &Imported) -> Result<()> {
        match self {
            Outlet::Stdout => {
                let mut out = BufWriter::new(io::stdout().lock());
                imported.write(&mut out, PROGRAM)?;
                Ok(out.flush()?)
            }
            Outlet::File { path, force } => to_file(path, *force, imported),
        }
    }
}

/// Writes under a name that nobody can foresee, and gives the whole file its own.
fn to_file(path: &Path, force: bool, imported: &Imported) -> Result<()> {
    let failed = |error: &io::Error| Failure::writing(path.display(), error);
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    let builder = {
        use std::os::unix::fs::PermissionsExt;
        // As other programs make files: whoever the user lets read them may do so.
        builder.permissions(std::fs::Permissions::from_mode(0o666))
    };
    let mut file =
        builder.tempfile_in(folder.unwrap_or(Path::new("."))).map_err(|error| failed(&error))?;
    imported
        .write(BufWriter::new(&mut file), PROGRAM)
        .and_then(|()| file.as_file().sync_all())
        .map_err(|error| failed(&error))?;
    let named = match force {
        true => file.persist(path),
        false => file.persist_noclobber(path),
    };
    named.map_err(|error| match error.error.kind() {
        io::ErrorKind::AlreadyExists => exists(path),
        _ => failed(&error.error),
    })?;
    inform(format_args!("{} is written", path.display()));
    Ok(())
}

fn exists(path: &Path) -> Failure {
    Failure::new(format!("{} exists, and is not overwritten", path.display()))
        .hint("give another name with -o, or say --force")
}
