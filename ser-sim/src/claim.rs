//! A name in the file system that one simulator has for itself.

use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};

use crate::error::SimError;

/// A lock file beside what is claimed. What stands under the name itself does not tell whether the simulator that put
/// it there still runs.
pub(crate) struct Claim {
    path: PathBuf,
    left_behind: bool,
    _locked: File,
}

impl Claim {
    /// Claims a name; `in_use` makes the error when another simulator has it.
    pub(crate) fn on(name: &Path, in_use: fn(PathBuf) -> SimError) -> Result<Claim, SimError> {
        let mut path = name.as_os_str().to_owned();
        path.push(".lock");
        let path = PathBuf::from(path);
        let doing = || format!("make {}", path.display());
        let left_behind = path.exists();
        let locked = File::create(&path).map_err(SimError::io(doing()))?;
        match locked.try_lock() {
            Ok(()) => Ok(Claim { path, left_behind, _locked: locked }),
            Err(TryLockError::WouldBlock) => Err(in_use(name.to_owned())),
            Err(TryLockError::Error(error)) => Err(SimError::io(doing())(error)),
        }
    }

    /// Whether a simulator had the name and did not end as it should: what stands under it is a simulator's.
    pub(crate) fn was_left_behind(&self) -> bool {
        self.left_behind
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        // Unlocked when the file is closed, and of no use without the lock.
        let _ = fs::remove_file(&self.path);
    }
}
