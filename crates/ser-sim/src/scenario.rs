//! A contact scenario: which field contact opens or closes at which millisecond.
//!
//! In a file it is CSV under the header `ms,input,state`: milliseconds from the start, input number from 1, and
//! 1 for a contact that closes or 0 for one that opens. A file that is wrong anywhere is refused whole, with the
//! line and the reason, because a typing error here would falsify the test that plays it.

use std::fmt;
use std::io::{ErrorKind, Read};

use ser_proto::Model;

use crate::scenario_lines::{Item, ScenarioLines, Scenarios};

/// The most steps that a file may hold: a mistyped path shall not fill the memory.
pub const MAX_STEPS: usize = 1_000_000;

/// One contact moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Step {
    /// When, in milliseconds from the start of the scenario.
    pub at_ms: u64,
    /// Which input, from 1.
    pub input: u8,
    /// Whether the contact closes.
    pub on: bool,
}

/// Steps in the order of their times.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Scenario {
    steps: Vec<Step>,
    /// The node of each step; empty when no nodes are named.
    nodes: Vec<u8>,
    names: Vec<(u8, &'static str)>,
}

impl Scenario {
    /// A scenario from steps in any order. Steps of the same millisecond stay in the order given.
    #[must_use]
    pub fn from_steps(steps: impl IntoIterator<Item = Step>) -> Scenario {
        let mut steps: Vec<Step> = steps.into_iter().collect();
        steps.sort_by_key(|step| step.at_ms);
        Scenario { steps, ..Scenario::default() }
    }

    pub(crate) fn with_names(mut self, names: &[(u8, &'static str)]) -> Scenario {
        self.names = names.to_vec();
        self
    }

    /// Reads CSV. `name` is what errors call the file.
    ///
    /// Line ends may be LF or CR LF, a byte order mark and spaces around fields are ignored, and so are lines that
    /// start with `#` and empty lines at the end. Times may repeat but not decrease, and an input may not be
    /// named twice in the same millisecond.
    ///
    /// # Errors
    /// The first line that is wrong, or the failure to read.
    pub fn from_csv(name: &str, reader: impl Read, model: Model) -> Result<Scenario, ScenarioError> {
        Scenario::read(ScenarioLines::new(name, model, Scenarios::One), reader)
    }

    /// The same for several nodes on a bus, the first of which is meant where none is named: under the header
    /// `ms,input,state,node` each line names one.
    ///
    /// # Errors
    /// As for [`from_csv`](Self::from_csv).
    pub fn from_csv_on_bus(
        name: &str,
        reader: impl Read,
        nodes: &[(u8, Model)],
    ) -> Result<Scenario, ScenarioError> {
        let model = nodes.first().map_or(Model::Ser160, |&(_, model)| model);
        Scenario::read(ScenarioLines::new(name, model, Scenarios::One).on_bus(nodes), reader)
    }

    fn read(mut lines: ScenarioLines, mut reader: impl Read) -> Result<Scenario, ScenarioError> {
        let mut items = Vec::new();
        let mut chunk = [0; 8192];
        loop {
            let read = match reader.read(&mut chunk) {
                Ok(0) => break,
                Ok(read) => read,
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) => return Err(lines.fault(ScenarioFault::Unreadable(error.to_string()))),
            };
            lines.push(&chunk[..read], &mut items)?;
            if items.len() > MAX_STEPS {
                return Err(lines.fault(ScenarioFault::TooManySteps));
            }
        }
        lines.finish(&mut items)?;
        let mut scenario = Scenario::default();
        for item in items {
            match item {
                Item::Step(step) => scenario.steps.push(step),
                Item::NodeStep(node, step) => {
                    scenario.steps.push(step);
                    scenario.nodes.push(node);
                }
                Item::End => {}
            }
        }
        Ok(scenario)
    }

    /// The steps of one node; those that name no node belong to the first one.
    #[must_use]
    pub fn for_node(&self, node: u8, is_first: bool) -> Scenario {
        let belongs = |index: usize| self.nodes.get(index).map_or(is_first, |&of| of == node);
        let steps = self.steps.iter().enumerate().filter(|&(index, _)| belongs(index));
        Scenario { steps: steps.map(|(_, &step)| step).collect(), ..Scenario::default() }
    }

    /// The steps, in the order of their times.
    #[must_use]
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// What the inputs stand for, where that is known.
    #[must_use]
    pub fn names(&self) -> Vec<(u8, &'static str)> {
        self.names.clone()
    }

    /// The time of the last step.
    #[must_use]
    pub fn duration_ms(&self) -> u64 {
        self.steps.last().map_or(0, |step| step.at_ms)
    }
}

/// Where a scenario is wrong and why.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ScenarioError {
    /// The name of the file, or what stands for it.
    pub file: String,
    /// The line, from 1.
    pub line: u64,
    /// What is wrong there.
    pub reason: ScenarioFault,
}

/// What can be wrong in a scenario.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ScenarioFault {
    /// The first line is something else.
    NoHeader,
    /// There are more or fewer than three fields.
    Columns(usize),
    /// There are more or fewer than four fields where nodes are named.
    ColumnsOnBus(usize),
    /// Nodes are named and there is no bus.
    NoBus,
    /// The node is no number.
    NotANode(String),
    /// There is no such node on the bus.
    NoSuchNode {
        /// The number given.
        node: u64,
    },
    /// The time is no whole number of milliseconds, or is too large.
    NotATime(String),
    /// The input is no number.
    NotAnInput(String),
    /// The model has no such input.
    NoSuchInput {
        /// The number given.
        input: u64,
        /// How many inputs the model has.
        inputs: u8,
    },
    /// The state is neither 0 nor 1.
    NotAState(String),
    /// The time lies before that of the line above.
    TimeDecreases {
        /// The time given.
        at_ms: u64,
        /// The time of the line above.
        previous_ms: u64,
    },
    /// The input has been given a state in this millisecond before.
    Twice {
        /// The input.
        input: u8,
        /// The millisecond.
        at_ms: u64,
    },
    /// An empty line stands before the end: a file holds one scenario.
    EmptyLine,
    /// The line has more bytes than any step needs.
    LineTooLong,
    /// The line is not UTF-8 text.
    NotText,
    /// The file has more steps than [`MAX_STEPS`].
    TooManySteps,
    /// Reading failed.
    Unreadable(String),
}

impl fmt::Display for ScenarioError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, line {}: {}", self.file, self.line, self.reason)
    }
}

impl std::error::Error for ScenarioError {}

impl fmt::Display for ScenarioFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ScenarioFault::NoHeader => write!(f, "the first line must be the header ms,input,state"),
            ScenarioFault::Columns(1) => write!(f, "1 field where three are needed (ms,input,state)"),
            ScenarioFault::Columns(count) => {
                write!(f, "{count} fields where three are needed (ms,input,state)")
            }
            ScenarioFault::ColumnsOnBus(count) => {
                let plural = if *count == 1 { "" } else { "s" };
                write!(f, "{count} field{plural} where four are needed (ms,input,state,node)")
            }
            ScenarioFault::NoBus => write!(f, "only a Genius bus has nodes: leave the fourth column out"),
            ScenarioFault::NotANode(text) => write!(f, "{text:?} is no node number"),
            ScenarioFault::NoSuchNode { node } => write!(f, "there is no node {node} on the bus"),
            ScenarioFault::NotATime(text) => {
                write!(f, "{text:?} is no time: whole milliseconds from 0 to {} are needed", u32::MAX)
            }
            ScenarioFault::NotAnInput(text) => write!(f, "{text:?} is no input number"),
            ScenarioFault::NoSuchInput { input, inputs } => {
                write!(f, "there is no input {input}: this model has inputs 1 to {inputs}")
            }
            ScenarioFault::NotAState(text) => {
                write!(f, "{text:?} is no state: 1 (closed) or 0 (open) is needed")
            }
            ScenarioFault::TimeDecreases { at_ms, previous_ms } => {
                write!(f, "{at_ms} ms comes after {previous_ms} ms: times must not decrease")
            }
            ScenarioFault::Twice { input, at_ms } => write!(f, "input {input} moves twice at {at_ms} ms"),
            ScenarioFault::EmptyLine => write!(f, "empty line inside the scenario"),
            ScenarioFault::LineTooLong => write!(f, "the line is too long"),
            ScenarioFault::NotText => write!(f, "the line is not UTF-8 text"),
            ScenarioFault::TooManySteps => write!(f, "more than {MAX_STEPS} steps"),
            ScenarioFault::Unreadable(error) => write!(f, "cannot be read: {error}"),
        }
    }
}
