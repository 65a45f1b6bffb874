//! The file between the host's board and the host, which is another process.

use std::fs::File;
use std::io::{self, ErrorKind};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use crate::claim::{Claim, Holder};
use crate::error::SimError;
use crate::genius::{Board, RAM_LEN};

/// The bytes that a host writes last stand first, so these are read one by one before the rest.
const READ_FIRST: usize = 3;

/// The shared RAM as a file.
pub(super) struct HostWindow {
    path: PathBuf,
    file: File,
    image: Box<[u8; RAM_LEN]>,
    /// Keeps other simulators from taking the window. The file is removed with it.
    _claim: Claim,
}

impl HostWindow {
    /// Makes the file, or takes one that a simulator has left behind, and fills it with zeros.
    pub(super) fn create(path: &Path) -> Result<HostWindow, SimError> {
        let doing = || SimError::io(format!("make the GENI window {}", path.display()));
        let claim = Claim::on(path, SimError::WindowInUse)?;
        match claim.holder().map_err(doing())? {
            Holder::Nobody => {}
            Holder::Simulator => claim.remove().map_err(doing())?,
            Holder::Foreign => return Err(SimError::WindowTaken(path.to_owned())),
        }
        // Fails where something has been put there meanwhile, and follows no link.
        let file = File::options().read(true).write(true).create_new(true).open(path);
        let file = match file {
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {
                return Err(SimError::WindowTaken(path.to_owned()));
            }
            file => file.map_err(doing())?,
        };
        let ready = claim.remember_file(&file).and_then(|()| file.write_all_at(&[0; RAM_LEN], 0));
        ready.map_err(doing())?;
        Ok(HostWindow { path: path.to_owned(), file, image: Box::new([0; RAM_LEN]), _claim: claim })
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

/// Reads one part of the file. After an error `part` is unchanged, so the board is told nothing.
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

#[cfg(test)]
mod tests {
    use std::fs;
    use std::os::unix::fs::symlink;

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
        for len in [0, 1, RAM_LEN] {
            fs::write(&path, vec![0xA5; len]).unwrap();
            assert!(matches!(HostWindow::create(&path), Err(SimError::WindowTaken(_))));
            assert_eq!(fs::read(&path).unwrap(), vec![0xA5; len]);
        }
    }

    #[test]
    fn no_link_is_followed() {
        let folder = tempfile::tempdir().unwrap();
        let (path, victim) = (folder.path().join("host"), folder.path().join("victim"));
        symlink(&victim, &path).unwrap();
        assert!(matches!(HostWindow::create(&path), Err(SimError::WindowTaken(_))));
        assert!(!victim.exists());
        fs::write(&victim, []).unwrap();
        assert!(matches!(HostWindow::create(&path), Err(SimError::WindowTaken(_))));
        assert_eq!((fs::read(&victim).unwrap(), fs::read_link(&path).unwrap()), (vec![], victim));
    }

    #[test]
    fn what_has_come_into_the_place_of_the_window_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("host");
        let window = HostWindow::create(&path).unwrap();
        let other = folder.path().join("other");
        fs::write(&other, [0xA5; RAM_LEN]).unwrap();
        fs::rename(&other, &path).unwrap();
        drop(window);
        assert_eq!(fs::read(&path).unwrap(), [0xA5; RAM_LEN]);
    }
}
