//! Files that appear when all of them are whole, and not before.
//!
//! Each is written under a name that nobody can foresee, in the folder where it is to be. When all
//! are on the disk they get their names, one after the other. If one cannot get its name, those
//! before it are taken back, and what stood there under `--force` stands there again. An interrupt
//! removes what has no name yet, and waits while names are given.
//!
//! No file system gives several names at once. If the power fails, or the program is killed, in the
//! instant in which names are given, some files may be new and others old; what was replaced is
//! then beside them as `.ser-cli-….old`.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::{NamedTempFile, TempPath};

use crate::error::{Failure, Result, warn};
use crate::interrupt;

/// Files that are being written and have no names yet, for an interrupt to remove.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Who may read a new file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Readers {
    /// As with any new file.
    AsTheUserSays,
    /// Nobody else.
    #[cfg(feature = "sign")]
    TheUserAlone,
}

/// Files that are being written.
#[derive(Debug)]
pub(crate) struct NewFiles {
    files: Vec<(NamedTempFile, PathBuf)>,
    /// Whether files of these names may be there, and are overwritten.
    overwrites: bool,
    /// What is read meanwhile, and is never overwritten.
    inputs: Vec<PathBuf>,
}

impl NewFiles {
    pub(crate) const fn new(overwrites: bool) -> NewFiles {
        NewFiles { files: Vec::new(), overwrites, inputs: Vec::new() }
    }

    /// With these files kept whatever the user says: what is written is made of them.
    pub(crate) fn sparing(mut self, inputs: impl IntoIterator<Item = PathBuf>) -> NewFiles {
        self.inputs.extend(inputs);
        self
    }

    /// Begins the file of this name.
    pub(crate) fn create(&mut self, path: &Path) -> Result<File> {
        self.begin(path, Readers::AsTheUserSays)
    }

    /// Begins the file of this name, which nobody but the user may ever read.
    #[cfg(feature = "sign")]
    pub(crate) fn create_private(&mut self, path: &Path) -> Result<File> {
        self.begin(path, Readers::TheUserAlone)
    }

    fn begin(&mut self, path: &Path, readers: Readers) -> Result<File> {
        match fs::symlink_metadata(path) {
            Ok(found) if found.is_dir() => {
                return Err(Failure::new(format!("{} is a folder", path.display()))
                    .hint("name a file in it"));
            }
            // What a device or a pipe gets cannot be taken back, and renaming would remove it.
            Ok(found) if !found.is_file() => {
                return Err(Failure::new(format!("{} is not a file", path.display()))
                    .hint("without -o the data goes to standard output; send that there"));
            }
            Ok(_) if self.inputs.iter().any(|input| is_same(input, path)) => {
                return Err(Failure::new(format!(
                    "{} is read by this command, and is never overwritten",
                    path.display()
                ))
                .hint("give another name with -o"));
            }
            Ok(_) if !self.overwrites => return Err(exists(path)),
            _ => {}
        }
        interrupt::clean_up_with(remove_unfinished)?;
        // An interrupt waits, so that it knows of the file.
        let mut unfinished = unfinished();
        let file = temporary(folder_of(path), readers).map_err(|error| not_begun(path, &error))?;
        let handle = file.as_file().try_clone();
        let handle = handle.map_err(|error| Failure::writing(path.display(), &error))?;
        unfinished.push(file.path().to_owned());
        self.files.push((file, path.to_owned()));
        Ok(handle)
    }

    /// Gives all files their names.
    pub(crate) fn finish(mut self) -> Result<()> {
        for (file, path) in &self.files {
            file.as_file().sync_all().map_err(|error| Failure::writing(path.display(), &error))?;
        }
        let files = std::mem::take(&mut self.files);
        // An interrupt waits until all have their names, or none has.
        let mut unfinished = unfinished();
        forget(&mut unfinished, &files);
        let mut named: Vec<Named> = Vec::new();
        let last = files.len().saturating_sub(1);
        for (place, (file, path)) in files.into_iter().enumerate() {
            // What the last one replaces need not be put back: nothing can fail after it.
            match give_name(file, &path, self.overwrites, place < last) {
                Ok(old) => named.push(Named { path, old }),
                Err(error) => {
                    named.into_iter().rev().for_each(Named::take_back);
                    return Err(match error.kind() {
                        io::ErrorKind::AlreadyExists => exists(&path),
                        _ => Failure::writing(path.display(), &error),
                    });
                }
            }
        }
        // The names are in the folder, which has to be on the disk as well.
        named.iter().for_each(|named| sync_folder(folder_of(&named.path)));
        Ok(())
    }
}

impl Drop for NewFiles {
    fn drop(&mut self) {
        let files = std::mem::take(&mut self.files);
        forget(&mut unfinished(), &files);
    }
}

fn unfinished() -> MutexGuard<'static, Vec<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

fn forget(unfinished: &mut Vec<PathBuf>, files: &[(NamedTempFile, PathBuf)]) {
    unfinished.retain(|path| !files.iter().any(|(file, _)| file.path() == path));
}

/// Before an interrupt ends the program: nothing is left of what is not whole.
fn remove_unfinished() {
    let unfinished = unfinished();
    for path in unfinished.iter() {
        // If that fails there is nothing else to try.
        let _ = fs::remove_file(path);
    }
    if !unfinished.is_empty() {
        warn("interrupted, and nothing is written");
    }
    // Until the program has ended, no file is begun or gets its name.
    std::mem::forget(unfinished);
}

/// Gives a file its name. Returns what had the name before, if that `is_kept`.
fn give_name(
    file: NamedTempFile,
    path: &Path,
    overwrites: bool,
    is_kept: bool,
) -> io::Result<Option<Old>> {
    if !overwrites {
        return file.persist_noclobber(path).map(|_| None).map_err(|error| error.error);
    }
    let old = if is_kept { Old::aside(path)? } else { None };
    match file.persist(path) {
        Ok(_) => Ok(old),
        Err(error) => {
            if let Some(old) = old {
                old.put_back(path);
            }
            Err(error.error)
        }
    }
}

/// A file that was given its name just now.
struct Named {
    path: PathBuf,
    old: Option<Old>,
}

impl Named {
    /// Puts back what was there before, if there was anything.
    fn take_back(self) {
        match self.old {
            Some(old) => old.put_back(&self.path),
            // If that fails, too, there is nothing else to try.
            None => _ = fs::remove_file(self.path),
        }
    }
}

/// A file that is being replaced, under a name beside it. It is gone when this is dropped.
struct Old(TempPath);

impl Old {
    /// Keeps what has this name now, if anything has.
    fn aside(path: &Path) -> io::Result<Option<Old>> {
        match fs::symlink_metadata(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(error),
            Ok(_) => {}
        }
        // With a second name for it, the first one is never without a file; but there are file
        // systems without second names.
        let aside = beside(path, |aside| fs::hard_link(path, aside))
            .or_else(|_| beside(path, |aside| fs::rename(path, aside)))?;
        Ok(Some(Old(aside)))
    }

    fn put_back(self, path: &Path) {
        if let Err(error) = self.0.persist(path) {
            let (why, kept) = (error.error, error.path);
            let place = kept.display().to_string();
            // What cannot be kept is told in vain, and there is nothing else to try.
            let _ = kept.keep();
            warn(format_args!("what was {} is now {place}: {why}", path.display()));
        }
    }
}

/// Makes a name beside a file, in this way.
fn beside(path: &Path, make: impl FnMut(&Path) -> io::Result<()>) -> io::Result<TempPath> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".ser-cli-").suffix(".old");
    builder.make_in(folder_of(path), make).map(NamedTempFile::into_temp_path)
}

/// Why a file could not be begun. The error tells of a name that the user does not know.
fn not_begun(path: &Path, error: &io::Error) -> Failure {
    let name = path.display();
    if error.kind() == io::ErrorKind::NotFound {
        let folder = folder_of(path).display();
        return Failure::new(format!("cannot write {name}: there is no folder {folder}"))
            .hint("make the folder first, or name another one");
    }
    let text = error.to_string();
    let why = text.split_once(" at path ").map_or(&*text, |(why, _)| why);
    Failure::new(format!("cannot write {name}: {why}"))
        .hint("check your rights to its folder, and that it has room")
}

fn exists(path: &Path) -> Failure {
    Failure::new(format!("{} exists, and is not overwritten", path.display()))
        .hint("give another name with -o, or overwrite it with --force")
}

/// Whether two names are of one file.
fn is_same(one: &Path, other: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        let id = |path| fs::metadata(path).map(|about| (about.dev(), about.ino()));
        if let (Ok(one), Ok(other)) = (id(one), id(other)) {
            return one == other;
        }
    }
    matches!((fs::canonicalize(one), fs::canonicalize(other)), (Ok(one), Ok(other)) if one == other)
}

/// The folder in which a file is to be.
fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

fn temporary(folder: &Path, readers: Readers) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".ser-cli-").suffix(".part");
    // As any program makes files: the user's mask takes away what others may not do. Without this,
    // only the user may read it.
    #[cfg(unix)]
    if readers == Readers::AsTheUserSays {
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    }
    #[cfg(not(unix))]
    let _ = readers;
    builder.tempfile_in(folder)
}

#[cfg(unix)]
fn sync_folder(folder: &Path) {
    // The files are there; a file system that cannot do this keeps its own promises.
    let _ = File::open(folder).and_then(|folder| folder.sync_all());
}

/// Other systems do not open folders.
#[cfg(not(unix))]
fn sync_folder(_: &Path) {}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let name = |entry: io::Result<fs::DirEntry>| {
            entry.unwrap().file_name().to_string_lossy().into_owned()
        };
        let mut names: Vec<String> = fs::read_dir(folder).unwrap().map(name).collect();
        names.sort();
        names
    }

    #[test]
    fn files_have_their_names_when_all_are_whole() {
        let folder = tempfile::tempdir().unwrap();
        let mut files = NewFiles::new(false);
        for name in ["a.cfg", "a.dat"] {
            files.create(&folder.path().join(name)).unwrap().write_all(b"1").unwrap();
        }
        assert!(names(folder.path()).iter().all(|name| name.starts_with(".ser-cli-")));
        files.finish().unwrap();
        assert_eq!(names(folder.path()), ["a.cfg", "a.dat"]);
    }

    #[test]
    fn nothing_is_left_if_it_ends_before() {
        let folder = tempfile::tempdir().unwrap();
        let mut files = NewFiles::new(false);
        files.create(&folder.path().join("a.cfg")).unwrap();
        drop(files);
        assert!(names(folder.path()).is_empty());
    }

    /// Somebody makes a file of that name while ours is written.
    #[test]
    fn if_one_cannot_get_its_name_none_has() {
        let folder = tempfile::tempdir().unwrap();
        let mut files = NewFiles::new(false);
        for name in ["a.cfg", "a.dat"] {
            files.create(&folder.path().join(name)).unwrap();
        }
        fs::write(folder.path().join("a.dat"), "theirs").unwrap();
        let failure = files.finish().unwrap_err();
        assert!(failure.message().contains("a.dat exists"), "{}", failure.message());
        assert_eq!(names(folder.path()), ["a.dat"]);
        assert_eq!(fs::read_to_string(folder.path().join("a.dat")).unwrap(), "theirs");
    }

    /// The same where others are overwritten: what stood there stands there again.
    #[test]
    fn if_one_cannot_get_its_name_the_old_ones_are_back() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("a.dat"), "old").unwrap();
        let mut files = NewFiles::new(true);
        for name in ["a.dat", "a.hdr", "a.cfg"] {
            files.create(&at(name)).unwrap().write_all(b"new").unwrap();
        }
        fs::create_dir(at("a.cfg")).unwrap();
        fs::write(at("a.cfg").join("theirs"), "").unwrap();
        let failure = files.finish().unwrap_err();
        assert!(failure.message().contains("a.cfg"), "{}", failure.message());
        assert_eq!(names(folder.path()), ["a.cfg", "a.dat"]);
        assert_eq!(fs::read_to_string(at("a.dat")).unwrap(), "old");
    }

    #[test]
    fn several_files_are_overwritten_and_nothing_else_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let mut files = NewFiles::new(true);
        for name in ["a.dat", "a.cfg"] {
            fs::write(at(name), "old").unwrap();
            files.create(&at(name)).unwrap().write_all(b"new").unwrap();
        }
        files.finish().unwrap();
        assert_eq!(names(folder.path()), ["a.cfg", "a.dat"]);
        for name in ["a.dat", "a.cfg"] {
            assert_eq!(fs::read_to_string(at(name)).unwrap(), "new");
        }
    }

    #[test]
    fn a_folder_that_is_not_there_is_told_by_the_users_name() {
        let folder = tempfile::tempdir().unwrap();
        let failure = NewFiles::new(false).create(&folder.path().join("no/a.csv")).unwrap_err();
        assert!(failure.message().contains("no/a.csv: there is no folder "), "{failure:?}");
        assert!(!failure.message().contains(".part"), "{failure:?}");
    }

    #[test]
    fn an_existing_file_is_overwritten_only_on_demand() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        fs::write(&path, "old").unwrap();
        let refused = NewFiles::new(false).create(&path).unwrap_err();
        assert!(refused.message().contains("exists"), "{}", refused.message());
        let mut files = NewFiles::new(true);
        files.create(&path).unwrap().write_all(b"new").unwrap();
        files.finish().unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
    }

    #[test]
    fn what_is_read_is_never_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("a.jsonl"), "read").unwrap();
        fs::write(at("b.jsonl"), "other").unwrap();
        let mut names = vec![at("a.jsonl"), at(".").join("a.jsonl")];
        #[cfg(unix)]
        {
            fs::hard_link(at("a.jsonl"), at("c.jsonl")).unwrap();
            names.push(at("c.jsonl"));
        }
        let mut files = NewFiles::new(true).sparing([at("nowhere"), at("a.jsonl")]);
        for name in names {
            let refused = files.create(&name).unwrap_err();
            assert!(refused.message().contains("is read by"), "{}", refused.message());
        }
        assert!(files.create(&at("b.jsonl")).is_ok());
        assert!(files.create(&at("d.jsonl")).is_ok());
    }

    #[test]
    fn a_folder_or_a_device_is_never_replaced() {
        let folder = tempfile::tempdir().unwrap();
        assert!(NewFiles::new(true).create(folder.path()).is_err());
        #[cfg(unix)]
        assert!(NewFiles::new(true).create(Path::new("/dev/null")).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn others_may_read_the_file_as_far_as_the_users_mask_allows() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (ours, plain) = (folder.path().join("ours"), folder.path().join("plain"));
        let mut files = NewFiles::new(false);
        files.create(&ours).unwrap();
        files.finish().unwrap();
        File::create(&plain).unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&plain));
    }
}
