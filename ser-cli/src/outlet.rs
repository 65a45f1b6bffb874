//! Where the data of a command goes: to standard output, or to files that appear when they are
//! whole.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::error::{Failure, Result, inform};
use crate::new_files::NewFiles;

/// How much is written at a time.
const BUFFER: usize = 1 << 18;

/// The file that the user names; `None` is standard output, which is also called `-`.
pub(crate) fn file_named(output: Option<&Path>) -> Option<&Path> {
    output.filter(|path| path.as_os_str() != "-")
}

/// Why something is not written.
#[derive(Debug)]
pub(crate) enum NotWritten {
    /// Its destination did not take it.
    Io(io::Error),
    /// There is nothing to write.
    Failed(Failure),
}

impl From<io::Error> for NotWritten {
    fn from(error: io::Error) -> NotWritten {
        NotWritten::Io(error)
    }
}

impl From<Failure> for NotWritten {
    fn from(failure: Failure) -> NotWritten {
        NotWritten::Failed(failure)
    }
}

/// The destination of one stream.
pub(crate) enum Outlet {
    Stdout,
    File(NewFiles, Part),
}

impl Outlet {
    /// The file of this name among these new ones, or standard output without a name. A name that
    /// cannot be used is refused before the work is done.
    pub(crate) fn open(path: Option<&Path>, mut files: NewFiles) -> Result<Outlet> {
        let Some(path) = path else { return Ok(Outlet::Stdout) };
        let part = Part::begin(&mut files, path)?;
        Ok(Outlet::File(files, part))
    }

    /// Writes everything, and tells what file it is in.
    pub(crate) fn write<T>(
        self,
        write: impl FnOnce(&mut (dyn Write + Send)) -> std::result::Result<T, NotWritten>,
    ) -> Result<T> {
        self.write_and(write, |_| Ok(()))
    }

    /// The same, and then does something with the file, which is whole and has no name yet. If that
    /// fails, no file appears. On standard output there is nothing to do it with.
    pub(crate) fn write_and<T>(
        self,
        write: impl FnOnce(&mut (dyn Write + Send)) -> std::result::Result<T, NotWritten>,
        then: impl FnOnce(&mut File) -> Result<()>,
    ) -> Result<T> {
        match self {
            Outlet::Stdout => {
                to(&mut BufWriter::with_capacity(BUFFER, io::stdout()), &"standard output", write)
            }
            Outlet::File(files, mut part) => {
                let path = part.path.clone();
                let written = to(&mut part.out, &path.display(), write)?;
                then(part.out.get_mut())?;
                finish(files, &path)?;
                Ok(written)
            }
        }
    }
}

/// A file that is one of several.
pub(crate) struct Part {
    out: BufWriter<File>,
    path: PathBuf,
}

impl Part {
    /// Begins the file of this name.
    pub(crate) fn begin(files: &mut NewFiles, path: &Path) -> Result<Part> {
        let out = BufWriter::with_capacity(BUFFER, files.create(path)?);
        Ok(Part { out, path: path.to_owned() })
    }

    /// Writes it to its end.
    pub(crate) fn write<T>(
        mut self,
        write: impl FnOnce(&mut (dyn Write + Send)) -> std::result::Result<T, NotWritten>,
    ) -> Result<T> {
        to(&mut self.out, &self.path.display(), write)
    }
}

/// Gives the files their names, and tells that of one of them.
pub(crate) fn finish(files: NewFiles, path: &Path) -> Result<()> {
    files.finish()?;
    inform(format_args!("{} is written", path.display()));
    Ok(())
}

fn to<T, W: Write + Send>(
    out: &mut W,
    name: &dyn std::fmt::Display,
    write: impl FnOnce(&mut (dyn Write + Send)) -> std::result::Result<T, NotWritten>,
) -> Result<T> {
    let written = write(out).and_then(|written| {
        out.flush()?;
        Ok(written)
    });
    written.map_err(|not_written| match not_written {
        NotWritten::Io(error) => Failure::writing(name, &error),
        NotWritten::Failed(failure) => failure,
    })
}
