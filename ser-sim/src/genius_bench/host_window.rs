//! The file between the host's board and the host, which is another process.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use crate::claim::Claim;
use crate::error::SimError;
use crate::genius::{Board, RAM_LEN};

/// Bytes that a host writes last come first: they are read one by one before the rest.
const READ_FIRST: usize = 3;

/// The shared RAM as a file.
pub(super) struct HostWindow {
    path: PathBuf,
    file: File,
    image: Box<[u8; RAM_LEN]>,
    /// Whether the file is ours to remove.
    made: bool,
    /// Keeps other simulators from taking the window.
    _claim: Claim,
}

impl HostWindow {
    /// Makes the file, or takes one that is empty or that a simulator has left behind, and fills it with zeros.
    pub(super) fn create(path: &Path) -> Result<HostWindow, SimError> {
        let doing = || format!("make the GENI window {}", path.display());
        let claim = Claim::on(path, SimError::WindowInUse)?;
        let made = !path.exists() || claim.was_left_behind();
        let file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path);
        let file = file.map_err(SimError::io(doing()))?;
        let metadata = file.metadata().map_err(SimError::io(doing()))?;
        let ours = claim.was_left_behind() && metadata.len() == RAM_LEN as u64;
        if !metadata.is_file() || !(ours || metadata.len() == 0) {
            return Err(SimError::WindowTaken(path.to_owned()));
        }
        let emptied = file.set_len(RAM_LEN as u64).and_then(|()| file.write_all_at(&[0; RAM_LEN], 0));
        emptied.map_err(SimError::io(doing()))?;
        Ok(HostWindow { path: path.to_owned(), file, image: Box::new([0; RAM_LEN]), made, _claim: claim })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Gives the board what the host has written.
    pub(super) fn read_into(&mut self, board: &mut Board) -> io::Result<()> {
        let HostWindow { file, image, .. } = self;
        let (mut read, mut result) = (0, Ok(()));
        board.sync_with(|offset| {
            let at = usize::from(offset);
            if read < READ_FIRST {
                read_part(file, &mut image[at..=at], u64::from(offset), &mut result);
            } else if read == READ_FIRST {
                read_rest(file, image, &mut result);
            }
            read += 1;
            image[at]
        });
        result
    }

    /// Gives the host what the board has written.
    pub(super) fn write_from(&mut self, board: &mut Board) -> io::Result<()> {
        let HostWindow { file, image, .. } = self;
        let mut result = Ok(());
        board.publish(|offset, byte| {
            image[usize::from(offset)] = byte;
            if result.is_ok() {
                result = file.write_all_at(&[byte], u64::from(offset));
            }
        });
        result
    }
}

/// After an error the image stays what it was, so that the board is told nothing.
fn read_part(file: &File, part: &mut [u8], offset: u64, result: &mut io::Result<()>) {
    if result.is_ok() {
        *result = file.read_exact_at(part, offset);
    }
}

fn read_rest(file: &File, image: &mut [u8; RAM_LEN], result: &mut io::Result<()>) {
    let mut fresh = [0; RAM_LEN];
    read_part(file, &mut fresh, 0, result);
    if result.is_ok() {
        *image = fresh;
    }
}

impl Drop for HostWindow {
    fn drop(&mut self) {
        if self.made {
            // It may be gone already.
            let _ = fs::remove_file(&self.path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_goes_with_its_simulator() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("host");
        let window = HostWindow::create(&path).unwrap();
        assert_eq!(fs::read(&path).unwrap(), [0; RAM_LEN]);
        assert!(matches!(HostWindow::create(&path), Err(SimError::WindowInUse(_))));
        drop(window);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn somebody_elses_file_is_left_alone_whatever_its_size() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("photo");
        for len in [1, RAM_LEN] {
            fs::write(&path, vec![0xA5; len]).unwrap();
            assert!(matches!(HostWindow::create(&path), Err(SimError::WindowTaken(_))));
            assert_eq!(fs::read(&path).unwrap(), vec![0xA5; len]);
        }
    }

    #[test]
    fn the_window_of_a_simulator_that_was_killed_is_taken_over() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("host");
        fs::write(&path, [0xA5; RAM_LEN]).unwrap();
        fs::write(folder.path().join("host.lock"), []).unwrap();
        drop(HostWindow::create(&path).unwrap());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn an_empty_file_is_used_and_stays() {
        let file = tempfile::NamedTempFile::new().unwrap();
        drop(HostWindow::create(file.path()).unwrap());
        assert_eq!(fs::read(file.path()).unwrap().len(), RAM_LEN);
    }
}
