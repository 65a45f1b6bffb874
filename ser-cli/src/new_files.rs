//! Files that appear when all of them are whole, and not before.
//!
//! Each is written under a name that nobody can foresee, in the folder where it is to be. When all
//! are on the disk they get their names, one after the other. If anything fails, none has its name.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::error::{Failure, Result};

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
        let failed = |error: io::Error| Failure::writing(path.display(), &error);
        let file = temporary(folder_of(path)).map_err(failed)?;
        let handle = file.as_file().try_clone().map_err(failed)?;
        self.files.push((file, path.to_owned()));
        Ok(handle)
    }

    /// Gives all files their names.
    pub(crate) fn finish(self) -> Result<()> {
        for (file, path) in &self.files {
            file.as_file().sync_all().map_err(|error| Failure::writing(path.display(), &error))?;
        }
        let mut named: Vec<PathBuf> = Vec::new();
        for (file, path) in self.files {
            let result = match self.overwrites {
                true => file.persist(&path),
                false => file.persist_noclobber(&path),
            };
            if let Err(error) = result {
                take_back(&named);
                return Err(match error.error.kind() {
                    io::ErrorKind::AlreadyExists => exists(&path),
                    _ => Failure::writing(path.display(), &error.error),
                });
            }
            named.push(path);
        }
        // The names are in the folder, which has to be on the disk as well.
        named.iter().for_each(|path| sync_folder(folder_of(path)));
        Ok(())
    }
}

/// Removes what was given its name just now.
fn take_back(named: &[PathBuf]) {
    for path in named {
        // If that fails, too, there is nothing else to try.
        let _ = fs::remove_file(path);
    }
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

fn temporary(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".ser-cli-").suffix(".part");
    // As any program makes files: the user's mask takes away what others may not do.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
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
