//! What has been delivered already, kept in the user's state directory between two runs: one file per unit.

use std::error::Error;
use std::fmt;
use std::fs::{self, File, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use ser_proto::{Entry, Inputs, TimeStamp};
use serde::{Deserialize, Serialize};

use crate::error::{Failure, Result};

/// The layout of the file. A change that old versions would misread gets the next number.
const VERSION: u32 = 1;

/// Where a unit's log had been read to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Delivered {
    /// The unit's total after the last delivered event.
    pub total: u16,
    /// The last delivered event itself, to tell the log from another one with the same total.
    pub last: Option<Entry>,
    /// Entries that the log could hold then.
    pub size: u16,
}

/// A text that does not say what was delivered, and why.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NotDelivered(String);

impl fmt::Display for NotDelivered {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl Error for NotDelivered {}

impl Delivered {
    /// Reads what [`to_text`](Self::to_text) has written.
    ///
    /// # Errors
    /// When it has not: the text is damaged, or of another version.
    pub fn from_text(text: &[u8]) -> std::result::Result<Delivered, NotDelivered> {
        let content: Content =
            serde_json::from_slice(text).map_err(|error| NotDelivered(error.to_string()))?;
        if content.version != VERSION {
            return Err(NotDelivered(format!("version {} is not {VERSION}", content.version)));
        }
        Ok(Delivered { total: content.total, last: content.last.map(Entry::from), size: content.size })
    }

    /// The content of the state file of this unit.
    ///
    /// # Errors
    /// None that is known: there is nothing here that JSON does not have.
    pub fn to_text(&self, unit: &str) -> io::Result<String> {
        let Delivered { total, last, size } = *self;
        let last = last.as_ref().map(LastEntry::from);
        let content = Content { version: VERSION, unit: unit.to_owned(), total, size, last };
        Ok(serde_json::to_string(&content)? + "\n")
    }
}

/// The file of one unit.
#[derive(Debug)]
pub(crate) struct StateFile {
    path: PathBuf,
    unit: String,
}

/// Keeps other runs away from a state file, until it is dropped or the program ends.
#[derive(Debug)]
pub(crate) struct StateLock {
    _file: File,
}

/// The file's content.
#[derive(Serialize, Deserialize)]
struct Content {
    version: u32,
    /// The `--port` text, for whoever looks into the file.
    unit: String,
    total: u16,
    size: u16,
    last: Option<LastEntry>,
}

/// An entry, field by field: its time need not be a date that exists.
#[derive(Serialize, Deserialize)]
struct LastEntry {
    changed: u32,
    state: u32,
    /// Two-digit year, month, day, hour, minute, second.
    time: [u8; 6],
    millisecond: u16,
}

impl StateFile {
    /// The file for the unit behind `port`, in `directory` or where the system wants state to be.
    pub(crate) fn of_unit(port: &str, directory: Option<&Path>) -> Result<StateFile> {
        let directory = match directory {
            Some(directory) => directory.to_path_buf(),
            None => default_directory()?,
        };
        Ok(StateFile { path: directory.join(file_name(port)), unit: port.to_string() })
    }

    /// Takes the file for this run alone.
    pub(crate) fn lock(&self) -> Result<StateLock> {
        // The state file itself is replaced whenever it is saved, so the lock is on one that stays.
        let path = self.path.with_extension("lock");
        let cannot = |error: io::Error| {
            Failure::new(format!("cannot lock {}: {error}", path.display()))
                .hint("choose another directory with --state-dir DIR")
        };
        if let Some(directory) = path.parent() {
            fs::create_dir_all(directory).map_err(cannot)?;
        }
        let file = File::options().write(true).create(true).truncate(false).open(&path).map_err(cannot)?;
        match file.try_lock() {
            Ok(()) => Ok(StateLock { _file: file }),
            Err(TryLockError::WouldBlock) => Err(Failure::new(format!(
                "another ser-cli is reading what is new from {}",
                self.unit
            ))
            .hint("wait until it has ended, or end it: is a watch running?")
            .hint("read --all needs no state; with --state-dir DIR a second reader gets everything, too")),
            Err(TryLockError::Error(error)) => Err(cannot(error)),
        }
    }

    /// What had been delivered; `None` when nothing has yet.
    pub(crate) fn load(&self) -> Result<Option<Delivered>> {
        let text = match fs::read(&self.path) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(Failure::reading(self.path.display(), &error)),
        };
        Delivered::from_text(&text).map(Some).map_err(|why| self.damaged(&why))
    }

    /// Remembers what has been delivered. After a crash the file holds either the old or the new content.
    pub(crate) fn save(&self, delivered: &Delivered) -> Result<()> {
        self.try_save(delivered).map_err(|error| {
            Failure::new(format!("cannot remember in {} what was delivered: {error}", self.path.display()))
                .hint("the next --new will deliver the same events again")
                .hint("choose another directory with --state-dir DIR")
        })
    }

    fn try_save(&self, delivered: &Delivered) -> io::Result<()> {
        let text = delivered.to_text(&self.unit)?;
        if let Some(directory) = self.path.parent() {
            fs::create_dir_all(directory)?;
        }
        let temporary = self.path.with_extension("tmp");
        let result = write_whole(&temporary, &text).and_then(|()| fs::rename(&temporary, &self.path));
        if result.is_err() {
            // The first error is the one to tell.
            let _ = fs::remove_file(&temporary);
        }
        result
    }

    fn damaged(&self, why: &NotDelivered) -> Failure {
        Failure::new(format!("{} does not say what was delivered: {why}", self.path.display()))
            .hint("read --all delivers everything the unit has and needs no state")
            .hint("delete the file to begin anew: the next --new then delivers everything")
    }
}

fn write_whole(path: &Path, text: &str) -> io::Result<()> {
    let mut file = fs::File::create(path)?;
    file.write_all(text.as_bytes())?;
    file.sync_all()
}

fn default_directory() -> Result<PathBuf> {
    use etcetera::BaseStrategy;

    let strategy = etcetera::choose_base_strategy().map_err(|error| {
        Failure::new(error).hint("say with --state-dir DIR where to keep what was delivered")
    })?;
    let base = strategy.state_dir().unwrap_or_else(|| strategy.data_dir());
    Ok(base.join("ser-cli"))
}

/// A name that any file system takes, that people can read, and that no other port text gives.
fn file_name(port: &str) -> String {
    // Windows takes COM3.json for the port itself.
    let mut name = String::from("port-");
    for byte in port.bytes() {
        match byte {
            b'/' => name.push('_'),
            // `_` is taken.
            b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'.' => name.push(char::from(byte)),
            other => name.push_str(&format!("%{other:02X}")),
        }
    }
    name + ".json"
}

impl From<&Entry> for LastEntry {
    fn from(entry: &Entry) -> LastEntry {
        let TimeStamp { year, month, day, hour, minute, second, millisecond } = entry.time;
        LastEntry {
            changed: entry.changed.0,
            state: entry.state.0,
            time: [year, month, day, hour, minute, second],
            millisecond,
        }
    }
}

impl From<LastEntry> for Entry {
    fn from(last: LastEntry) -> Entry {
        let [year, month, day, hour, minute, second] = last.time;
        Entry {
            changed: Inputs(last.changed),
            state: Inputs(last.state),
            time: TimeStamp { year, month, day, hour, minute, second, millisecond: last.millisecond },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::testing::entry;

    fn state_in(directory: &tempfile::TempDir) -> StateFile {
        StateFile::of_unit("/dev/ttyUSB0", Some(&directory.path().join("new"))).unwrap()
    }

    #[test]
    fn what_is_saved_is_loaded_again() {
        let directory = tempfile::tempdir().unwrap();
        let state = state_in(&directory);
        assert_eq!(state.load().unwrap(), None);
        let mut last = entry("00.250", &[3, 32], &[32]);
        last.time.month = 200;
        for delivered in [
            Delivered { total: 65_535, last: Some(last), size: 2048 },
            Delivered { total: 0, last: None, size: 1 },
        ] {
            state.save(&delivered).unwrap();
            assert_eq!(state.load().unwrap(), Some(delivered));
        }
        let names: Vec<_> = fs::read_dir(state.path.parent().unwrap()).unwrap().collect();
        assert_eq!(names.len(), 1, "no temporary files are left: {names:?}");
    }

    #[test]
    fn a_damaged_file_is_named_with_what_to_do() {
        let directory = tempfile::tempdir().unwrap();
        let state = state_in(&directory);
        state.save(&Delivered { total: 7, last: None, size: 2048 }).unwrap();
        let good = fs::read_to_string(&state.path).unwrap();
        let wrong = [
            String::new(),
            "{".to_string(),
            good[..good.len() / 2].to_string(),
            good.replace("\"version\":1", "\"version\":2"),
            good.replace(":7", ":70000"),
        ];
        for content in wrong {
            fs::write(&state.path, content).unwrap();
            let text = state.load().unwrap_err().text();
            assert!(text.contains("_dev_ttyUSB0.json does not say what was delivered"), "{text}");
            assert!(text.contains("--all") && text.contains("delete the file"), "{text}");
        }
    }

    #[test]
    fn one_run_at_a_time_has_the_file() {
        let directory = tempfile::tempdir().unwrap();
        let lock = state_in(&directory).lock().unwrap();
        let text = state_in(&directory).lock().unwrap_err().text();
        assert!(text.contains("another ser-cli") && text.contains("/dev/ttyUSB0"), "{text}");
        StateFile::of_unit("/dev/ttyUSB1", Some(directory.path())).unwrap().lock().unwrap();
        drop(lock);
        state_in(&directory).lock().unwrap();
    }

    #[test]
    fn a_directory_that_cannot_be_made_is_an_error_with_advice() {
        let directory = tempfile::tempdir().unwrap();
        fs::write(directory.path().join("new"), "a file in the way").unwrap();
        let text =
            state_in(&directory).save(&Delivered { total: 7, last: None, size: 1 }).unwrap_err().text();
        assert!(text.contains("--state-dir"), "{text}");
    }

    #[test]
    fn every_port_has_a_readable_file_name_of_its_own() {
        for (port, name) in [
            ("/dev/ttyUSB0", "port-_dev_ttyUSB0.json"),
            ("COM3", "port-COM3.json"),
            ("tcp://10.0.0.7:4000", "port-tcp%3A__10.0.0.7%3A4000.json"),
            ("/dev/a_b", "port-_dev_a%5Fb.json"),
            ("../x", "port-.._x.json"),
            ("./\u{e4} *", "port-._%C3%A4%20%2A.json"),
        ] {
            assert_eq!(file_name(port), name);
        }
    }
}
