//! The user's directory for records of what simulators have made.

use std::fs::File;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use rustix::fs::{CWD, Mode, OFlags, mkdirat, openat};
use rustix::io::Errno;
use rustix::process::geteuid;

use crate::error::FolderFault;

/// Where it may be, in order of preference.
const PLACES: [&str; 2] = ["/var/tmp", "/tmp"];

/// Opens it, and makes it where there is none.
///
/// # Errors
/// All directories that were tried, and why each cannot be used.
pub(crate) fn open() -> Result<File, Vec<(PathBuf, FolderFault)>> {
    open_in(&PLACES.map(Path::new))
}

fn open_in(places: &[&Path]) -> Result<File, Vec<(PathBuf, FolderFault)>> {
    let name = format!("ser-sim-{}", geteuid().as_raw());
    let mut tried = Vec::new();
    for path in places.iter().map(|place| place.join(&name)) {
        match open_own(&path) {
            Ok(folder) => return Ok(folder),
            Err(fault) => tried.push((path, fault)),
        }
    }
    Err(tried)
}

/// Opens a directory that nobody but us can look into or change.
fn open_own(path: &Path) -> Result<File, FolderFault> {
    let other = |errno: Errno| FolderFault::Other(errno.into());
    match mkdirat(CWD, path, Mode::RWXU) {
        Ok(()) | Err(Errno::EXIST) => {}
        Err(errno) => return Err(other(errno)),
    }
    let flags = OFlags::RDONLY | OFlags::DIRECTORY | OFlags::NOFOLLOW | OFlags::CLOEXEC;
    let folder = match openat(CWD, path, flags, Mode::empty()) {
        Ok(folder) => File::from(folder),
        Err(Errno::NOTDIR | Errno::LOOP) => return Err(FolderFault::NoFolder),
        // Somebody else made it for himself alone: the place itself has let us look for it.
        Err(Errno::ACCESS) => return Err(FolderFault::NotYours),
        Err(errno) => return Err(other(errno)),
    };
    let found = folder.metadata().map_err(FolderFault::Other)?;
    fault(found.uid(), found.mode(), geteuid().as_raw()).map_or(Ok(folder), Err)
}

fn fault(owner: u32, mode: u32, us: u32) -> Option<FolderFault> {
    if owner != us {
        Some(FolderFault::NotYours)
    } else if mode & 0o077 != 0 {
        Some(FolderFault::OpenToOthers)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::os::unix::fs::{PermissionsExt, symlink};

    use super::*;
    use crate::error::{NoRecords, SimError};

    #[test]
    fn a_folder_that_others_could_have_prepared_is_not_used() {
        let place = tempfile::tempdir().unwrap();
        let folder = place.path().join("ser-sim");
        open_own(&folder).unwrap();
        open_own(&folder).unwrap();
        let link = place.path().join("link");
        symlink(&folder, &link).unwrap();
        assert!(matches!(open_own(&link), Err(FolderFault::NoFolder)));
        fs::set_permissions(&folder, fs::Permissions::from_mode(0o777)).unwrap();
        assert!(matches!(open_own(&folder), Err(FolderFault::OpenToOthers)));
        let file = place.path().join("file");
        fs::write(&file, "").unwrap();
        assert!(matches!(open_own(&file), Err(FolderFault::NoFolder)));
        assert!(matches!(open_own(&place.path().join("none/ser-sim")), Err(FolderFault::Other(_))));
    }

    #[test]
    fn whose_a_folder_is_comes_before_who_can_look_into_it() {
        assert!(fault(7, 0o40700, 7).is_none());
        assert!(matches!(fault(7, 0o40750, 7), Some(FolderFault::OpenToOthers)));
        for mode in [0o40700, 0o41777] {
            assert!(matches!(fault(0, mode, 7), Some(FolderFault::NotYours)));
        }
    }

    #[test]
    fn every_folder_that_was_tried_is_told_with_its_reason_and_what_to_do() {
        let place = tempfile::tempdir().unwrap();
        let (first, second) = (place.path().join("first"), place.path().join("second"));
        fs::create_dir(&first).unwrap();
        let name = format!("ser-sim-{}", geteuid().as_raw());
        fs::write(first.join(&name), "").unwrap();
        let tried = open_in(&[&first, &second]).unwrap_err();
        let [wanted, fallback] =
            [first, second].map(|place| place.join(&name).display().to_string());
        let no_records = NoRecords { name: "/tmp/ser".into(), tried };
        let hints: Vec<_> = no_records.hints().collect();
        assert_eq!(hints, [format!("remove {wanted}, which is not a folder")]);
        let told = SimError::NoRecords(no_records).to_string();
        let reason = "No such file or directory (os error 2)";
        let expected = format!(
            "cannot note that /tmp/ser is in use: {wanted} is not a folder; {fallback} cannot be \
             used: {reason}"
        );
        assert_eq!(told, expected);
    }

    #[test]
    fn a_folder_of_somebody_else_has_to_go() {
        let fault = (PathBuf::from("/var/tmp/ser-sim-7"), FolderFault::NotYours);
        let no_records = NoRecords { name: "/tmp/ser".into(), tried: vec![fault] };
        assert!(
            no_records.hints().eq(["remove /var/tmp/ser-sim-7, which is not yours".to_owned()])
        );
    }
}
