//! Lines of a file, one at a time and of a limited length.

use std::io::{self, BufRead, Read};

use crate::error::{NO_LINE_END, Problem, ReadError};

/// Takes a file apart.
pub(crate) struct Lines<R> {
    input: R,
    line: Vec<u8>,
    /// The longest line that is read, in bytes.
    longest: usize,
    number: u64,
    is_ended: bool,
}

impl<R: BufRead> Lines<R> {
    /// Takes `input` apart. A line without its end may be as long as `longest`, in bytes.
    pub(crate) fn new(input: R, longest: usize) -> Lines<R> {
        Lines { input, line: Vec::new(), longest, number: 0, is_ended: true }
    }

    /// The number of the line that was read last, from 1.
    pub(crate) const fn number(&self) -> u64 {
        self.number
    }

    /// The next line that is not empty, without its end; `None` at the end of the file.
    pub(crate) fn next(&mut self) -> Option<Result<&[u8], ReadError>> {
        loop {
            self.line.clear();
            self.number += 1;
            let limit = u64::try_from(self.longest).unwrap_or(u64::MAX).saturating_add(1);
            match Read::by_ref(&mut self.input).take(limit).read_until(b'\n', &mut self.line) {
                Ok(0) => return None,
                Ok(_) => {}
                Err(error) => return Some(Err(ReadError::at(self.number, Problem::Io(error)))),
            }
            self.is_ended = self.line.last() == Some(&b'\n');
            if self.line.len() > self.longest && !self.is_ended {
                return Some(Err(self.too_long()));
            }
            if !self.line.trim_ascii().is_empty() {
                return Some(Ok(without_end(&self.line)));
            }
        }
    }

    /// As [`next`](Self::next), where a line that has no end may be a part of one: that is an
    /// error.
    pub(crate) fn next_whole(&mut self) -> Option<Result<&[u8], ReadError>> {
        if let Err(error) = self.next()? {
            return Some(Err(error));
        }
        match self.is_ended {
            true => Some(Ok(without_end(&self.line))),
            false => Some(Err(ReadError::damaged(self.number, NO_LINE_END))),
        }
    }

    fn too_long(&mut self) -> ReadError {
        let problem = match skip_line(&mut self.input) {
            Ok(()) => Problem::TooLong { longest: self.longest },
            Err(error) => Problem::Io(error),
        };
        ReadError::at(self.number, problem)
    }
}

/// The line without its end, and without the mark that some programs put before the first line.
fn without_end(line: &[u8]) -> &[u8] {
    const BYTE_ORDER_MARK: &[u8] = b"\xEF\xBB\xBF";
    let line = line.strip_suffix(b"\n").unwrap_or(line);
    let line = line.strip_suffix(b"\r").unwrap_or(line);
    line.strip_prefix(BYTE_ORDER_MARK).unwrap_or(line)
}

/// Passes over the rest of a line without keeping it.
fn skip_line(input: &mut impl BufRead) -> io::Result<()> {
    loop {
        let waiting = match input.fill_buf() {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            waiting => waiting?,
        };
        let end = waiting.iter().position(|&byte| byte == b'\n');
        let len = end.map_or(waiting.len(), |end| end + 1);
        let is_end = end.is_some() || len == 0;
        input.consume(len);
        if is_end {
            return Ok(());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LONGEST: usize = 1000;

    fn all(text: &[u8]) -> Vec<(u64, Option<String>)> {
        let mut lines = Lines::new(text, LONGEST);
        let mut found = Vec::new();
        while let Some(line) = lines.next() {
            let line = line.ok().map(|line| String::from_utf8(line.to_vec()).unwrap());
            found.push((lines.number(), line));
        }
        found
    }

    fn line(number: u64, text: &str) -> (u64, Option<String>) {
        (number, Some(text.to_owned()))
    }

    #[test]
    fn lines_are_counted_and_empty_ones_are_none() {
        assert_eq!(all(b""), []);
        assert_eq!(all(b"\n\n"), []);
        assert_eq!(all(b"a\r\n\nb"), [line(1, "a"), line(3, "b")]);
        assert_eq!(all(b"\xEF\xBB\xBFa\n"), [line(1, "a")]);
    }

    #[test]
    fn of_an_overlong_line_nothing_is_kept_and_the_next_one_is_read() {
        let long = vec![b'x'; 3 * LONGEST];
        let text = [b"a\n", &long[..], b"\nb\n"].concat();
        assert_eq!(all(&text), [line(1, "a"), (2, None), line(3, "b")]);
        let longest = vec![b'x'; LONGEST];
        let read = all(&[&longest[..], b"\nb"].concat());
        assert_eq!(read[0].1.as_ref().map(String::len), Some(LONGEST));
        assert_eq!(read[1], line(2, "b"));
        assert_eq!(all(&long), [(1, None)]);
    }
}
