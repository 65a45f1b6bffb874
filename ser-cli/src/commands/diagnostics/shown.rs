//! Counters as a table, as lines of what has grown, or as JSON for programs.

use std::fmt::Display;
use std::io::{self, Write};

use ser_console::Harmless;
use ser_proto::{Counter, CounterGroup, CounterWeight, Identity};
use serde_json::{Value, json};

use super::growth::{Growth, Look};
use crate::filter_text::count;
use crate::output::{Grid, Palette, Points};

/// How wide the meaning of a counter may be, in letters.
const MEANING_WIDTH: usize = 48;

/// Whose counters they are.
pub(super) struct Shown<'a> {
    pub(super) recorder: &'a str,
    pub(super) identity: &'a Identity,
    pub(super) points: &'a Points,
}

impl Shown<'_> {
    /// A table for each part of the recorder that counts.
    pub(super) fn write_table(
        &self,
        out: &mut dyn Write,
        counters: &[(Counter, u32)],
        palette: Palette,
    ) -> io::Result<()> {
        let mut gap = "";
        let groups = [
            CounterGroup::Recorder,
            CounterGroup::Genius,
            CounterGroup::Board,
            CounterGroup::Inputs,
            CounterGroup::Other,
        ];
        for group in groups {
            let of_group: Vec<_> =
                counters.iter().filter(|(counter, _)| counter.group() == group).collect();
            if of_group.is_empty() {
                continue;
            }
            write!(out, "{gap}")?;
            gap = "\n";
            let rows: Vec<Vec<String>> = of_group
                .iter()
                // Thirty-two zeros say no more than one line.
                .filter(|(_, value)| group != CounterGroup::Inputs || *value > 0)
                .flat_map(|(counter, value)| self.rows(*counter, *value))
                .collect();
            let title = title(group);
            if rows.is_empty() {
                writeln!(out, "{title}\nno input has chattered")?;
                continue;
            }
            let columns = vec!["counter", "   value", "what it counts"];
            Grid { title: Some(title.to_owned()), columns, rows }.write(out, palette)?;
        }
        Ok(())
    }

    /// A line for each counter that has grown.
    pub(super) fn write_growth(
        &self,
        out: &mut dyn Write,
        growth: &Growth,
        time: &dyn Display,
    ) -> io::Result<()> {
        for &(counter, by, value) in &growth.grown {
            let (by, value) = (count(by.into()), count(value.into()));
            writeln!(
                out,
                "{time}  {:<32}  {:>10}  to {value}",
                self.name(counter),
                format!("+{by}")
            )?;
        }
        Ok(())
    }

    /// All counters; with `growth`, also by how much each has grown since the look before.
    pub(super) fn to_json(&self, look: &Look, growth: Option<&Growth>) -> Value {
        let Identity { id, power_ups, .. } = self.identity;
        json!({
            "recorder": self.recorder,
            "id": id.map(|id| id.to_string()),
            "power_ups": power_ups,
            "on_for_us": look.tick_us,
            "began_anew": growth.map(|growth| growth.began_anew),
            "counters": counters_json(&look.counters, growth),
        })
    }

    /// The rows of a counter: its meaning may need several.
    fn rows(&self, counter: Counter, value: u32) -> Vec<Vec<String>> {
        let meaning = counter.meaning().unwrap_or("Not known to this version of ser-cli.");
        let lines = wrapped(meaning, MEANING_WIDTH);
        let value = format!("{:>8}", count(value.into()));
        let mut first = vec![self.name(counter), value];
        let mut rows = Vec::with_capacity(lines.len());
        for line in lines {
            let mut row = std::mem::replace(&mut first, vec![String::new(), String::new()]);
            row.push(line);
            rows.push(row);
        }
        rows
    }

    /// The counter's name; of an input, also what the site file calls it.
    fn name(&self, counter: Counter) -> String {
        let point = counter.suppressed_input().and_then(|input| self.points.name(input));
        match point {
            Some(point) => format!("{counter} ({})", Harmless(point).line()),
            None => counter.to_string(),
        }
    }
}

/// Counters for programs.
pub(in crate::commands) fn counters_json(
    counters: &[(Counter, u32)],
    growth: Option<&Growth>,
) -> Value {
    let counter = |&(counter, value): &(Counter, u32)| {
        json!({
            "id": counter.id(),
            "name": counter.to_string(),
            "input": counter.suppressed_input(),
            "value": value,
            "grown_by": growth.map(|growth| growth.of(counter)),
            "weight": counter.weight().map(weight),
            "meaning": counter.meaning(),
        })
    };
    counters.iter().map(counter).collect()
}

const fn title(group: CounterGroup) -> &'static str {
    match group {
        CounterGroup::Recorder => "Recorder and RS-232 port",
        CounterGroup::Genius => "Genius port",
        CounterGroup::Board => "GENI board",
        CounterGroup::Inputs => "Inputs",
        CounterGroup::Other => "Other",
    }
}

const fn weight(weight: CounterWeight) -> &'static str {
    match weight {
        CounterWeight::Ordinary => "ordinary",
        CounterWeight::Trouble => "trouble",
        CounterWeight::Lost => "lost",
    }
}

/// Words on lines of at most `width` letters; a longer word has a line of its own.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ') {
        match lines.last_mut() {
            Some(line) if line.len() + 1 + word.len() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use std::num::NonZeroU8;

    use ser_proto::{Capabilities, FirmwareVersion, Guard, Model};

    use super::*;
    use crate::output::testing::points;

    const IDENTITY: Identity = Identity {
        level: 1,
        model: Model::Ser160,
        firmware: FirmwareVersion { major: 1, minor: 2, patch: 3 },
        capabilities: Capabilities::DIAGNOSTICS,
        id: None,
        power_ups: 4,
        life: 9,
        log_capacity: 2048,
        guard: Guard::None,
    };

    fn look() -> Look {
        let later = Counter::from_id(NonZeroU8::MAX);
        let counters = vec![
            (Counter::EDGES_LOST, 1234),
            (Counter::BROADCASTS, 0),
            (Counter::suppressed(3).unwrap(), 7),
            (Counter::suppressed(4).unwrap(), 0),
            (later, 5),
        ];
        Look { counters, tick_us: Some(10) }
    }

    fn with<T>(test: impl FnOnce(&Shown<'_>) -> T) -> T {
        test(&Shown { recorder: "R", identity: &IDENTITY, points: &points() })
    }

    #[test]
    fn each_part_of_the_recorder_has_a_table() {
        let mut out = Vec::new();
        with(|shown| shown.write_table(&mut out, &look().counters, Palette::plain()).unwrap());
        assert_eq!(
            String::from_utf8(out).unwrap(),
            "Recorder and RS-232 port\n\
             counter        value  what it counts\n\
             edges_lost     1,234  Input changes that found the capture queue full.\n\
             \n\
             Genius port\n\
             counter        value  what it counts\n\
             broadcasts         0  Commands that came by broadcast and were carried\n                      \
             out.\n\
             \n\
             Inputs\n\
             counter                        value  what it counts\n\
             suppressed_3 (52-1 closed)         7  Changes of this input that were left out because\n                                      \
             it chattered.\n\
             \n\
             Other\n\
             counter         value  what it counts\n\
             counter 255         5  Not known to this version of ser-cli.\n"
        );
    }

    #[test]
    fn inputs_that_did_not_chatter_are_one_line() {
        let mut out = Vec::new();
        let counters: Vec<_> =
            (1..=32).filter_map(Counter::suppressed).map(|counter| (counter, 0)).collect();
        with(|shown| shown.write_table(&mut out, &counters, Palette::plain()).unwrap());
        assert_eq!(String::from_utf8(out).unwrap(), "Inputs\nno input has chattered\n");
    }

    #[test]
    fn what_grows_is_a_line() {
        let growth = Growth { began_anew: false, grown: vec![(Counter::EDGES_LOST, 3, 1237)] };
        let mut out = Vec::new();
        with(|shown| shown.write_growth(&mut out, &growth, &"10:00").unwrap());
        assert_eq!(
            String::from_utf8(out).unwrap(),
            "10:00  edges_lost                                +3  to 1,237\n"
        );
        let json = with(|shown| shown.to_json(&look(), Some(&growth)));
        assert_eq!(json["counters"][0]["grown_by"], 3);
        assert_eq!(json["counters"][1]["grown_by"], 0);
    }

    #[test]
    fn programs_get_ids_and_what_is_not_known_is_null() {
        let json = with(|shown| shown.to_json(&look(), None));
        assert_eq!((&json["recorder"], &json["id"]), (&json!("R"), &Value::Null));
        assert_eq!((&json["power_ups"], &json["on_for_us"]), (&json!(4), &json!(10)));
        assert_eq!(
            json["counters"][0],
            json!({
                "id": 11, "name": "edges_lost", "input": null, "value": 1234, "grown_by": null,
                "weight": "lost", "meaning": "Input changes that found the capture queue full.",
            })
        );
        assert_eq!(json["counters"][2]["input"], 3);
        assert_eq!(json["counters"][4]["name"], "counter 255");
        assert_eq!(json["counters"][4]["weight"], Value::Null);
    }
}
