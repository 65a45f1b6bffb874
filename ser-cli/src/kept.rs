//! What is known of a recorder's clock and of its lives, kept from run to run for a later report.
//!
//! A report wants to know what a clock showed when it was set, weeks before. The records are JSON
//! lines in a file beside the recorder's state file, and like that it is ours alone: links are not
//! followed, and a file that holds anything else is left as it is. When it has grown long, the
//! oldest records of routine readings are dropped, and far later those of settings.

use std::fmt;
use std::fs::{self, File};
use std::io::{self, BufReader, ErrorKind, Write};
use std::path::{Path, PathBuf};

use ser_evidence::record::{ClockObservation, How, Record};
use ser_files::Source;
use ser_files::jsonl::Writer;

use crate::appending;
use crate::connection::{self, ConnectionArgs};
use crate::error::{Result, advise, warn};
use crate::keeper::StateArgs;
use crate::output::PROGRAM;
use crate::state::{StateFile, open_ours, write_anew};
use crate::unit_name::UnitName;

/// With more records than this, the file is written anew.
const MAX_RECORDS: usize = 10_000;

/// How many records of settings and of lives stay then.
const IMPORTANT_KEPT: usize = 6_000;

/// How many records of routine readings stay then.
const ROUTINE_KEPT: usize = 2_000;

/// Far more than that many records are long.
const MAX_LEN: u64 = 32 << 20;

/// The records that are kept of one recorder.
#[derive(Debug)]
pub(crate) struct KeptRecords {
    path: PathBuf,
    /// Where records may be if the recorder had another name.
    others: Vec<PathBuf>,
    /// The recorder's name in the records.
    recorder: String,
}

/// From when on records are wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Since {
    Ever,
    LastReading,
}

impl KeptRecords {
    /// Those of the recorder of a connection.
    pub(crate) fn of(args: &StateArgs, connection: &ConnectionArgs) -> Result<KeptRecords> {
        let unit = connection::unit_name(connection)?;
        let recorder = connection::recorder_name(connection)?;
        KeptRecords::of_unit(&unit, recorder, args.directory())
    }

    /// Those of a recorder, in `directory` or in the system's place for state.
    pub(crate) fn of_unit(
        unit: &UnitName,
        recorder: String,
        directory: Option<&Path>,
    ) -> Result<KeptRecords> {
        let (path, others) = StateFile::of_unit(unit, directory)?.beside("jsonl");
        Ok(KeptRecords { path, others, recorder })
    }

    /// All records. A file that cannot be read is told and holds none.
    pub(crate) fn load(&self) -> Vec<Record> {
        let mut all = Vec::new();
        for path in std::iter::once(&self.path).chain(&self.others) {
            match read(path) {
                Ok(records) => all.extend(records),
                Err(error) => tell("read", path, &error),
            }
        }
        all
    }

    /// What was seen of the clock and of lives apart from routine readings: all of it, or what has
    /// come since somebody last read.
    pub(crate) fn settings(&self, since: Since) -> Vec<Record> {
        let all = self.load();
        let is_reading = |record: &Record| matches!(record, Record::Watched(_));
        let first = match since {
            Since::Ever => 0,
            Since::LastReading => all.iter().rposition(is_reading).map_or(0, |last| last + 1),
        };
        all.into_iter().skip(first).filter(|record| !is_routine(record)).collect()
    }

    /// Adds records. They are worth less than the command that they come from, so a failure is only
    /// told.
    pub(crate) fn add(&self, records: &[Record]) {
        if records.is_empty() {
            return;
        }
        if let Err(error) = self.try_add(records) {
            tell("write", &self.path, &error);
        }
    }

    fn try_add(&self, records: &[Record]) -> io::Result<()> {
        if let Some(directory) = self.path.parent() {
            fs::create_dir_all(directory)?;
        }
        let _lock = appending::lock(&self.path.with_extension("jsonl.lock"))?;
        let before = read(&self.path)?;
        if before.len() + records.len() > MAX_RECORDS {
            let mut all = before;
            all.extend_from_slice(records);
            let mut text = Vec::new();
            self.lines(true, &shortened(all), &mut text)?;
            return write_anew(&self.path, &text);
        }
        let mut file = open_ours(&self.path, File::options().read(true).append(true).create(true))?;
        let (is_new, mut text) = appending::before_the_next_line(&mut file)?;
        self.lines(is_new, records, &mut text)?;
        file.write_all(&text)
    }

    fn lines(&self, is_first: bool, records: &[Record], text: &mut Vec<u8>) -> io::Result<()> {
        let mut writer = Writer::new(text);
        if is_first {
            writer.file(PROGRAM)?;
        }
        records.iter().try_for_each(|record| writer.record(&self.recorder, record))
    }
}

fn tell(what: &str, path: &Path, error: &dyn fmt::Display) {
    warn(format_args!("cannot {what} {}: {error}", path.display()));
    advise("what the recorder's clock showed is not remembered for a later report");
}

/// The records in a file; none if there is no file. Damaged lines are passed over.
fn read(path: &Path) -> io::Result<Vec<Record>> {
    let file = match open_ours(path, File::options().read(true)) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        file => file?,
    };
    let not_ours = |why: &dyn fmt::Display| io::Error::new(ErrorKind::InvalidData, why.to_string());
    if file.metadata()?.len() > MAX_LEN {
        return Err(not_ours(&format_args!("it is longer than {MAX_LEN} bytes")));
    }
    let mut records = Vec::new();
    for told in Source::new(BufReader::new(file), "").map_err(|error| not_ours(&error))? {
        match told {
            Ok(told) => records.push(told.record),
            Err(error) if error.is_of_one_line() => {}
            Err(error) => return Err(not_ours(&error)),
        }
    }
    Ok(records)
}

/// Whether a reading makes such a record each time.
fn is_routine(record: &Record) -> bool {
    match record {
        Record::Clock(ClockObservation { how, .. }) => matches!(how, How::Event | How::Query),
        Record::Watched(_) | Record::Suppressed(_) | Record::Entry(_) | Record::Gap(_) => true,
        Record::Step(_)
        | Record::Life(_)
        | Record::Point(_)
        | Record::Recorder(_)
        | Record::Command(_)
        | Record::Note(_)
        | Record::Site(_) => false,
    }
}

/// The newest records, in their order.
fn shortened(mut records: Vec<Record>) -> Vec<Record> {
    let count =
        |routine: bool| records.iter().filter(|record| is_routine(record) == routine).count();
    let mut routine = count(true).saturating_sub(ROUTINE_KEPT);
    let mut important = count(false).saturating_sub(IMPORTANT_KEPT);
    records.retain(|record| {
        let too_many = if is_routine(record) { &mut routine } else { &mut important };
        let is_dropped = *too_many > 0;
        *too_many -= usize::from(is_dropped);
        !is_dropped
    });
    records
}

#[cfg(test)]
mod tests {
    use ser_evidence::record::{Life, LifeRecord, Watched};

    use super::*;
    use ser_observer::host_reading;

    fn kept_in(directory: &Path) -> KeptRecords {
        let name = |name: &str| UnitName {
            name: name.to_owned(),
            others: Vec::new(),
            aliases: Vec::new(),
        };
        KeptRecords::of_unit(&name("/dev/ttyUSB0"), "U1".to_owned(), Some(directory)).unwrap()
    }

    fn life(bits: u64) -> Record {
        let life = Life::from_bits(bits);
        Record::Life(LifeRecord { life, is_exact: true, model: None, size: None, erased: None })
    }

    fn watched(through: u64) -> Record {
        let now = host_reading::now();
        Record::Watched(Watched { life: Life::from_bits(1), from: now, to: now, through })
    }

    #[test]
    fn what_is_added_is_there_the_next_time() {
        let directory = tempfile::tempdir().unwrap();
        let folder = directory.path().join("new");
        assert!(kept_in(&folder).load().is_empty());
        kept_in(&folder).add(&[life(1)]);
        kept_in(&folder).add(&[life(2), life(3)]);
        assert_eq!(kept_in(&folder).load(), [life(1), life(2), life(3)]);
        let text = fs::read_to_string(&kept_in(&folder).path).unwrap();
        assert!(text.starts_with("{\"record\":\"file\","), "{text}");
        assert_eq!(text.matches("\"recorder\":\"U1\"").count(), 3);
    }

    #[test]
    fn what_a_reading_has_told_is_not_told_again() {
        let directory = tempfile::tempdir().unwrap();
        let kept = kept_in(directory.path());
        kept.add(&[life(1), watched(1), life(2)]);
        assert_eq!(kept.settings(Since::Ever), [life(1), life(2)]);
        assert_eq!(kept.settings(Since::LastReading), [life(2)]);
    }

    #[test]
    fn a_torn_line_costs_itself_alone() {
        let directory = tempfile::tempdir().unwrap();
        let kept = kept_in(directory.path());
        kept.add(&[life(1), life(2)]);
        let text = fs::read_to_string(&kept.path).unwrap();
        fs::write(&kept.path, &text[..text.len() - 20]).unwrap();
        kept.add(&[life(3)]);
        assert_eq!(kept.load(), [life(1), life(3)]);
    }

    #[test]
    fn a_file_that_is_not_ours_is_left_as_it_is() {
        let directory = tempfile::tempdir().unwrap();
        let kept = kept_in(directory.path());
        for content in ["a letter", "{\"record\":\"file\",\"schema\":99}\n"] {
            fs::write(&kept.path, content).unwrap();
            assert!(kept.try_add(&[life(1)]).is_err());
            assert!(kept.load().is_empty());
            assert_eq!(fs::read_to_string(&kept.path).unwrap(), content);
        }
        fs::File::create(&kept.path).unwrap().set_len(MAX_LEN + 1).unwrap();
        assert!(kept.try_add(&[life(1)]).is_err());
        #[cfg(unix)]
        {
            fs::remove_file(&kept.path).unwrap();
            let victim = directory.path().join("victim");
            fs::write(&victim, "").unwrap();
            std::os::unix::fs::symlink(&victim, &kept.path).unwrap();
            assert!(kept.try_add(&[life(1)]).is_err());
            assert_eq!(fs::read(&victim).unwrap(), b"");
        }
    }

    #[test]
    fn a_long_file_loses_its_oldest_records_and_settings_last() {
        let important = u64::try_from(IMPORTANT_KEPT).unwrap();
        let directory = tempfile::tempdir().unwrap();
        let kept = kept_in(directory.path());
        let routine: Vec<_> = (0..6_000).map(watched).collect();
        let settings: Vec<_> = (1..=important / 2).map(life).collect();
        kept.add(&settings);
        kept.add(&routine);
        assert_eq!(kept.load().len(), settings.len() + routine.len());
        let more: Vec<_> = (10_000..12_000).map(watched).collect();
        kept.add(&more);
        let left = kept.load();
        let (left, begin) = (&left, &settings[..]);
        assert!(left.starts_with(begin) && left.ends_with(&more), "{}", left.len());
        assert_eq!(left.len(), settings.len() + ROUTINE_KEPT);
        kept.add(&[watched(0)]);
        assert_eq!(kept.load().len(), settings.len() + ROUTINE_KEPT + 1, "appended again");
    }
}
