//! The fields of a row of CSV.

use crate::error::MAX_LINE_LEN;
use crate::error::quoted;

/// The most fields of a row that are told apart.
const MAX_FIELDS: usize = 64;

/// Takes rows apart.
pub(crate) struct Fields {
    core: csv_core::Reader,
    text: Vec<u8>,
    ends: [usize; MAX_FIELDS],
    count: usize,
    /// How many bytes are between the end of a field and the beginning of the next.
    separator: usize,
}

impl Fields {
    pub(crate) fn new() -> Fields {
        Fields {
            core: csv_core::Reader::new(),
            text: vec![0; MAX_LINE_LEN],
            ends: [0; MAX_FIELDS],
            count: 0,
            separator: 0,
        }
    }

    /// How many fields the row has.
    pub(crate) const fn count(&self) -> usize {
        self.count
    }

    /// A field of the row; empty if the row has fewer.
    pub(crate) fn field(&self, place: usize) -> &[u8] {
        let end = self.ends.get(place).copied().filter(|_| place < self.count).unwrap_or_default();
        let before = place.checked_sub(1).and_then(|before| self.ends.get(before));
        let start = before.map_or(0, |end| end + self.separator);
        self.text.get(start..end).unwrap_or_default()
    }

    /// Takes a line apart, in place of the one before.
    pub(crate) fn split(&mut self, line: &[u8]) -> Result<(), String> {
        // Most rows have no quotes, and a comma is a comma.
        match self.split_plain(line) {
            Some(()) => Ok(()),
            None => self.split_quoted(line),
        }
    }

    /// Takes a line apart that has nothing but commas between its fields.
    fn split_plain(&mut self, line: &[u8]) -> Option<()> {
        self.separator = 1;
        self.count = 0;
        for (place, byte) in line.iter().enumerate() {
            match byte {
                b',' => self.end(place)?,
                b'"' | b'\r' | b'\n' => return None,
                _ => {}
            }
        }
        self.end(line.len())?;
        self.text.get_mut(..line.len())?.copy_from_slice(line);
        Some(())
    }

    fn end(&mut self, place: usize) -> Option<()> {
        *self.ends.get_mut(self.count)? = place;
        self.count += 1;
        Some(())
    }

    fn split_quoted(&mut self, line: &[u8]) -> Result<(), String> {
        use csv_core::ReadRecordResult as Outcome;
        self.separator = 0;
        self.core.reset();
        self.count = 0;
        let mut filled = 0;
        for mut part in [line, b"\n"] {
            while !part.is_empty() {
                let text = self.text.get_mut(filled..).unwrap_or_default();
                let ends = self.ends.get_mut(self.count..).unwrap_or_default();
                let (outcome, taken, written, ended) = self.core.read_record(part, text, ends);
                part = part.get(taken..).unwrap_or_default();
                (filled, self.count) = (filled + written, self.count + ended);
                match outcome {
                    Outcome::Record => return Ok(()),
                    Outcome::InputEmpty => {}
                    Outcome::OutputFull | Outcome::OutputEndsFull | Outcome::End => {
                        return Err("this row has too many fields".to_owned());
                    }
                }
            }
        }
        Err(format!("a quote is not closed, in {}", quoted(line)))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn fields(split: impl Fn(&mut Fields) -> bool) -> Option<Vec<Vec<u8>>> {
        let mut fields = Fields::new();
        let is_split = split(&mut fields);
        let all = (0..=fields.count()).map(|place| fields.field(place).to_vec());
        is_split.then(|| all.collect())
    }

    proptest! {
        #[test]
        fn without_quotes_a_row_is_split_as_with_them(line in "[a-c, \t\u{e9}]{1,90}") {
            let line = line.as_bytes();
            let plain = fields(|fields| fields.split_plain(line).is_some());
            prop_assert_eq!(plain, fields(|fields| fields.split_quoted(line).is_ok()));
        }

        #[test]
        fn what_is_in_quotes_is_left_to_others(line in "[a,]{0,9}[\"\r\n][a,\"]{0,9}") {
            prop_assert_eq!(Fields::new().split_plain(line.as_bytes()), None);
        }
    }

    #[test]
    fn a_field_that_a_row_does_not_have_is_empty() {
        for line in [&b"a,b"[..], b"a,\"b\""] {
            let mut fields = Fields::new();
            fields.split(b"1,2,3,4").unwrap();
            fields.split(line).unwrap();
            assert_eq!([0, 1, 2, 3].map(|place| fields.field(place)), [&b"a"[..], b"b", b"", b""]);
            assert_eq!(fields.count(), 2);
        }
        assert!(Fields::new().split(&[b','; 64]).is_err());
    }
}
