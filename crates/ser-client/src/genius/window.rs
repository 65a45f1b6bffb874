//! The window through which host and board share their RAM: a file, or memory behind a device.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{FileExt, FileTypeExt, OpenOptionsExt};

use geni_board::{FileRam, MappedRam, RAM_LEN, SharedRam};
use rustix::fs::OFlags;

use super::put_back::PutBack;
use crate::transport::endpoint::GeniWindow;
use crate::transport::open_error::OpenError;

/// The window, with the bytes to restore until a board answers there.
pub(super) type Window = PutBack<AnyRam>;

/// Shared RAM, by either kind of access.
pub(super) enum AnyRam {
    /// A file shared with another program. If the file gets shorter, that is only an error.
    File(FileRam),
    /// The memory of a board.
    Memory(MappedRam),
}

impl Window {
    /// Opens the window for this program alone, because two hosts would overwrite each other's
    /// commands.
    pub(super) fn open(place: &GeniWindow) -> Result<Window, OpenError> {
        let path = || place.file.clone();
        let other = |error: io::Error| match error.kind() {
            ErrorKind::NotFound => OpenError::NoSuchWindow { path: path() },
            ErrorKind::PermissionDenied => OpenError::WindowDenied { path: path() },
            _ => OpenError::Other { name: path(), error },
        };
        // The type is checked before anything is opened, because some devices react to being
        // opened.
        let kind = fs::metadata(&place.file).map_err(other)?.file_type();
        let mut options = OpenOptions::new();
        options.read(true).write(true);
        if kind.is_char_device() {
            // Some systems require this flag for an uncached mapping of bus addresses.
            options.custom_flags(OFlags::SYNC.bits().cast_signed());
        } else if !kind.is_file() {
            return Err(OpenError::NotAWindow { path: path() });
        }
        let file = options.open(&place.file).map_err(other)?;
        // The name may stand for another file by now.
        if file.metadata().map_err(other)?.file_type() != kind {
            return Err(OpenError::NotAWindow { path: path() });
        }
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(OpenError::WindowInUse { path: path() }),
            Err(TryLockError::Error(error)) => return Err(other(error)),
        }
        let ram = if kind.is_file() { of_file(file, place) } else { of_memory(&file, place) };
        ram.map(PutBack::new)
    }

    /// The last error since the previous call.
    pub(super) fn take_error(&self) -> Option<ErrorKind> {
        match self.ram() {
            AnyRam::File(ram) => ram.take_error(),
            AnyRam::Memory(_) => None,
        }
    }
}

/// A file of another size may be anything. It must not be written to unless the user gives an
/// offset.
fn of_file(file: File, place: &GeniWindow) -> Result<AnyRam, OpenError> {
    let other = |error| OpenError::Other { name: place.file.clone(), error };
    let len = file.metadata().map_err(other)?.len();
    let offset = match place.offset {
        None if len == RAM_LEN as u64 => 0,
        Some(offset) if offset.checked_add(RAM_LEN as u64).is_some_and(|end| end <= len) => offset,
        _ => return Err(OpenError::WindowSize { path: place.file.clone(), len }),
    };
    // Some systems show the memory of a board as a file that can be mapped but not read.
    if file.read_exact_at(&mut [0], offset).is_err() {
        return of_memory(&file, place);
    }
    FileRam::new(file, offset).map(AnyRam::File).map_err(other)
}

fn of_memory(file: &File, place: &GeniWindow) -> Result<AnyRam, OpenError> {
    let ram = MappedRam::new(file, place.offset.unwrap_or(0));
    ram.map(AnyRam::Memory).map_err(|error| OpenError::NoMemory { path: place.file.clone(), error })
}

impl SharedRam for AnyRam {
    fn read(&self, offset: u16) -> u8 {
        match self {
            AnyRam::File(ram) => ram.read(offset),
            AnyRam::Memory(ram) => ram.read(offset),
        }
    }

    fn write(&mut self, offset: u16, byte: u8) {
        match self {
            AnyRam::File(ram) => ram.write(offset, byte),
            AnyRam::Memory(ram) => ram.write(offset, byte),
        }
    }

    fn read_bytes(&self, offset: u16, bytes: &mut [u8]) {
        match self {
            AnyRam::File(ram) => ram.read_bytes(offset, bytes),
            AnyRam::Memory(ram) => ram.read_bytes(offset, bytes),
        }
    }

    fn write_bytes(&mut self, offset: u16, bytes: &[u8]) {
        match self {
            AnyRam::File(ram) => ram.write_bytes(offset, bytes),
            AnyRam::Memory(ram) => ram.write_bytes(offset, bytes),
        }
    }
}
