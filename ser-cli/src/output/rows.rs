//! Standard output for whole rows.
//!
//! Rows are passed on at each flush, always whole ones. If a file takes only a part of them, as on
//! a full disk, that part is taken back. The file then ends with a whole row, and the next run,
//! which delivers the same events again, continues there. A file that nevertheless ends in the
//! middle of a row (after a power cut) first gets a line end.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};

/// How many bytes are searched for the first line of a file.
const FIRST_LINE: usize = 256;

/// Collects rows for standard output.
pub(crate) struct Rows {
    rows: Vec<u8>,
    file: Option<File>,
    /// Whether written bytes can be taken back.
    is_regular: bool,
}

/// How the file that is being continued begins and ends.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Before {
    first_line: Vec<u8>,
    ends_in_row: bool,
}

impl Rows {
    /// Rows for standard output; also returns whether the file behind it already begins with a
    /// header.
    pub(crate) fn to_stdout(is_header: &dyn Fn(&str) -> bool) -> (Rows, bool) {
        match stdout_file() {
            Ok(file) if is_regular(&file) => Rows::to_file(file, is_header, reopen_stdout),
            // The library treats a closed standard output as a good one. A Windows console needs
            // the library, because it wants other bytes.
            file => {
                let file = file.ok().filter(|_| cfg!(unix));
                (Rows { rows: Vec::new(), file, is_regular: false }, false)
            }
        }
    }

    fn to_file(
        file: File,
        is_header: &dyn Fn(&str) -> bool,
        reopen: fn(&File) -> io::Result<File>,
    ) -> (Rows, bool) {
        let is_empty = file.metadata().map_or(true, |metadata| metadata.len() == 0);
        if is_empty {
            return (Rows { rows: Vec::new(), file: Some(file), is_regular: true }, false);
        }
        // A file that cannot be inspected is assumed to be one of ours.
        let before = reopen(&file).and_then(look);
        let has_header = before.as_ref().map_or(true, |before| before.begins_with(is_header));
        let ends_in_row = before.is_ok_and(|before| before.ends_in_row);
        let rows = if ends_in_row { vec![b'\n'] } else { Vec::new() };
        (Rows { rows, file: Some(file), is_regular: true }, has_header)
    }

    fn pass_on(&mut self) -> io::Result<()> {
        let Some(file) = &mut self.file else {
            let mut out = io::stdout().lock();
            return out.write_all(&self.rows).and_then(|()| out.flush());
        };
        let mut written = 0;
        while let Some(rest) = self.rows.get(written..).filter(|rest| !rest.is_empty()) {
            match file.write(rest) {
                Ok(0) => return self.fail(written, io::ErrorKind::WriteZero.into()),
                Ok(count) => written += count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return self.fail(written, error),
            }
        }
        Ok(())
    }

    /// Takes back the written part of rows that did not all fit.
    fn fail(&mut self, written: usize, error: io::Error) -> io::Result<()> {
        match &mut self.file {
            Some(file) if self.is_regular => take_back(file, written, error),
            _ => Err(error),
        }
    }
}

impl Before {
    /// Whether the first line is a header, however spreadsheets and terminals have changed its form.
    fn begins_with(&self, is_header: &dyn Fn(&str) -> bool) -> bool {
        let text = String::from_utf8_lossy(&self.first_line);
        let plain = anstream::adapter::strip_str(&text).to_string();
        is_header(plain.trim_start_matches('\u{FEFF}').trim_end())
    }
}

impl Write for Rows {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.rows.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        if self.rows.is_empty() {
            return Ok(());
        }
        let passed_on = self.pass_on();
        // The next reading delivers again what could not be passed on.
        self.rows.clear();
        passed_on
    }
}

/// Cuts off the last bytes of a file if they are the ones just written, because others may write to
/// it, too.
fn take_back(file: &mut File, written: usize, error: io::Error) -> io::Result<()> {
    // The first error is reported. If the cut fails, the next run ends the broken row.
    let _ = cut_off(file, written as u64);
    Err(error)
}

fn cut_off(file: &mut File, written: u64) -> io::Result<()> {
    let end = file.stream_position()?;
    if written > 0 && file.metadata()?.len() == end {
        file.set_len(end.saturating_sub(written))?;
        file.seek(SeekFrom::Start(end.saturating_sub(written)))?;
    }
    Ok(())
}

fn look(mut file: File) -> io::Result<Before> {
    let mut first = Vec::new();
    Read::by_ref(&mut file).take(FIRST_LINE as u64).read_to_end(&mut first)?;
    let first_line = first.split(|&byte| byte == b'\n').next().unwrap_or_default().to_vec();
    file.seek(SeekFrom::End(-1))?;
    let mut last = [0];
    file.read_exact(&mut last)?;
    Ok(Before { first_line, ends_in_row: last != *b"\n" })
}

fn is_regular(file: &File) -> bool {
    file.metadata().is_ok_and(|metadata| metadata.is_file())
}

/// Makes sure that everything written to standard output is on the disk, if it is a file.
///
/// # Errors
/// When the disk did not accept the data.
pub(crate) fn sync_stdout() -> io::Result<()> {
    match stdout_file() {
        Ok(file) if is_regular(&file) => file.sync_data(),
        // Terminals and pipes cannot be synced, and need not be.
        _ => Ok(()),
    }
}

#[cfg(unix)]
fn stdout_file() -> io::Result<File> {
    use std::os::fd::AsFd;
    Ok(File::from(io::stdout().as_fd().try_clone_to_owned()?))
}

#[cfg(windows)]
fn stdout_file() -> io::Result<File> {
    use std::os::windows::io::AsHandle;
    Ok(File::from(io::stdout().as_handle().try_clone_to_owned()?))
}

#[cfg(not(any(unix, windows)))]
fn stdout_file() -> io::Result<File> {
    Err(io::ErrorKind::Unsupported.into())
}

/// Reopens the file behind standard output for reading, because a shell opens it for writing only.
#[cfg(target_os = "linux")]
fn reopen_stdout(file: &File) -> io::Result<File> {
    use std::os::fd::AsRawFd;
    File::open(format!("/proc/self/fd/{}", file.as_raw_fd()))
}

#[cfg(not(target_os = "linux"))]
fn reopen_stdout(_: &File) -> io::Result<File> {
    Err(io::ErrorKind::Unsupported.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::path::Path;

    const HEADER: &str = "entry,time";

    fn appending(path: &Path) -> (Rows, bool) {
        let file = File::options().append(true).create(true).open(path).unwrap();
        Rows::to_file(file, &|line| line == HEADER, |_| Err(io::ErrorKind::Unsupported.into()))
    }

    #[test]
    fn the_beginning_and_the_end_of_a_file_are_looked_at() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("events.csv");
        let look_at = |content: &[u8]| {
            fs::write(&path, content).unwrap();
            look(File::open(&path).unwrap()).unwrap()
        };
        let before =
            |first_line: &str, ends_in_row| Before { first_line: first_line.into(), ends_in_row };
        assert_eq!(look_at(b"entry,time\n1,2"), before(HEADER, true));
        assert_eq!(look_at(b"entry,time\n1,2\n"), before(HEADER, false));
        assert_eq!(look_at(b"\n"), before("", false));
        assert_eq!(look_at(&[b'x'; 1000]).first_line.len(), FIRST_LINE);
    }

    #[test]
    fn a_header_is_known_whatever_a_spreadsheet_or_a_terminal_has_made_of_it() {
        for line in
            ["entry,time", "entry,time\r", "\u{FEFF}entry,time\r", "\u{1B}[1mentry,time\u{1B}[0m"]
        {
            let before = Before { first_line: line.into(), ends_in_row: false };
            assert!(before.begins_with(&|line| line == HEADER), "{line:?}");
        }
        for line in ["", "entry", "entry,time,input", " entry,time"] {
            let before = Before { first_line: line.into(), ends_in_row: false };
            assert!(!before.begins_with(&|line| line == HEADER), "{line:?}");
        }
    }

    #[test]
    fn rows_are_appended_at_each_flush() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("events.csv");
        let (mut rows, has_header) = appending(&path);
        assert!(!has_header);
        rows.write_all(b"1,2\n").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"");
        rows.flush().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"1,2\n");
        // A file that cannot be inspected is assumed to be one of ours.
        assert!(appending(&path).1);
    }

    #[test]
    fn only_what_was_just_written_is_taken_back() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("events.csv");
        let mut file = File::options().append(true).create(true).open(&path).unwrap();
        file.write_all(b"1,2\n3,").unwrap();
        let full = || io::Error::from(io::ErrorKind::StorageFull);
        assert_eq!(take_back(&mut file, 2, full()).unwrap_err().kind(), io::ErrorKind::StorageFull);
        assert_eq!(fs::read(&path).unwrap(), b"1,2\n");
        file.write_all(b"3,").unwrap();
        // Another program has written in the meantime.
        File::options().append(true).open(&path).unwrap().write_all(b"theirs\n").unwrap();
        take_back(&mut file, 2, full()).unwrap_err();
        assert_eq!(fs::read(&path).unwrap(), b"1,2\n3,theirs\n");
    }
}
