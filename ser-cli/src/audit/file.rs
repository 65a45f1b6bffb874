//! The files of the audit: `audit.jsonl`, and `audit-1.jsonl` and so on, which were put aside.
//!
//! Nothing is ever taken out of them. When `audit.jsonl` has grown long it gets the next number and
//! a new one begins. Like all state they are ours alone: links are not followed, and a file that
//! holds anything else is left as it is. Only their user can read them.

use std::fs::{self, DirBuilder, File, OpenOptions};
use std::io::{self, BufReader, ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::PathBuf;

use crc::{CRC_64_XZ, Crc};
use ser_evidence::record::{Record, Told};
use ser_files::jsonl::{Reader, Writer};

use crate::appending;
use crate::output::PROGRAM;
use crate::state::open_ours;

/// From this length on, in bytes, the next record begins a new file: some ten thousand records.
const LONG: u64 = 4 << 20;

/// No file of ours is longer: that of the last record, whose texts are bounded.
const MAX_LEN: u64 = LONG + 65_536;

/// How many files are looked at.
const MAX_FILES: u32 = 100_000;

/// A file is known by its first two lines, and those by so many bytes: the second holds the clocks
/// of its first record.
const HEAD_LEN: u64 = 2_048;

/// The files in a state directory.
#[derive(Debug)]
pub(crate) struct AuditFile {
    directory: PathBuf,
}

/// How far the audit was read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Position {
    /// The checksum of the file's first two lines, whatever its name is now.
    file: u64,
    /// Bytes of it that were read.
    len: u64,
}

/// What was added behind a position.
#[derive(Debug, Default)]
pub(crate) struct Since {
    /// The records, oldest first.
    pub(crate) records: Vec<Told>,
    /// Where to go on.
    pub(crate) position: Option<Position>,
    /// Lines that cannot be read: the file, the number of the line from where reading began, and
    /// why.
    pub(crate) damaged: Vec<String>,
}

impl AuditFile {
    pub(super) const fn new(directory: PathBuf) -> AuditFile {
        AuditFile { directory }
    }

    /// The file that is written.
    pub(super) fn path(&self) -> PathBuf {
        self.directory.join("audit.jsonl")
    }

    fn numbered(&self, number: u32) -> PathBuf {
        self.directory.join(format!("audit-{number}.jsonl"))
    }

    /// Adds a record. It is on the disk when this returns.
    pub(super) fn append(&self, told: &Told) -> io::Result<()> {
        make_private(&self.directory)?;
        let path = self.path();
        let _lock = appending::lock(&path.with_extension("jsonl.lock"))?;
        let mut file = self.open_to_append()?;
        if file.metadata()?.len() >= LONG {
            // Another file of that name would be replaced, so the next number is one that none has.
            let number = self.last_number()?.saturating_add(1);
            fs::rename(&path, self.numbered(number))?;
            file = self.open_to_append()?;
        }
        check_ours(&mut file)?;
        let (is_new, mut text) = appending::before_the_next_line(&mut file)?;
        let mut writer = Writer::new(&mut text);
        if is_new {
            writer.file(PROGRAM)?;
        }
        writer.record(&told.recorder, &told.record)?;
        // In one piece, so that a crash leaves at most one line torn.
        file.write_all(&text)?;
        file.sync_data()
    }

    fn open_to_append(&self) -> io::Result<File> {
        let mut options = File::options();
        options.read(true).append(true).create(true);
        open_ours(&self.path(), private(&mut options))
    }

    /// The highest number that a file has; 0 without any.
    fn last_number(&self) -> io::Result<u32> {
        let numbers = self.numbers()?;
        Ok(numbers.last().copied().unwrap_or_default())
    }

    /// The numbers of the files that were put aside, in ascending order.
    fn numbers(&self) -> io::Result<Vec<u32>> {
        let entries = match fs::read_dir(&self.directory) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
            entries => entries?,
        };
        let mut numbers = Vec::new();
        for entry in entries {
            let name = entry?.file_name();
            let number = name.to_str().and_then(number_of);
            numbers.extend(number.filter(|&number| number <= MAX_FILES));
        }
        numbers.sort_unstable();
        Ok(numbers)
    }

    /// All files, oldest first.
    fn open_all(&self) -> io::Result<Vec<Listed>> {
        // No file is put aside meanwhile, between being looked for by its old name and its new one.
        let _lock = self.lock_to_read()?;
        let mut paths: Vec<PathBuf> =
            self.numbers()?.into_iter().map(|number| self.numbered(number)).collect();
        paths.push(self.path());
        let mut files = Vec::new();
        for path in paths {
            let mut file = match open_ours(&path, File::options().read(true)) {
                Err(error) if error.kind() == ErrorKind::NotFound => continue,
                file => file?,
            };
            let id = id_of(&mut file)?;
            files.push(Listed { path, file, id });
        }
        Ok(files)
    }

    /// `None` where nothing can be written, so that nobody does.
    fn lock_to_read(&self) -> io::Result<Option<File>> {
        use ErrorKind::{NotFound, PermissionDenied, ReadOnlyFilesystem};
        match appending::lock(&self.path().with_extension("jsonl.lock")) {
            Ok(lock) => Ok(Some(lock)),
            Err(error)
                if matches!(error.kind(), NotFound | PermissionDenied | ReadOnlyFilesystem) =>
            {
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }

    /// What was added behind a position.
    pub(super) fn since(&self, position: Option<Position>) -> io::Result<Since> {
        let mut files = self.open_all()?;
        let begin = position.and_then(|position| {
            let place = files.iter().position(|file| file.id == Some(position.file))?;
            Some((place, position.len))
        });
        let (first, mut from) = begin.unwrap_or_default();
        let mut since = Since { position, ..Since::default() };
        for file in files.iter_mut().skip(first) {
            file.read_from(from, &mut since)?;
            from = 0;
        }
        Ok(since)
    }
}

/// The number in a name such as `audit-7.jsonl`.
fn number_of(name: &str) -> Option<u32> {
    let digits = name.strip_prefix("audit-")?.strip_suffix(".jsonl")?;
    let number = digits.parse().ok()?;
    (number > 0 && format!("{number}") == digits).then_some(number)
}

/// A file of the audit.
struct Listed {
    path: PathBuf,
    file: File,
    /// Which one it is; `None` if it has no record yet.
    id: Option<u64>,
}

impl Listed {
    /// Takes the records in the whole lines from here on.
    fn read_from(&mut self, from: u64, since: &mut Since) -> io::Result<()> {
        let Some(id) = self.id else { return Ok(()) };
        let len = self.file.metadata()?.len();
        if len > MAX_LEN {
            return Err(not_ours(&format_args!("it is longer than {MAX_LEN} bytes")));
        }
        // Nothing is ever taken out of a file; one that is shorter was meddled with.
        let from = if from > len { 0 } else { from };
        self.file.seek(SeekFrom::Start(from))?;
        let mut text = Vec::new();
        (&self.file).take(MAX_LEN).read_to_end(&mut text)?;
        // A line without an end is still being written, or is torn and will get its end.
        let whole = text.iter().rposition(|&byte| byte == b'\n').map_or(0, |last| last + 1);
        text.truncate(whole);
        for told in Reader::new(BufReader::new(&text[..]), "") {
            match told {
                Ok(told @ Told { record: Record::Command(_), .. }) => since.records.push(told),
                // Nobody writes anything else here.
                Ok(_) => {}
                Err(error) if error.is_of_one_line() => {
                    let path = self.path.display();
                    let behind = if from > 0 { " of what is new" } else { "" };
                    since.damaged.push(format!("{path}: {error}{behind}"));
                }
                Err(error) => return Err(not_ours(&error)),
            }
        }
        let read = u64::try_from(text.len()).unwrap_or(u64::MAX);
        since.position = Some(Position { file: id, len: from.saturating_add(read) });
        Ok(())
    }
}

/// Which file this is; `None` if it does not hold two lines.
fn id_of(file: &mut File) -> io::Result<Option<u64>> {
    let mut head = Vec::new();
    file.seek(SeekFrom::Start(0))?;
    file.take(HEAD_LEN).read_to_end(&mut head)?;
    let mut ends = head.iter().enumerate().filter(|(_, byte)| **byte == b'\n');
    let (_, second) = (ends.next(), ends.next());
    // A long second line is known by its beginning.
    let end = match second {
        Some((end, _)) => end,
        None if u64::try_from(head.len()).is_ok_and(|len| len == HEAD_LEN) => head.len(),
        None => return Ok(None),
    };
    Ok(head.get(..end).map(|head| Crc::<u64>::new(&CRC_64_XZ).checksum(head)))
}

/// Refuses a file that does not begin as ours do.
fn check_ours(file: &mut File) -> io::Result<()> {
    if file.metadata()?.len() == 0 {
        return Ok(());
    }
    let mut head = Vec::new();
    file.seek(SeekFrom::Start(0))?;
    file.take(HEAD_LEN).read_to_end(&mut head)?;
    let line = head.split(|&byte| byte == b'\n').next().unwrap_or_default();
    let mut reader = Reader::new(line, "");
    match reader.read() {
        None if reader.program().is_some() => Ok(()),
        Some(Err(error)) => Err(not_ours(&error)),
        _ => Err(not_ours(&"it holds something else than an audit")),
    }
}

fn not_ours(why: &dyn std::fmt::Display) -> io::Error {
    io::Error::new(ErrorKind::InvalidData, why.to_string())
}

/// Only the user can read what is made by these.
fn private(options: &mut OpenOptions) -> &mut OpenOptions {
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt;
        options.mode(0o600);
    }
    options
}

fn make_private(directory: &std::path::Path) -> io::Result<()> {
    let mut builder = DirBuilder::new();
    builder.recursive(true);
    #[cfg(unix)]
    {
        use std::os::unix::fs::DirBuilderExt;
        builder.mode(0o700);
    }
    builder.create(directory)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use ser_evidence::record::Outcome;
    use ser_observer::Author;

    use super::*;

    fn audit_in(directory: &Path) -> AuditFile {
        AuditFile::new(directory.to_path_buf())
    }

    fn command(text: &str) -> Told {
        let author = Author::of_this_program(PROGRAM);
        let record = author.record("/dev/ttyUSB0", text.to_owned(), &ser_client::Outcome::Done);
        Told { recorder: "U1".to_owned(), record: Record::Command(record) }
    }

    fn commands(since: &Since) -> Vec<&str> {
        since
            .records
            .iter()
            .map(|told| match &told.record {
                Record::Command(command) => &*command.command,
                other => panic!("{other:?}"),
            })
            .collect()
    }

    /// As if so much had been written.
    fn make_long(audit: &AuditFile) {
        let text = fs::read(audit.path()).unwrap();
        let line = text.split_inclusive(|&byte| byte == b'\n').nth(1).unwrap();
        let times = usize::try_from(LONG).unwrap() / line.len() + 1;
        fs::write(audit.path(), [text.clone(), line.repeat(times)].concat()).unwrap();
    }

    #[test]
    fn a_position_goes_on_where_it_stood_and_nothing_comes_twice() {
        let directory = tempfile::tempdir().unwrap();
        let audit = audit_in(&directory.path().join("new"));
        let nothing = audit.since(None).unwrap();
        assert!(nothing.records.is_empty() && nothing.position.is_none());
        audit.append(&command("one")).unwrap();
        audit.append(&command("two")).unwrap();
        let since = audit.since(None).unwrap();
        assert_eq!(commands(&since), ["one", "two"]);
        assert!(audit.since(since.position).unwrap().records.is_empty());
        audit.append(&command("three")).unwrap();
        let since = audit.since(since.position).unwrap();
        assert_eq!(commands(&since), ["three"]);
        let Record::Command(three) = &since.records[0].record else { panic!() };
        assert_eq!(three.outcome, Outcome::Done);
    }

    #[test]
    fn a_long_file_is_put_aside_and_a_position_in_it_holds() {
        let directory = tempfile::tempdir().unwrap();
        let audit = audit_in(directory.path());
        audit.append(&command("one")).unwrap();
        let early = audit.since(None).unwrap().position;
        make_long(&audit);
        let late = audit.since(None).unwrap().position;
        for number in 2..5 {
            audit.append(&command(&format!("behind {number}"))).unwrap();
            make_long(&audit);
        }
        assert_eq!(audit.numbers().unwrap(), [1, 2, 3]);
        let behind = audit.since(late).unwrap();
        let first_of = |number| format!("behind {number}");
        let mut names: Vec<_> = commands(&behind);
        names.dedup();
        assert_eq!(names, [first_of(2), first_of(3), first_of(4)]);
        let all = audit.since(early).unwrap();
        assert!(commands(&all).contains(&"one"), "what was behind it in the first file");

        // Somebody takes the first files to another disk.
        fs::remove_file(audit.numbered(1)).unwrap();
        fs::remove_file(audit.numbered(2)).unwrap();
        assert!(audit.since(behind.position).unwrap().records.is_empty());
        let rest = audit.since(late).unwrap();
        assert_eq!(commands(&rest).first(), Some(&"behind 3"), "everything that is left");
        audit.append(&command("last")).unwrap();
        assert_eq!(audit.numbers().unwrap(), [3, 4], "a number is never used again");
    }

    #[test]
    fn a_torn_line_costs_itself_alone_and_is_told() {
        let directory = tempfile::tempdir().unwrap();
        let audit = audit_in(directory.path());
        audit.append(&command("one")).unwrap();
        audit.append(&command("two")).unwrap();
        let text = fs::read(audit.path()).unwrap();
        fs::write(audit.path(), &text[..text.len() - 20]).unwrap();
        let since = audit.since(None).unwrap();
        assert_eq!((commands(&since), since.damaged.len()), (vec!["one"], 0), "being written");
        audit.append(&command("three")).unwrap();
        let more = audit.since(since.position).unwrap();
        assert_eq!(commands(&more), ["three"]);
        let [damaged] = &more.damaged[..] else { panic!("{more:?}") };
        assert!(damaged.contains("audit.jsonl: line 1"), "{damaged}");
    }

    #[test]
    fn a_file_that_is_not_ours_is_left_as_it_is() {
        let directory = tempfile::tempdir().unwrap();
        let audit = audit_in(directory.path());
        for content in ["a letter", "a\nb\n", "{\"record\":\"file\",\"schema\":99}\n"] {
            fs::write(audit.path(), content).unwrap();
            assert!(audit.append(&command("one")).is_err(), "{content}");
            assert_eq!(fs::read_to_string(audit.path()).unwrap(), content);
        }
        File::create(audit.path()).unwrap().set_len(MAX_LEN + 1).unwrap();
        assert!(audit.since(None).is_err(), "nobody reads that much");
        fs::remove_file(audit.path()).unwrap();
        audit.append(&command("one")).unwrap();
        File::options().append(true).open(audit.path()).unwrap().set_len(MAX_LEN + 1).unwrap();
        assert!(audit.since(None).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn only_the_user_can_read_it_and_no_link_is_followed() {
        use std::os::unix::fs::PermissionsExt;
        let directory = tempfile::tempdir().unwrap();
        let folder = directory.path().join("state").join("ser-cli");
        let audit = audit_in(&folder);
        audit.append(&command("one")).unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
        assert_eq!((mode(&audit.path()), mode(&folder)), (0o600, 0o700));

        let victim = directory.path().join("victim");
        fs::rename(audit.path(), &victim).unwrap();
        let before = fs::read(&victim).unwrap();
        std::os::unix::fs::symlink(&victim, audit.path()).unwrap();
        assert!(audit.append(&command("two")).is_err());
        assert!(audit.since(None).is_err());
        assert_eq!(fs::read(&victim).unwrap(), before);
    }

    #[test]
    fn two_runs_at_once_lose_nothing() {
        let directory = tempfile::tempdir().unwrap();
        std::thread::scope(|scope| {
            for thread in 0..4 {
                let audit = audit_in(directory.path());
                scope.spawn(move || {
                    for number in 0..25 {
                        audit.append(&command(&format!("{thread} {number}"))).unwrap();
                    }
                });
            }
        });
        let since = audit_in(directory.path()).since(None).unwrap();
        assert_eq!((since.records.len(), since.damaged.len()), (100, 0));
    }
}
