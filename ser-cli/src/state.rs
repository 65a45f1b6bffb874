//! What has been delivered already, kept in the user's state directory between two runs: one file per unit.

use std::error::Error;
use std::fmt;
use std::fs::{self, File, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use ser_client::Cursor;
use ser_proto::{Entry, Inputs, TimeStamp};
use serde::{Deserialize, Serialize};

use crate::error::{Failure, Result};
use crate::output::Life;

/// The layout of the file. A change that old versions would misread gets the next number.
const VERSION: u32 = 2;

/// The layout without sequence and life. What it remembers is still good.
const VERSION_WITHOUT_LIFE: u32 = 1;

/// Where a unit's log had been read to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Delivered {
    /// Behind the last event that was delivered.
    pub cursor: Cursor,
    /// Entries that the log could hold then.
    pub size: u16,
    /// The life of the log; `None` in files of before lives had names.
    pub life: Option<Life>,
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
        let (sequence, life) = match content.version {
            VERSION_WITHOUT_LIFE => (content.total.map(u64::from), None),
            VERSION => (content.sequence, content.life()?),
            version => return Err(NotDelivered(format!("version {version} is not {VERSION}"))),
        };
        let sequence = sequence.ok_or_else(|| NotDelivered("it has no total".to_owned()))?;
        let cursor = Cursor {
            sequence,
            is_exact: content.exact.unwrap_or(false),
            anchor: content.last.map(Entry::from),
        };
        Ok(Delivered { cursor, size: content.size, life })
    }

    /// The content of the state file of this unit.
    ///
    /// # Errors
    /// None that is known: there is nothing here that JSON does not have.
    pub fn to_text(&self, unit: &str) -> io::Result<String> {
        let Delivered { cursor: Cursor { sequence, is_exact, anchor }, size, life } = *self;
        let content = Content {
            version: VERSION,
            unit: unit.to_owned(),
            total: None,
            sequence: Some(sequence),
            exact: Some(is_exact),
            life: life.as_ref().map(Life::to_string),
            size,
            last: anchor.as_ref().map(LastEntry::from),
        };
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
    /// The recorder's total after the last event, in version 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    total: Option<u16>,
    #[serde(default)]
    sequence: Option<u64>,
    /// Whether the sequence counts from the beginning of the log.
    #[serde(default)]
    exact: Option<bool>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    life: Option<String>,
    size: u16,
    last: Option<LastEntry>,
}

impl Content {
    fn life(&self) -> std::result::Result<Option<Life>, NotDelivered> {
        let Some(name) = &self.life else { return Ok(None) };
        let life = Life::from_name(name);
        life.map(Some).ok_or_else(|| NotDelivered("it names no life of the log".to_owned()))
    }
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

    fn delivered(sequence: u64) -> Delivered {
        let cursor = Cursor { sequence, is_exact: false, anchor: None };
        Delivered { cursor, size: 2048, life: Some(Life::UNKNOWN) }
    }

    #[test]
    fn a_file_of_before_lives_had_names_is_read() {
        let text = br#"{"version":1,"unit":"/dev/ttyUSB0","total":7,"size":2048,"last":null}"#;
        let read = Delivered::from_text(text).unwrap();
        assert_eq!(read, Delivered { life: None, ..delivered(7) });
    }

    #[test]
    fn what_is_saved_is_loaded_again() {
        let directory = tempfile::tempdir().unwrap();
        let state = state_in(&directory);
        assert_eq!(state.load().unwrap(), None);
        let mut last = entry("00.250", &[3, 32], &[32]);
        last.time.month = 200;
        let cursor = |sequence, is_exact, anchor| Cursor { sequence, is_exact, anchor };
        for delivered in [
            Delivered { cursor: cursor(u64::MAX, false, Some(last)), size: 2048, life: Life::from_name("0") },
            Delivered { cursor: cursor(0, true, None), size: 1, life: Some(Life::begin().unwrap()) },
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
        state.save(&delivered(7)).unwrap();
        let good = fs::read_to_string(&state.path).unwrap();
        let wrong = [
            String::new(),
            "{".to_string(),
            good[..good.len() / 2].to_string(),
            good.replace("\"version\":2", "\"version\":3"),
            good.replace("\"version\":2", "\"version\":1"),
            good.replace(":7", ":-7"),
            good.replace("\"life\":\"0\"", "\"life\":\"x\""),
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
        let text = state_in(&directory).save(&delivered(7)).unwrap_err().text();
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
