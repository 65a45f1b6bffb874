//! The lines of contact scenarios, taken from bytes as they come.
//!
//! A file holds one scenario. A stream holds any number: an empty line ends one, and the next
//! counts its milliseconds from zero again.

use std::collections::BTreeMap;
use std::mem;

use ser_proto::Model;

use crate::contacts::scenario_error::{ScenarioError, ScenarioFault};
use crate::contacts::step::Step;

/// No step comes near this length. A longer line is from some other kind of file.
const MAX_LINE_LEN: usize = 1024;

const HEADER: [&str; 3] = ["ms", "input", "state"];
const HEADER_ON_BUS: [&str; 4] = ["ms", "input", "state", "node"];

/// What a line says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Item {
    Step(Step),
    /// The contact of this node on the bus moves.
    NodeStep(u8, Step),
    /// The scenario is complete.
    End,
}

/// How many scenarios the source may hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scenarios {
    One,
    Many,
}

/// Turns bytes into steps, line by line.
pub(crate) struct ScenarioLines {
    name: String,
    model: Model,
    scenarios: Scenarios,
    /// The nodes on the bus. Empty when there is no bus.
    nodes: Vec<(u8, Model)>,
    /// Whether the header has a column for the node.
    names_nodes: bool,
    /// Number of the line being gathered, from 1.
    line: u64,
    gathered: Vec<u8>,
    expects: Expects,
    /// Time of the latest step of this scenario.
    latest_ms: u64,
    /// Inputs that have moved in that millisecond, by node.
    moved: BTreeMap<Option<u8>, u32>,
}

/// What the next line that is neither comment nor empty may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Expects {
    Header,
    HeaderOrStep,
    Step,
    /// An empty line has ended the only scenario.
    Nothing,
}

impl ScenarioLines {
    pub(crate) fn new(name: &str, model: Model, scenarios: Scenarios) -> ScenarioLines {
        ScenarioLines {
            name: name.to_owned(),
            model,
            scenarios,
            nodes: Vec::new(),
            names_nodes: false,
            line: 1,
            gathered: Vec::new(),
            expects: Expects::Header,
            latest_ms: 0,
            moved: BTreeMap::new(),
        }
    }

    /// Lets the lines name one of these nodes in a fourth column.
    pub(crate) fn on_bus(mut self, nodes: &[(u8, Model)]) -> ScenarioLines {
        self.nodes = nodes.to_vec();
        self
    }

    /// An error at the present line.
    pub(crate) fn fault(&self, reason: ScenarioFault) -> ScenarioError {
        ScenarioError { file: self.name.clone(), line: self.line, reason }
    }

    /// Takes bytes and adds what the lines completed by them say.
    pub(crate) fn push(
        &mut self,
        bytes: &[u8],
        items: &mut Vec<Item>,
    ) -> Result<(), ScenarioError> {
        for &byte in bytes {
            if byte == b'\n' {
                self.end_line(items)?;
            } else if self.gathered.len() < MAX_LINE_LEN {
                self.gathered.push(byte);
            } else {
                return Err(self.fault(ScenarioFault::LineTooLong));
            }
        }
        Ok(())
    }

    /// Ends the source: takes the last line, which may lack its line end, and ends the scenario.
    pub(crate) fn finish(&mut self, items: &mut Vec<Item>) -> Result<(), ScenarioError> {
        if !self.gathered.is_empty() {
            self.end_line(items)?;
        }
        if self.expects == Expects::Header && self.scenarios == Scenarios::One {
            return Err(self.fault(ScenarioFault::NoHeader));
        }
        items.push(Item::End);
        Ok(())
    }

    fn end_line(&mut self, items: &mut Vec<Item>) -> Result<(), ScenarioError> {
        let gathered = mem::take(&mut self.gathered);
        let text = str::from_utf8(&gathered).map_err(|_| self.fault(ScenarioFault::NotText))?;
        let text =
            if self.line == 1 { text.strip_prefix('\u{FEFF}').unwrap_or(text) } else { text };
        let item = self.line(text.trim()).map_err(|reason| self.fault(reason))?;
        items.extend(item);
        self.line += 1;
        Ok(())
    }

    fn line(&mut self, text: &str) -> Result<Option<Item>, ScenarioFault> {
        if text.starts_with('#') {
            return Ok(None);
        }
        if text.is_empty() {
            return Ok(self.empty_line());
        }
        let fields: Vec<&str> = text.split(',').map(str::trim).collect();
        match self.expects {
            Expects::Header | Expects::HeaderOrStep
                if fields == HEADER || fields == HEADER_ON_BUS =>
            {
                self.names_nodes = fields.len() == HEADER_ON_BUS.len();
                if self.names_nodes && self.nodes.is_empty() {
                    return Err(ScenarioFault::NoBus);
                }
                self.expects = Expects::Step;
                Ok(None)
            }
            Expects::Header => Err(ScenarioFault::NoHeader),
            Expects::Nothing => Err(ScenarioFault::EmptyLine),
            Expects::Step | Expects::HeaderOrStep => {
                self.expects = Expects::Step;
                self.item(&fields).map(Some)
            }
        }
    }

    fn empty_line(&mut self) -> Option<Item> {
        self.expects = match (self.expects, self.scenarios) {
            (Expects::Header, _) => return None,
            (_, Scenarios::One) => Expects::Nothing,
            (_, Scenarios::Many) => Expects::HeaderOrStep,
        };
        self.latest_ms = 0;
        self.moved.clear();
        Some(Item::End)
    }

    fn item(&mut self, fields: &[&str]) -> Result<Item, ScenarioFault> {
        match *fields {
            [at_ms, input, state] if !self.names_nodes => {
                self.step([at_ms, input, state], None, self.model).map(Item::Step)
            }
            [at_ms, input, state, node] if self.names_nodes => {
                let (node, model) = self.node(node)?;
                Ok(Item::NodeStep(node, self.step([at_ms, input, state], Some(node), model)?))
            }
            _ if self.names_nodes => Err(ScenarioFault::ColumnsOnBus(fields.len())),
            _ => Err(ScenarioFault::Columns(fields.len())),
        }
    }

    fn node(&self, text: &str) -> Result<(u8, Model), ScenarioFault> {
        let number = number(text).ok_or_else(|| ScenarioFault::NotANode(text.to_owned()))?;
        let found = self.nodes.iter().find(|(node, _)| u64::from(*node) == number);
        found.copied().ok_or(ScenarioFault::NoSuchNode { node: number })
    }

    fn step(
        &mut self,
        fields: [&str; 3],
        node: Option<u8>,
        model: Model,
    ) -> Result<Step, ScenarioFault> {
        let [at_ms, input, state] = fields;
        let at_ms = number(at_ms)
            .filter(|&at_ms| at_ms <= u64::from(u32::MAX))
            .ok_or_else(|| ScenarioFault::NotATime(at_ms.to_owned()))?;
        let input = number(input).ok_or_else(|| ScenarioFault::NotAnInput(input.to_owned()))?;
        let inputs = model.inputs();
        let input = u8::try_from(input)
            .ok()
            .filter(|input| (1..=inputs).contains(input))
            .ok_or(ScenarioFault::NoSuchInput { input, inputs })?;
        let on = match state {
            "0" => false,
            "1" => true,
            _ => return Err(ScenarioFault::NotAState(state.to_owned())),
        };
        if at_ms < self.latest_ms {
            return Err(ScenarioFault::TimeDecreases { at_ms, previous_ms: self.latest_ms });
        }
        if at_ms > self.latest_ms {
            self.latest_ms = at_ms;
            self.moved.clear();
        }
        let bit = 1 << (input - 1);
        let moved = self.moved.entry(node).or_default();
        if *moved & bit != 0 {
            return Err(ScenarioFault::Twice { input, at_ms });
        }
        *moved |= bit;
        Ok(Step { at_ms, input, on })
    }
}

/// Digits only: `u64::from_str` would take a plus sign as well.
fn number(text: &str) -> Option<u64> {
    if text.bytes().all(|byte| byte.is_ascii_digit()) { text.parse().ok() } else { None }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::contacts::scenario::Scenario;

    fn step(at_ms: u64, input: u8, on: bool) -> Step {
        Step { at_ms, input, on }
    }

    fn read(csv: &str) -> Result<Scenario, ScenarioError> {
        Scenario::from_csv("trip.csv", csv.as_bytes(), Model::Ser160)
    }

    /// The words for what is wrong with a file.
    fn refusal(csv: &str) -> String {
        read(csv).expect_err("this file is wrong").to_string()
    }

    #[test]
    fn a_file_gives_its_steps_in_order() {
        let scenario = read("ms,input,state\n0,1,1\n0,16,1\n250,1,0\n").unwrap();
        assert_eq!(scenario.steps(), [step(0, 1, true), step(0, 16, true), step(250, 1, false)]);
        assert_eq!(scenario.duration_ms(), 250);
    }

    #[test]
    fn windows_line_ends_byte_order_mark_comments_spaces_and_empty_lines_at_the_end_are_fine() {
        let csv = "\u{FEFF}# breaker 52\r\nms, input, state\r\n 5 , 2 , 1 \r\n# \
         reclose\r\n9,2,0\r\n\r\n\n# end\n";
        assert_eq!(read(csv).unwrap().steps(), [step(5, 2, true), step(9, 2, false)]);
        assert_eq!(read("ms,input,state\n7,3,1").unwrap().steps(), [step(7, 3, true)]);
        assert_eq!(read("ms,input,state\n").unwrap().steps(), []);
    }

    #[test]
    fn a_fourth_column_names_the_node() {
        let nodes = [(5, Model::Ser160), (9, Model::Ser320)];
        let read = |csv: &str| {
            let scenario = Scenario::from_csv_on_bus("trip.csv", csv.as_bytes(), &nodes);
            scenario.map_err(|error| error.to_string())
        };
        let scenario = read("ms,input,state,node\n0,1,1,5\n0,1,1,9\n7,32,1,9\n").unwrap();
        assert_eq!(scenario.steps(), [step(0, 1, true), step(0, 1, true), step(7, 32, true)]);
        assert_eq!(scenario.for_node(5, true).steps(), [step(0, 1, true)]);
        assert_eq!(scenario.for_node(9, false).steps(), [step(0, 1, true), step(7, 32, true)]);
        let scenario = read("ms,input,state\n0,1,1\n").unwrap();
        assert_eq!(scenario.for_node(5, true).steps(), [step(0, 1, true)]);
        assert_eq!(scenario.for_node(9, false).steps(), []);
        for (csv, expected) in [
            (
                "ms,input,state,node\n0,1,1\n",
                "line 2: 3 fields where four are needed (ms,input,state,node)",
            ),
            ("ms,input,state,node\n0,1,1,x\n", "line 2: \"x\" is not a node number"),
            ("ms,input,state,node\n0,1,1,6\n", "line 2: there is no node 6 on the bus"),
            (
                "ms,input,state,node\n0,17,1,5\n",
                "line 2: there is no input 17: this model has inputs 1 to 16",
            ),
            ("ms,input,state,node\n9,1,1,5\n9,1,0,5\n", "line 3: input 1 moves twice at 9 ms"),
        ] {
            let words = read(csv).unwrap_err();
            assert!(words.contains(expected), "{csv:?}: {words}");
        }
        assert!(refusal("ms,input,state,node\n").contains("line 1: only a Genius bus has nodes"));
    }

    #[test]
    fn each_mistake_is_named_with_its_line() {
        let long = format!("ms,input,state\n0,1,1\n{}\n", "0".repeat(2000));
        for (csv, expected) in [
            ("", "line 1: the first line must be the header ms,input,state"),
            ("# nothing\n", "line 2: the first line must be the header ms,input,state"),
            ("0,1,1\n", "line 1: the first line must be the header ms,input,state"),
            ("ms,input\n", "line 1: the first line must be the header ms,input,state"),
            ("ms,input,state,name\n", "line 1: the first line must be the header ms,input,state"),
            (
                "ms,input,state\n0,1,1\n0,1\n",
                "line 3: 2 fields where three are needed (ms,input,state)",
            ),
            ("ms,input,state\n0\n", "line 2: 1 field where three are needed (ms,input,state)"),
            (
                "ms,input,state\n0,1,1,x\n",
                "line 2: 4 fields where three are needed (ms,input,state)",
            ),
            (
                "ms,input,state\n1.5,1,1\n",
                "\"1.5\" is not a time: whole milliseconds from 0 to 4294967295 are",
            ),
            ("ms,input,state\n-1,1,1\n", "line 2: \"-1\" is not a time"),
            ("ms,input,state\n+1,1,1\n", "line 2: \"+1\" is not a time"),
            ("ms,input,state\n,1,1\n", "line 2: \"\" is not a time"),
            ("ms,input,state\n4294967296,1,1\n", "line 2: \"4294967296\" is not a time"),
            ("ms,input,state\n0,a,1\n", "line 2: \"a\" is not an input number"),
            (
                "ms,input,state\n0,0,1\n",
                "line 2: there is no input 0: this model has inputs 1 to 16",
            ),
            (
                "ms,input,state\n0,17,1\n",
                "line 2: there is no input 17: this model has inputs 1 to 16",
            ),
            ("ms,input,state\n0,257,1\n", "line 2: there is no input 257"),
            (
                "ms,input,state\n0,1,2\n",
                "line 2: \"2\" is not a state: 1 (closed) or 0 (open) is needed",
            ),
            ("ms,input,state\n0,1,on\n", "line 2: \"on\" is not a state"),
            (
                "ms,input,state\n9,1,1\n8,2,1\n",
                "line 3: 8 ms comes after 9 ms: times must not decrease",
            ),
            ("ms,input,state\n9,1,1\n9,2,1\n9,1,0\n", "line 4: input 1 moves twice at 9 ms"),
            ("ms,input,state\n9,1,1\n\n10,1,0\n", "line 4: empty line inside the scenario"),
            (&long, "line 3: the line is too long"),
        ] {
            let words = refusal(csv);
            assert!(
                words.starts_with("trip.csv, ") && words.contains(expected),
                "{csv:?}: {words}"
            );
        }
    }

    #[test]
    fn bytes_that_are_no_text_are_refused() {
        let csv = b"ms,input,state\n0,\xFF,1\n";
        let error = Scenario::from_csv("trip.csv", &csv[..], Model::Ser160).unwrap_err();
        assert_eq!(error.to_string(), "trip.csv, line 2: the line is not UTF-8 text");
    }

    #[test]
    fn a_file_without_end_is_given_up() {
        let endless = std::io::Read::chain(&b"ms,input,state\n"[..], Endless(0));
        let error = Scenario::from_csv("trip.csv", endless, Model::Ser160).unwrap_err();
        assert_eq!(error.reason, ScenarioFault::TooManySteps);
        let error = Scenario::from_csv("zero", std::io::repeat(0), Model::Ser160).unwrap_err();
        assert_eq!(error.reason, ScenarioFault::LineTooLong);
    }

    /// A source of steps without end.
    struct Endless(u32);

    impl std::io::Read for Endless {
        fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
            self.0 += 1;
            let line = format!("{},1,1\n", self.0);
            buffer[..line.len()].copy_from_slice(line.as_bytes());
            Ok(line.len())
        }
    }

    #[test]
    fn a_stream_holds_scenarios_between_empty_lines() {
        let stream = b"\n# two taps\nms,input,state\n5,1,1\n\n\n0,1,0\n\nms,input,state\n3,2,1";
        let mut lines = ScenarioLines::new("standard input", Model::Ser160, Scenarios::Many);
        let mut items = Vec::new();
        lines.push(stream, &mut items).unwrap();
        lines.finish(&mut items).unwrap();
        items.dedup();
        assert_eq!(
            items,
            [
                Item::Step(step(5, 1, true)),
                Item::End,
                Item::Step(step(0, 1, false)),
                Item::End,
                Item::Step(step(3, 2, true)),
                Item::End
            ]
        );
    }

    #[test]
    fn a_header_inside_a_scenario_is_refused() {
        assert!(
            refusal("ms,input,state\n0,1,1\nms,input,state\n")
                .contains("line 3: \"ms\" is not a time")
        );
    }

    proptest! {
        #[test]
        fn no_bytes_panic_and_every_cut_gives_the_same(
            bytes in proptest::collection::vec(prop_oneof![Just(b'\n'), Just(b','), b'0'..=b'3', any::<u8>()], 0..80),
            cut in 0..80_usize,
        ) {
            let stream = [b"ms,input,state\n".as_slice(), &bytes].concat();
            let whole = Scenario::from_csv("x", stream.as_slice(), Model::Ser320);
            let (first, second) = stream.split_at(cut.min(stream.len()));
            prop_assert_eq!(Scenario::from_csv("x", std::io::Read::chain(first, second), Model::Ser320), whole);
        }
    }
}
