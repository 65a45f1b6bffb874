//! Text lines for a printer on the RS-232 port: plain ASCII, ended by CR LF, never an ESC.
//!
//! ```text
//! 0001 2026-11-22 10:00:00.250  3 ON  17 OFF
//! *** 12 EVENTS NOT PRINTED ***
//! ```

use heapless::Vec;
use ser_proto::Inputs;

use crate::clock::to_time_stamp;
use crate::event_log::Event;

/// Entry number, date and time, 32 inputs with their new states, CR LF.
const MAX_LEN: usize = 4 + 1 + 23 + 32 * "  32 OFF".len() + 2;

/// One line, handed out byte by byte.
#[derive(Clone, Debug, Default)]
pub(crate) struct PrintLine {
    text: Vec<u8, MAX_LEN>,
    position: usize,
}

impl PrintLine {
    /// The line of an event.
    pub(crate) fn event(entry_number: u16, event: &Event) -> PrintLine {
        let time = to_time_stamp(event.time_ms);
        let mut line = PrintLine::default();
        line.number(entry_number.into(), 4);
        line.separated(b" ", time.full_year(), 4);
        line.separated(b"-", time.month, 2);
        line.separated(b"-", time.day, 2);
        line.separated(b" ", time.hour, 2);
        line.separated(b":", time.minute, 2);
        line.separated(b":", time.second, 2);
        line.separated(b".", time.millisecond, 3);
        for number in Inputs(event.changed).numbers() {
            line.separated(b"  ", number, 1);
            line.text(if Inputs(event.state).contains(number) { b" ON" } else { b" OFF" });
        }
        line.end()
    }

    /// The line that stands for something that can no longer be printed.
    pub(crate) fn lost(count: u32, what: &[u8]) -> PrintLine {
        let mut line = PrintLine::default();
        line.text(b"*** ");
        line.number(count, 1);
        line.text(b" ");
        line.text(what);
        line.text(b" ***");
        line.end()
    }

    fn end(mut self) -> PrintLine {
        self.text(b"\r\n");
        self
    }

    fn text(&mut self, text: &[u8]) {
        let fits = self.text.extend_from_slice(text).is_ok();
        debug_assert!(fits, "a line is longer than MAX_LEN");
    }

    fn separated(&mut self, separator: &[u8], value: impl Into<u32>, width: usize) {
        self.text(separator);
        self.number(value.into(), width);
    }

    /// Decimal digits, with leading zeros up to `width`.
    fn number(&mut self, mut value: u32, width: usize) {
        let mut digits = [b'0'; 10];
        let mut used = 0;
        for digit in digits.iter_mut().rev() {
            if value == 0 && used >= width.max(1) {
                break;
            }
            *digit += u8::try_from(value % 10).unwrap_or(0);
            value /= 10;
            used += 1;
        }
        self.text(digits.get(digits.len() - used..).unwrap_or_default());
    }
}

impl Iterator for PrintLine {
    type Item = u8;

    fn next(&mut self) -> Option<u8> {
        let byte = self.text.get(self.position).copied()?;
        self.position += 1;
        Some(byte)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(line: PrintLine) -> String {
        String::from_utf8(line.collect()).unwrap()
    }

    #[test]
    fn an_event_is_entry_number_time_and_what_each_input_did() {
        let event = Event { time_ms: 1_795_341_600_250, changed: 0x0001_0004, state: 0x0000_0004 };
        assert_eq!(
            text(PrintLine::event(1, &event)),
            "0001 2026-11-22 10:00:00.250  3 ON  17 OFF\r\n"
        );
    }

    #[test]
    fn the_longest_line_fits() {
        let event = Event { time_ms: 0, changed: u32::MAX, state: 0 };
        let line = text(PrintLine::event(2048, &event));
        assert!(line.starts_with("2048 1970-01-01 00:00:00.000  1 OFF  2 OFF"));
        assert!(line.ends_with("  32 OFF\r\n"));
    }

    #[test]
    fn numbers_have_all_their_digits() {
        assert_eq!(text(PrintLine::lost(0, b"X")), "*** 0 X ***\r\n");
        assert_eq!(text(PrintLine::lost(u32::MAX, b"X")), "*** 4294967295 X ***\r\n");
    }
}
