//! Lines appended to a file that other runs may append to as well.

use std::fs::{File, TryLockError};
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;
use std::thread;
use std::time::Duration;

use crate::state::open_ours;

/// How long another run may take to write its lines.
const LOCK_PATIENCE: Duration = Duration::from_secs(2);

/// How often the lock is tried.
const LOCK_EVERY: Duration = Duration::from_millis(20);

/// Keeps other runs away until the returned file is dropped. The lock is a file of its own, which
/// stays when the other one is replaced.
///
/// # Errors
/// If another run holds the lock for two seconds, or the file cannot be made.
pub(crate) fn lock(path: &Path) -> io::Result<File> {
    let file = open_ours(path, File::options().write(true).create(true).truncate(false))?;
    let mut waited = Duration::ZERO;
    loop {
        match file.try_lock() {
            Ok(()) => return Ok(file),
            Err(TryLockError::WouldBlock) if waited < LOCK_PATIENCE => {}
            Err(error) => return Err(error.into()),
        }
        thread::sleep(LOCK_EVERY);
        waited += LOCK_EVERY;
    }
}

/// Whether the file is empty, and what has to be written before the next line: a power cut may have
/// ended the file in the middle of one.
///
/// # Errors
/// If the file cannot be read.
pub(crate) fn before_the_next_line(file: &mut File) -> io::Result<(bool, Vec<u8>)> {
    if file.metadata()?.len() == 0 {
        return Ok((true, Vec::new()));
    }
    let mut last = [0];
    file.seek(SeekFrom::End(-1))?;
    file.read_exact(&mut last)?;
    Ok((false, if last == *b"\n" { Vec::new() } else { vec![b'\n'] }))
}
