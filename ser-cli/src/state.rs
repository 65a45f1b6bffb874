//! What has been delivered already, kept in the user's state directory between two runs: one file
//! per recorder.
//!
//! A recorder that had another name before has its file under that name; the file moves when it is
//! written. Files are replaced as a whole, and only our own files are: links are not followed, and
//! other files are not read to their end.

use std::error::Error;
use std::fmt;
use std::fs::{self, File, TryLockError};
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

use crc::{CRC_64_XZ, Crc};
use ser_client::Cursor;
use ser_observer::LogIdentity;
use ser_proto::{Entry, Inputs, TimeStamp};
use serde::{Deserialize, Serialize};

use crate::error::{Failure, Result};
use crate::output::Life;
use crate::unit_name::UnitName;

/// The layout of the file. A change that old versions would misread gets the next number.
const VERSION: u32 = 2;

/// The layout without sequence and life. Its content is still valid.
const VERSION_WITHOUT_LIFE: u32 = 1;

/// A limit far above the length of our files.
const MAX_LEN: u64 = 65_536;

/// The longest name that file systems take, in bytes.
const MAX_NAME_LEN: usize = 255;

/// How much of an overlong name is kept for people to read.
const TELLING_LEN: usize = 100;

/// How far a recorder's log had been read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Delivered {
    /// The position after the last event that was delivered; `None` while there is only a name.
    pub cursor: Option<Cursor>,
    /// Entries that the log could hold then.
    pub size: u16,
    /// The life of the log; `None` in files from before lives had names.
    pub life: Option<Life>,
    /// The name of the next life, drawn before any of its events was delivered.
    pub next_life: Option<Life>,
    /// The last event of the previous log, if that was erased after everything in it had been
    /// delivered.
    pub erased: Option<Entry>,
    /// What the recorder said of the log; `None` if it says nothing, or the log may have begun anew
    /// since.
    pub log: Option<LogIdentity>,
}

/// A text that does not say what was delivered, and the reason.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NotDelivered(String);

impl fmt::Display for NotDelivered {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl Error for NotDelivered {}

impl Delivered {
    /// Reads a text written by [`to_text`](Self::to_text).
    ///
    /// # Errors
    /// When the text is damaged, or of another version.
    pub fn from_text(text: &[u8]) -> std::result::Result<Delivered, NotDelivered> {
        let content: Content =
            serde_json::from_slice(text).map_err(|error| NotDelivered(error.to_string()))?;
        let (sequence, life) = match content.version {
            VERSION_WITHOUT_LIFE => (content.total.map(u64::from), None),
            VERSION => (content.sequence, life_named(content.life.as_deref())?),
            version => return Err(NotDelivered(format!("version {version} is not {VERSION}"))),
        };
        if sequence.is_none() && content.next_life.is_none() && life.is_none() {
            return Err(NotDelivered("it has neither total nor sequence".to_owned()));
        }
        let next_life = life_named(content.next_life.as_deref())?;
        let is_exact = content.exact.unwrap_or(false);
        let anchor = content.last.map(Entry::from);
        let cursor = sequence.map(|sequence| Cursor { sequence, is_exact, anchor });
        Ok(Delivered {
            cursor,
            size: content.size,
            life,
            next_life,
            erased: content.erased.map(Entry::from),
            log: content.log,
        })
    }

    /// The content of the state file of this recorder.
    ///
    /// # Errors
    /// No error is known: JSON can express everything in here.
    pub fn to_text(&self, unit: &str) -> io::Result<String> {
        let Delivered { cursor, size, life, next_life, erased, log } = *self;
        let content = Content {
            version: VERSION,
            unit: unit.to_owned(),
            total: None,
            sequence: cursor.map(|cursor| cursor.sequence),
            exact: cursor.map(|cursor| cursor.is_exact),
            life: life.as_ref().map(Life::to_string),
            next_life: next_life.as_ref().map(Life::to_string),
            size,
            last: cursor.and_then(|cursor| cursor.anchor).as_ref().map(LastEntry::from),
            erased: erased.as_ref().map(LastEntry::from),
            log,
        };
        Ok(serde_json::to_string(&content)? + "\n")
    }
}

/// The file of one recorder.
#[derive(Debug)]
pub(crate) struct StateFile {
    path: PathBuf,
    unit: String,
    /// Where the file may be if the recorder had another name.
    others: Vec<PathBuf>,
    /// Which of these was loaded.
    moves_from: Option<PathBuf>,
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
    /// The recorder's name, for people who read the file.
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
    #[serde(default, skip_serializing_if = "Option::is_none")]
    next_life: Option<String>,
    size: u16,
    last: Option<LastEntry>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    erased: Option<LastEntry>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    log: Option<LogIdentity>,
}

fn life_named(name: Option<&str>) -> std::result::Result<Option<Life>, NotDelivered> {
    let Some(name) = name else { return Ok(None) };
    let life = Life::from_name(name);
    life.map(Some).ok_or_else(|| NotDelivered("it names no life of the log".to_owned()))
}

/// An entry, field by field, because its time need not be an existing date.
#[derive(Serialize, Deserialize)]
struct LastEntry {
    changed: u32,
    state: u32,
    /// Two-digit year, month, day, hour, minute, second.
    time: [u8; 6],
    millisecond: u16,
}

impl StateFile {
    /// The file for this recorder, in `directory` or in the system's place for state.
    pub(crate) fn of_unit(unit: &UnitName, directory: Option<&Path>) -> Result<StateFile> {
        let directory = self::directory(directory)?;
        let path = |name: &String| directory.join(file_name(name));
        let others: Vec<PathBuf> = unit.others.iter().map(path).collect();
        let is_there = |path: &PathBuf| path.symlink_metadata().is_ok();
        let own = path(&unit.name);
        // A file that is kept under another name in its own right stays there, with its lock.
        let alias = || unit.aliases.iter().map(path).find(is_there);
        let path = match is_there(&own) || others.iter().any(is_there) {
            true => own,
            false => alias().unwrap_or(own),
        };
        Ok(StateFile { path, unit: unit.name.clone(), others, moves_from: None })
    }

    /// A file of another kind beside it, and where that may be if the recorder had another name.
    pub(crate) fn beside(&self, extension: &str) -> (PathBuf, Vec<PathBuf>) {
        let beside = |path: &PathBuf| path.with_extension(extension);
        (beside(&self.path), self.others.iter().map(beside).collect())
    }

    /// Locks the file for this run alone.
    pub(crate) fn lock(&self) -> Result<StateLock> {
        // The state file itself is replaced whenever it is saved, so the lock is on a file that
        // stays.
        let path = self.path.with_extension("lock");
        let failed = |what: &str, path: &Path, error: io::Error| {
            Failure::new(format!("cannot {what} {}: {error}", path.display()))
                .hint("choose another directory with --state-dir DIR")
        };
        let cannot = |error| failed("lock", &path, error);
        if let Some(directory) = path.parent() {
            fs::create_dir_all(directory)
                .map_err(|error| failed("make the directory", directory, error))?;
        }
        let file = open_ours(&path, File::options().write(true).create(true).truncate(false))
            .map_err(cannot)?;
        match file.try_lock() {
            Ok(()) => Ok(StateLock { _file: file }),
            Err(TryLockError::WouldBlock) => Err(Failure::new(format!(
                "another ser-cli is reading what is new from {}",
                self.unit
            ))
            .hint("wait until it has ended, or end it: is a watch running?")
            .hint(
                "read --all needs no state; with --state-dir DIR a second reader gets \
             everything, too",
            )),
            Err(TryLockError::Error(error)) => Err(cannot(error)),
        }
    }

    /// What had been delivered; `None` when nothing has been yet.
    pub(crate) fn load(&mut self) -> Result<Option<Delivered>> {
        if let Some(delivered) = load_from(&self.path)? {
            return Ok(Some(delivered));
        }
        for other in &self.others {
            if let Some(delivered) = load_from(other)? {
                self.moves_from = Some(other.clone());
                return Ok(Some(delivered));
            }
        }
        Ok(None)
    }

    /// Remembers what has been delivered. After a crash the file holds either the old or the new
    /// content.
    pub(crate) fn save(&mut self, delivered: &Delivered) -> Result<()> {
        self.try_save(delivered).map_err(|error| {
            Failure::new(format!(
                "cannot remember in {} what was delivered: {error}",
                self.path.display()
            ))
            .hint("the next --new will deliver the same events again")
            .hint("choose another directory with --state-dir DIR")
        })
    }

    fn try_save(&mut self, delivered: &Delivered) -> io::Result<()> {
        let text = delivered.to_text(&self.unit)?;
        let directory = self.path.parent().unwrap_or(Path::new("."));
        fs::create_dir_all(directory)?;
        // The file may have been exchanged since it was loaded.
        if read_ours(&self.path)?.is_some_and(|found| Delivered::from_text(&found).is_err()) {
            return Err(io::Error::new(ErrorKind::AlreadyExists, "it has been replaced meanwhile"));
        }
        write_anew(&self.path, text.as_bytes())?;
        if let Some(other) =
            self.moves_from.take().filter(|other| matches!(load_from(other), Ok(Some(_))))
        {
            // If it were found again, it would be taken for another recorder's state.
            let _ = fs::remove_file(other);
        }
        Ok(())
    }
}

fn load_from(path: &Path) -> Result<Option<Delivered>> {
    let damaged = |why: &dyn fmt::Display| {
        Failure::new(format!("{} does not say what was delivered: {why}", path.display()))
            .hint("read --all delivers everything the recorder has and needs no state")
            .hint("move the file away to begin anew: the next --new then delivers everything")
    };
    let text = match read_ours(path) {
        Ok(text) => text,
        Err(error) if error.kind() == ErrorKind::InvalidData => return Err(damaged(&error)),
        Err(error) => return Err(Failure::reading(path.display(), &error)),
    };
    text.map(|text| Delivered::from_text(&text)).transpose().map_err(|why| damaged(&why))
}

/// Reads a file of at most our maximum length; nothing if there is none.
///
/// # Errors
/// `InvalidData` if it cannot be one of ours.
pub(crate) fn read_ours(path: &Path) -> io::Result<Option<Vec<u8>>> {
    let file = match open_ours(path, File::options().read(true)) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        file => file?,
    };
    let mut text = Vec::new();
    if file.take(MAX_LEN + 1).read_to_end(&mut text)? as u64 > MAX_LEN {
        return Err(io::Error::new(
            ErrorKind::InvalidData,
            format!("it is longer than {MAX_LEN} bytes"),
        ));
    }
    Ok(Some(text))
}

/// Replaces a file that is known to be ours as a whole.
pub(crate) fn write_anew(path: &Path, text: &[u8]) -> io::Result<()> {
    // Under an unpredictable name; removed if a later step fails.
    let mut temporary = temporary_file(path.parent().unwrap_or(Path::new(".")))?;
    temporary.write_all(text)?;
    temporary.as_file().sync_all()?;
    temporary.persist(path)?;
    Ok(())
}

/// Opens a plain file. Links are not followed, because their targets are not ours.
pub(crate) fn open_ours(path: &Path, options: &mut fs::OpenOptions) -> io::Result<File> {
    let no_file = || io::Error::new(ErrorKind::InvalidData, "it is a link, or not a plain file");
    match fs::symlink_metadata(path) {
        Ok(found) if !found.is_file() => return Err(no_file()),
        Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
        _ => {}
    }
    #[cfg(unix)]
    {
        use rustix::fs::OFlags;
        use std::os::unix::fs::OpenOptionsExt;
        // Something else may be put there between the check and the opening, even a pipe that waits
        // for its other end.
        options.custom_flags((OFlags::NOFOLLOW | OFlags::NONBLOCK).bits().cast_signed());
    }
    let file = options.open(path)?;
    if file.metadata()?.is_file() { Ok(file) } else { Err(no_file()) }
}

/// With the permissions that the user gives to new files.
fn temporary_file(directory: &Path) -> io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".ser-cli-").suffix(".tmp");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(directory)
}

/// The folder of all state: the one that is given, or the system's place for state.
pub(crate) fn directory(given: Option<&Path>) -> Result<PathBuf> {
    given.map_or_else(default_directory, |directory| Ok(directory.to_path_buf()))
}

fn default_directory() -> Result<PathBuf> {
    use etcetera::BaseStrategy;

    let strategy = etcetera::choose_base_strategy().map_err(|error| {
        Failure::new(error).hint("say with --state-dir DIR where to keep what was delivered")
    })?;
    let base = strategy.state_dir().unwrap_or_else(|| strategy.data_dir());
    Ok(base.join("ser-cli"))
}

/// A name that any file system accepts, that people can read, and that is different for every
/// recorder.
fn file_name(unit: &str) -> String {
    const SUFFIX: &str = ".json";
    // Windows takes COM3.json for the port itself.
    let mut name = String::from("port-");
    for byte in unit.bytes() {
        match byte {
            b'/' => name.push('_'),
            // `_` is taken.
            b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'.' => name.push(char::from(byte)),
            other => name.push_str(&format!("%{other:02X}")),
        }
    }
    if name.len() + SUFFIX.len() > MAX_NAME_LEN {
        let hash = Crc::<u64>::new(&CRC_64_XZ).checksum(unit.as_bytes());
        name.truncate(TELLING_LEN);
        // `+` is in no other name.
        name.push_str(&format!("+{hash:016X}"));
    }
    name + SUFFIX
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
            time: TimeStamp {
                year,
                month,
                day,
                hour,
                minute,
                second,
                millisecond: last.millisecond,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::testing::entry;

    fn of_unit(name: &str, others: &[&str], directory: &Path) -> StateFile {
        let others = others.iter().map(|&other| other.to_owned()).collect();
        StateFile::of_unit(
            &UnitName { name: name.to_owned(), others, aliases: Vec::new() },
            Some(directory),
        )
        .unwrap()
    }

    fn state_in(directory: &tempfile::TempDir) -> StateFile {
        of_unit("/dev/ttyUSB0", &[], &directory.path().join("new"))
    }

    fn delivered(sequence: u64) -> Delivered {
        let cursor = Cursor { sequence, is_exact: false, anchor: None };
        let life = Some(Life::UNKNOWN);
        Delivered {
            cursor: Some(cursor),
            size: 2048,
            life,
            next_life: None,
            erased: None,
            log: None,
        }
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
        let mut state = state_in(&directory);
        assert_eq!(state.load().unwrap(), None);
        let mut last = entry("00.250", &[3, 32], &[32]);
        last.time.month = 200;
        let cursor = |sequence, is_exact, anchor| Some(Cursor { sequence, is_exact, anchor });
        let drawn = || Some(ser_observer::new_life().unwrap());
        for delivered in [
            Delivered {
                cursor: cursor(u64::MAX, false, Some(last)),
                next_life: drawn(),
                ..delivered(0)
            },
            Delivered {
                cursor: cursor(0, true, None),
                size: 1,
                life: drawn(),
                erased: Some(last),
                ..delivered(0)
            },
            Delivered { cursor: None, life: drawn(), ..delivered(0) },
            Delivered {
                log: Some(LogIdentity { id: [255; 12], power_ups: u32::MAX, life: 1 }),
                ..delivered(7)
            },
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
        let mut state = state_in(&directory);
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
            assert!(text.contains("--all") && text.contains("move the file away"), "{text}");
        }
    }

    #[test]
    fn one_run_at_a_time_has_the_file() {
        let directory = tempfile::tempdir().unwrap();
        let lock = state_in(&directory).lock().unwrap();
        let text = state_in(&directory).lock().unwrap_err().text();
        assert!(text.contains("another ser-cli") && text.contains("/dev/ttyUSB0"), "{text}");
        of_unit("/dev/ttyUSB1", &[], directory.path()).lock().unwrap();
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
            (&"x".repeat(245), &format!("port-{}.json", "x".repeat(245))),
            (&"x".repeat(246), &format!("port-{}+D7B58F3AD0FF8BFB.json", "x".repeat(95))),
        ] {
            assert_eq!(file_name(port), name);
        }
        let long = ["/a", "/b"].map(|end| file_name(&("/\u{e4}".repeat(200) + end)));
        assert_ne!(long[0], long[1]);
    }

    #[test]
    fn a_unit_that_was_called_otherwise_is_known_and_moves() {
        let directory = tempfile::tempdir().unwrap();
        let (old, new) = ("tcp://127.0.0.1:4000", "tcp://localhost:4000");
        of_unit(old, &[], directory.path()).save(&delivered(7)).unwrap();
        let mut state = of_unit(new, &["tcp://[::1]:4000", old], directory.path());
        assert_eq!(state.load().unwrap(), Some(delivered(7)));
        assert_eq!(
            of_unit(old, &[], directory.path()).load().unwrap(),
            Some(delivered(7)),
            "not yet"
        );
        for total in [8, 9] {
            state.save(&delivered(total)).unwrap();
            assert_eq!(of_unit(old, &[], directory.path()).load().unwrap(), None);
            assert_eq!(
                of_unit(new, &[old], directory.path()).load().unwrap(),
                Some(delivered(total))
            );
        }
    }

    #[test]
    fn what_is_not_ours_is_neither_read_to_its_end_nor_replaced() {
        let directory = tempfile::tempdir().unwrap();
        let mut state = of_unit("/dev/ttyUSB0", &[], directory.path());
        let delivered = delivered(7);
        let endless = fs::File::create(&state.path).unwrap();
        endless.set_len(2 << 30).unwrap();
        let text = state.load().unwrap_err().text();
        assert!(
            text.contains("longer than 65536 bytes") && text.contains("move the file away"),
            "{text}"
        );
        assert!(state.save(&delivered).is_err());
        assert_eq!(endless.metadata().unwrap().len(), 2 << 30);

        fs::write(&state.path, "a letter").unwrap();
        let text = state.save(&delivered).unwrap_err().text();
        assert!(text.contains("has been replaced meanwhile"), "{text}");
        assert_eq!(fs::read_to_string(&state.path).unwrap(), "a letter");

        fs::remove_file(&state.path).unwrap();
        fs::create_dir(&state.path).unwrap();
        assert!(state.load().is_err() && state.save(&delivered).is_err());
        assert_eq!(
            fs::read_dir(directory.path()).unwrap().count(),
            1,
            "no temporary files are left"
        );
    }

    #[cfg(unix)]
    #[test]
    fn no_link_is_followed_and_no_pipe_waited_for() {
        use std::os::unix::fs::symlink;

        let directory = tempfile::tempdir().unwrap();
        let mut state = of_unit("/dev/ttyUSB0", &[], directory.path());
        let delivered = delivered(7);
        let victim = directory.path().join("victim");
        fs::write(&victim, delivered.to_text("/dev/ttyUSB0").unwrap()).unwrap();
        let lock = state.path.with_extension("lock");
        for path in [&state.path, &lock] {
            symlink(&victim, path).unwrap();
        }
        let before = fs::read(&victim).unwrap();
        for text in [
            state.load().unwrap_err().text(),
            state.save(&super::tests::delivered(8)).unwrap_err().text(),
            state.lock().unwrap_err().text(),
        ] {
            assert!(text.contains("it is a link"), "{text}");
        }
        assert_eq!(fs::read(&victim).unwrap(), before);
        assert!(state.path.is_symlink() && lock.is_symlink());
        // Planted under the former name of the temporary file.
        let former = state.path.with_extension("tmp");
        symlink(&victim, &former).unwrap();
        fs::remove_file(&state.path).unwrap();
        state.save(&delivered).unwrap();
        assert!(former.is_symlink() && !state.path.is_symlink());
        assert_eq!(fs::read(&victim).unwrap(), before);

        fs::remove_file(&state.path).unwrap();
        let made = std::process::Command::new("mkfifo").arg(&state.path).status().unwrap();
        assert!(made.success());
        assert!(state.load().is_err() && state.save(&delivered).is_err());
    }
}
