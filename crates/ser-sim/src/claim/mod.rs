//! A path that one simulator owns, such as `/tmp/ser`, and the record of what it made there, and
//! what it has put there.
//!
//! # Design
//! What stands under a name does not tell who made it, nor whether that simulator still runs. A
//! record of our own tells both: its lock says that the simulator runs, and its content says what
//! it has made. The record is in a directory of the user's that nobody else can write to. It is
//! never beside the name, where it could be anything of anybody's.
//!
//! The directory does not depend on the environment, as `$XDG_RUNTIME_DIR` does, because a
//! simulator started from a terminal and one started from a timer must meet. It outlives a restart
//! of the computer, as the name does.
//!
//! # Notes
//! Other users have directories of their own. Between two users, making the thing itself decides:
//! it fails where something is already there, and neither replaces what the other has made.

mod record_folder;

use std::fs::{self, File, Metadata, TryLockError};
use std::io::{self, ErrorKind};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{FileExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use crc::{CRC_64_XZ, Crc};
use rustix::fs::{AtFlags, Mode, OFlags, openat, unlinkat};

use crate::error::{NoRecords, SimError};

/// How often a lock is tried. A try is lost each time another simulator removes the record between
/// its opening and its locking.
const MAX_TRIES: u32 = 100;

/// No record is longer.
const MAX_RECORD_LEN: usize = 256;

/// A name that is ours, and with it what we have put there: both go when this is dropped.
pub(crate) struct Claim {
    name: PathBuf,
    /// Locked as long as it is open.
    record: File,
    /// The name of the record in its folder.
    file_name: String,
    folder: File,
}

impl Claim {
    /// Claims a name; `in_use` makes the error when another simulator has it.
    pub(crate) fn on(name: &Path, in_use: fn(PathBuf) -> SimError) -> Result<Claim, SimError> {
        let file_name =
            record_name(name).map_err(SimError::io(format!("make {}", name.display())))?;
        let doing = || format!("note that {} is in use", name.display());
        let folder = record_folder::open()
            .map_err(|tried| SimError::NoRecords(NoRecords { name: name.to_owned(), tried }))?;
        // Programs that tidy up leave a locked folder alone. Without the lock everything still
        // works.
        let _ = folder.try_lock_shared();
        match lock_record(&folder, &file_name).map_err(SimError::io(doing()))? {
            Some(record) => Ok(Claim { name: name.to_owned(), record, file_name, folder }),
            None => Err(in_use(name.to_owned())),
        }
    }

    /// Whether something stands under the name, and if so, whether a simulator made it: this one,
    /// or one that did not end as it should.
    pub(crate) fn holder(&self) -> io::Result<Holder> {
        match fs::symlink_metadata(&self.name) {
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(Holder::Nobody),
            Err(error) => Err(error),
            Ok(found) if self.recorded()?.is_some_and(|made| made == Identity::of(&found)) => {
                Ok(Holder::Simulator)
            }
            Ok(_) => Ok(Holder::Foreign),
        }
    }

    /// Notes that what stands under the name is ours from now on. To be called when we have just
    /// made it.
    ///
    /// # Errors
    /// When that cannot be noted. Then the thing itself is removed again, because nobody else
    /// would.
    pub(crate) fn remember(&self) -> io::Result<()> {
        self.note(&Identity::of(&fs::symlink_metadata(&self.name)?))
    }

    /// The same for a file that we have open: whatever its name leads to by now, this is ours.
    ///
    /// # Errors
    /// As for [`remember`](Self::remember).
    pub(crate) fn remember_file(&self, file: &File) -> io::Result<()> {
        self.note(&Identity::of(&file.metadata()?))
    }

    fn note(&self, made: &Identity) -> io::Result<()> {
        self.record(made).inspect_err(|_| {
            let found = fs::symlink_metadata(&self.name);
            if found.is_ok_and(|found| Identity::of(&found) == *made) {
                drop(fs::remove_file(&self.name));
            }
        })
    }

    fn record(&self, made: &Identity) -> io::Result<()> {
        let Identity { device, inode, born_ns } = made;
        // A record cut short by a crash does not parse, and what is under the name stays.
        let text = format!("{device} {inode} {born_ns}\n");
        self.record.set_len(0)?;
        self.record.write_all_at(text.as_bytes(), 0)
    }

    /// Removes what we have made, if it is still there.
    pub(crate) fn remove(&self) -> io::Result<()> {
        match self.holder()? {
            Holder::Simulator => fs::remove_file(&self.name),
            Holder::Nobody | Holder::Foreign => Ok(()),
        }
    }

    fn recorded(&self) -> io::Result<Option<Identity>> {
        let mut text = [0; MAX_RECORD_LEN];
        let read = self.record.read_at(&mut text, 0)?;
        Ok(text.get(..read).and_then(Identity::parse))
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        // It may be gone, or somebody may have put something else there.
        let _ = self.remove();
        // The record is still locked. Another simulator that waits for the lock sees that it is
        // gone, and makes a new one.
        let _ = unlinkat(&self.folder, &self.file_name, AtFlags::empty());
    }
}

/// Who has made what stands under a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Holder {
    /// Nothing is there.
    Nobody,
    /// A simulator of ours.
    Simulator,
    /// Anybody else.
    Foreign,
}

/// What tells a file or link apart from another one that has come into its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Identity {
    device: u64,
    inode: u64,
    /// When it was made, in nanoseconds since 1970, because file systems reuse inodes. 0 where the
    /// file system does not keep it.
    born_ns: u128,
}

impl Identity {
    fn of(found: &Metadata) -> Identity {
        let born = found.created().ok().and_then(|born| born.duration_since(UNIX_EPOCH).ok());
        let born_ns = born.map_or(0, |born| born.as_nanos());
        Identity { device: found.dev(), inode: found.ino(), born_ns }
    }

    fn parse(record: &[u8]) -> Option<Identity> {
        let line = str::from_utf8(record).ok()?.strip_suffix('\n')?;
        let mut numbers = line.split(' ').map(|number| number.parse::<u128>().ok());
        let mut next = || numbers.next().flatten();
        let device = next().and_then(|number| u64::try_from(number).ok())?;
        let inode = next().and_then(|number| u64::try_from(number).ok())?;
        let born_ns = next()?;
        Some(Identity { device, inode, born_ns })
    }
}

/// The record of a name, however the name is spelled.
fn record_name(name: &Path) -> io::Result<String> {
    let last = name.file_name().ok_or(ErrorKind::InvalidFilename)?;
    let folder = name.parent().filter(|folder| !folder.as_os_str().is_empty());
    let whole = fs::canonicalize(folder.unwrap_or(Path::new(".")))?.join(last);
    let hash = Crc::<u64>::new(&CRC_64_XZ).checksum(whole.as_os_str().as_bytes());
    Ok(format!("{hash:016x}"))
}

/// Makes or opens the record and locks it; nothing when another simulator has it.
fn lock_record(folder: &File, name: &str) -> io::Result<Option<File>> {
    let flags = OFlags::RDWR | OFlags::CREATE | OFlags::NOFOLLOW | OFlags::CLOEXEC;
    for _ in 0..MAX_TRIES {
        let record = File::from(openat(folder, name, flags, Mode::RUSR | Mode::WUSR)?);
        match record.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Ok(None),
            Err(TryLockError::Error(error)) => return Err(error),
        }
        // The simulator that had it may have removed it between our opening and our locking.
        let again = openat(
            folder,
            name,
            OFlags::RDONLY | OFlags::NOFOLLOW | OFlags::CLOEXEC,
            Mode::empty(),
        );
        let still_there = again.is_ok_and(|again| {
            let (record, again) = (record.metadata(), File::from(again).metadata());
            record
                .and_then(|record| Ok(Identity::of(&record) == Identity::of(&again?)))
                .unwrap_or(false)
        });
        if still_there {
            return Ok(Some(record));
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::thread;

    use super::*;

    #[test]
    fn a_name_never_has_two_owners_however_they_come_and_go() {
        let folder = tempfile::tempdir().unwrap();
        let name = folder.path().join("ser");
        let owned = AtomicBool::new(false);
        let claim_often = || {
            let mut times = 0;
            for _ in 0..2000 {
                let Ok(claim) = Claim::on(&name, SimError::LinkInUse) else { continue };
                assert!(!owned.swap(true, Ordering::SeqCst), "two owners");
                assert_eq!(claim.holder().unwrap(), Holder::Nobody);
                symlink("/nonexistent", &name).unwrap();
                claim.remember().unwrap();
                assert_eq!(claim.holder().unwrap(), Holder::Simulator);
                times += 1;
                owned.store(false, Ordering::SeqCst);
            }
            times
        };
        let times: u32 = thread::scope(|scope| {
            let claiming = [(); 4].map(|()| scope.spawn(claim_often));
            claiming.into_iter().map(|thread| thread.join().unwrap()).sum()
        });
        assert!(times > 0);
        assert!(fs::symlink_metadata(&name).is_err(), "the last one has tidied up");
    }

    #[test]
    fn a_name_that_ends_nowhere_cannot_be_claimed() {
        for name in ["/", "..", "/tmp/..", ""] {
            assert!(matches!(
                Claim::on(Path::new(name), SimError::LinkInUse),
                Err(SimError::Io { .. })
            ));
        }
    }

    #[test]
    fn a_record_that_is_damaged_makes_nothing_ours() {
        assert_eq!(Identity::parse(b"1 2 3\n"), Some(Identity { device: 1, inode: 2, born_ns: 3 }));
        for damaged in
            ["", "\n", "1 2 3", "1 2\n", "1 2 x\n", "-1 2 3\n", "18446744073709551616 2 3\n"]
        {
            assert_eq!(Identity::parse(damaged.as_bytes()), None, "{damaged:?}");
        }
    }
}
