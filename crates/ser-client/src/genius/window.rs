//! The window through which host and board share their RAM: a file, or memory behind a device.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};

use geni_board::{MappedRam, RAM_LEN, SharedRam};
use rustix::fs::OFlags;

use super::window_file::WindowFile;
use crate::{GeniWindow, OpenError};

/// Shared RAM, however it is reached.
pub(super) enum Window {
    /// A program on the other side, through a file. Should the file get shorter, that is an error and nothing worse.
    File(WindowFile),
    /// A board.
    Memory(MappedRam),
}

impl Window {
    /// Opens the window and takes it for this program alone: two hosts would overwrite each other's commands.
    pub(super) fn open(place: &GeniWindow) -> Result<Window, OpenError> {
        let path = || place.file.clone();
        let other = |error: io::Error| match error.kind() {
            ErrorKind::NotFound => OpenError::NoSuchWindow { path: path() },
            ErrorKind::PermissionDenied => OpenError::WindowDenied { path: path() },
            _ => OpenError::Other { name: path(), error },
        };
        // Before anything is opened: there are devices that take notice of that.
        let metadata = fs::metadata(&place.file).map_err(other)?;
        let kind = metadata.file_type();
        let mut options = OpenOptions::new();
        options.read(true).write(true);
        if kind.is_char_device() {
            // Some systems ask for that before they map bus addresses without a cache.
            options.custom_flags(OFlags::SYNC.bits().cast_signed());
        } else if !kind.is_file() {
            return Err(OpenError::NotAWindow { path: path() });
        }
        let file = options.open(&place.file).map_err(other)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(OpenError::WindowInUse { path: path() }),
            Err(TryLockError::Error(error)) => return Err(other(error)),
        }
        if kind.is_file() { Window::of_file(file, place) } else { Window::of_memory(&file, place) }
    }

    /// A file that has another size may be anything, and must not be written to unless the user says where.
    fn of_file(file: File, place: &GeniWindow) -> Result<Window, OpenError> {
        let other = |error| OpenError::Other { name: place.file.clone(), error };
        let len = file.metadata().map_err(other)?.len();
        match place.offset {
            None if len == RAM_LEN as u64 => WindowFile::new(file).map(Window::File).map_err(other),
            Some(offset) if offset.checked_add(RAM_LEN as u64).is_some_and(|end| end <= len) => {
                Window::of_memory(&file, place)
            }
            _ => Err(OpenError::WindowSize { path: place.file.clone(), len }),
        }
    }

    fn of_memory(file: &File, place: &GeniWindow) -> Result<Window, OpenError> {
        let ram = MappedRam::new(file, place.offset.unwrap_or(0));
        ram.map(Window::Memory).map_err(|error| OpenError::NoMemory { path: place.file.clone(), error })
    }

    /// The last error since this was asked.
    pub(super) fn take_error(&self) -> Option<ErrorKind> {
        match self {
            Window::File(ram) => ram.take_error(),
            Window::Memory(_) => None,
        }
    }
}

impl SharedRam for Window {
    fn read(&self, offset: u16) -> u8 {
        match self {
            Window::File(ram) => ram.read(offset),
            Window::Memory(ram) => ram.read(offset),
        }
    }

    fn write(&mut self, offset: u16, byte: u8) {
        match self {
            Window::File(ram) => ram.write(offset, byte),
            Window::Memory(ram) => ram.write(offset, byte),
        }
    }

    fn read_bytes(&self, offset: u16, bytes: &mut [u8]) {
        match self {
            Window::File(ram) => ram.read_bytes(offset, bytes),
            Window::Memory(ram) => ram.read_bytes(offset, bytes),
        }
    }

    fn write_bytes(&mut self, offset: u16, bytes: &[u8]) {
        match self {
            Window::File(ram) => ram.write_bytes(offset, bytes),
            Window::Memory(ram) => ram.write_bytes(offset, bytes),
        }
    }
}
