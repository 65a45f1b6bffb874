//! The filters of a recorder as a table, or as JSON for programs.

use std::io::{self, Write};

use ser_console::Harmless;
use ser_proto::{ChatterFilter, Counter, InputFilter};
use serde_json::{Value, json};

use crate::filter_text::{chatter, count, debounce, numbers, time};
use crate::output::{Grid, Palette, Points};

/// What is known of all inputs, input 1 first.
pub(in crate::commands) struct Shown<'a> {
    pub(in crate::commands) recorder: &'a str,
    pub(in crate::commands) filters: &'a [InputFilter],
    pub(in crate::commands) points: &'a Points,
    /// The recorder's counters; none if it does not tell them.
    pub(in crate::commands) counters: &'a [(Counter, u32)],
}

impl Shown<'_> {
    /// Neighbours that are alike in everything that is shown share a row.
    pub(super) fn write_table(&self, out: &mut dyn Write, palette: Palette) -> io::Result<()> {
        let mut rows: Vec<(Vec<u8>, Vec<String>)> = Vec::new();
        for (input, filter) in self.inputs() {
            let cells = self.cells(input, filter);
            match rows.last_mut() {
                Some((inputs, alike)) if *alike == cells => inputs.push(input),
                _ => rows.push((vec![input], cells)),
            }
        }
        let columns =
            vec!["input", "name", "debounce", "chatter from", "re-arm", "left out since power-up"];
        let row = |(inputs, cells): (Vec<u8>, Vec<String>)| {
            std::iter::once(format!("{:>5}", numbers(&inputs))).chain(cells).collect()
        };
        let rows = rows.into_iter().map(row).collect();
        Grid { title: None, columns, rows }.write(out, palette)
    }

    /// What is shown of an input, besides its number.
    fn cells(&self, input: u8, filter: &InputFilter) -> Vec<String> {
        let name = self.points.name(input).map(|name| Harmless(name).line());
        let left_out = self.left_out(input).filter(|&left_out| left_out > 0);
        vec![
            name.unwrap_or_default(),
            debounce(filter),
            filter.chatter.as_ref().map_or("off".to_owned(), chatter),
            filter.chatter.map(|filter| time(filter.rearm_ms)).unwrap_or_default(),
            left_out.map(|left_out| count(left_out.into())).unwrap_or_default(),
        ]
    }

    pub(super) fn to_json(&self) -> Value {
        json!({ "recorder": self.recorder, "filters": self.filters_json() })
    }

    /// The filters, input 1 first.
    pub(in crate::commands) fn filters_json(&self) -> Value {
        let filter = |(input, filter): (u8, &InputFilter)| {
            json!({
                "input": input,
                "name": self.points.name(input),
                "debounce_ms": filter.debounce_ms,
                "chatter": filter.chatter.map(|ChatterFilter { changes, window_ms, rearm_ms }| {
                    json!({ "changes": changes, "window_ms": window_ms, "rearm_ms": rearm_ms })
                }),
                "left_out": self.left_out(input),
            })
        };
        self.inputs().map(filter).collect()
    }

    fn inputs(&self) -> impl Iterator<Item = (u8, &InputFilter)> {
        (1..=u8::MAX).zip(self.filters)
    }

    /// How many changes of an input were left out, if that is known.
    fn left_out(&self, input: u8) -> Option<u32> {
        let counter = Counter::suppressed(input)?;
        self.counters.iter().find(|(known, _)| *known == counter).map(|(_, value)| *value)
    }
}

#[cfg(test)]
mod tests {
    use std::num::NonZeroU8;

    use super::*;
    use crate::output::testing::points;

    fn with(test: impl FnOnce(&Shown<'_>)) {
        let changes = NonZeroU8::new(10).unwrap();
        let chatter = Some(ChatterFilter { changes, window_ms: 1000, rearm_ms: 2000 });
        let debounced = InputFilter { debounce_ms: 5, chatter: None };
        let chattering = InputFilter { debounce_ms: 5, chatter };
        let filters = [InputFilter::OFF, debounced, chattering, debounced, debounced, debounced];
        let counters = [(Counter::EDGES_LOST, 9), (Counter::suppressed(3).unwrap(), 1234)];
        let points = points();
        test(&Shown { recorder: "R", filters: &filters, points: &points, counters: &counters });
    }

    #[test]
    fn inputs_that_are_alike_share_a_row() {
        with(|shown| {
            let mut out = Vec::new();
            shown.write_table(&mut out, Palette::plain()).unwrap();
            assert_eq!(
                String::from_utf8(out).unwrap(),
                "input  name         debounce  chatter from       re-arm  left out since power-up\n    \
                 1               off       off\n    \
                 2               5 ms      off\n    \
                 3  52-1 closed  5 ms      10 changes in 1 s  2 s     1,234\n  \
                 4-6               5 ms      off\n"
            );
        });
    }

    #[test]
    fn programs_get_numbers_and_what_is_not_known_is_null() {
        with(|shown| {
            let json = shown.to_json();
            assert_eq!(json["recorder"], "R");
            assert_eq!(
                json["filters"][2],
                json!({
                    "input": 3, "name": "52-1 closed", "debounce_ms": 5, "left_out": 1234,
                    "chatter": { "changes": 10, "window_ms": 1000, "rearm_ms": 2000 },
                })
            );
            assert_eq!(json["filters"][0]["chatter"], Value::Null);
            assert_eq!(json["filters"][0]["left_out"], Value::Null);
        });
    }
}
