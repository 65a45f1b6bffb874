//! The file through which host and board share their RAM.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::ErrorKind;

use geni::{FileRam, RAM_LEN};

use crate::OpenError;

/// Opens the window and takes it for this program alone: two hosts would overwrite each other's commands.
pub(super) fn open(path: &str) -> Result<FileRam, OpenError> {
    let other = |error| OpenError::Other { name: path.to_owned(), error };
    let path_owned = || path.to_owned();
    let file = OpenOptions::new().read(true).write(true).open(path).map_err(|error| match error.kind() {
        ErrorKind::NotFound => OpenError::NoSuchWindow { path: path_owned() },
        ErrorKind::IsADirectory => OpenError::NotAWindow { path: path_owned() },
        _ => other(error),
    })?;
    check(&file, path)?;
    match file.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => return Err(OpenError::WindowInUse { path: path_owned() }),
        Err(TryLockError::Error(error)) => return Err(other(error)),
    }
    FileRam::new(file, 0).map_err(other)
}

fn check(file: &File, path: &str) -> Result<(), OpenError> {
    let metadata = file.metadata().map_err(|error| OpenError::Other { name: path.to_owned(), error })?;
    if !metadata.is_file() {
        return Err(OpenError::NotAWindow { path: path.to_owned() });
    }
    match metadata.len() {
        len if usize::try_from(len) == Ok(RAM_LEN) => Ok(()),
        len => Err(OpenError::WindowSize { path: path.to_owned(), len }),
    }
}
