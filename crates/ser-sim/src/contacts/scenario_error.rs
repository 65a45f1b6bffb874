//! What can be wrong in a file of contact moves, and where.

use std::fmt;

/// The most steps that a file may hold. The limit keeps a mistyped path from filling the memory.
pub const MAX_STEPS: usize = 1_000_000;

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
    /// The line has more or fewer than three fields.
    Columns(usize),
    /// The line has more or fewer than four fields where nodes are named.
    ColumnsOnBus(usize),
    /// Nodes are named and there is no bus.
    NoBus,
    /// The node is not a number.
    NotANode(String),
    /// There is no such node on the bus.
    NoSuchNode {
        /// The number given.
        node: u64,
    },
    /// The time is not a whole number of milliseconds, or is too large.
    NotATime(String),
    /// The input is not a number.
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
    /// The input already has a state in this millisecond.
    Twice {
        /// The input.
        input: u8,
        /// The millisecond.
        at_ms: u64,
    },
    /// An empty line stands before the end, although a file holds only one scenario.
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
            ScenarioFault::NoHeader => {
                write!(f, "the first line must be the header ms,input,state")
            }
            ScenarioFault::Columns(1) => {
                write!(f, "1 field where three are needed (ms,input,state)")
            }
            ScenarioFault::Columns(count) => {
                write!(f, "{count} fields where three are needed (ms,input,state)")
            }
            ScenarioFault::ColumnsOnBus(count) => {
                let plural = if *count == 1 { "" } else { "s" };
                write!(f, "{count} field{plural} where four are needed (ms,input,state,node)")
            }
            ScenarioFault::NoBus => {
                write!(f, "only a Genius bus has nodes: leave the fourth column out")
            }
            ScenarioFault::NotANode(text) => write!(f, "{text:?} is not a node number"),
            ScenarioFault::NoSuchNode { node } => write!(f, "there is no node {node} on the bus"),
            ScenarioFault::NotATime(text) => {
                write!(
                    f,
                    "{text:?} is not a time: whole milliseconds from 0 to {} are needed",
                    u32::MAX
                )
            }
            ScenarioFault::NotAnInput(text) => write!(f, "{text:?} is not an input number"),
            ScenarioFault::NoSuchInput { input, inputs } => {
                write!(f, "there is no input {input}: this model has inputs 1 to {inputs}")
            }
            ScenarioFault::NotAState(text) => {
                write!(f, "{text:?} is not a state: 1 (closed) or 0 (open) is needed")
            }
            ScenarioFault::TimeDecreases { at_ms, previous_ms } => {
                write!(f, "{at_ms} ms comes after {previous_ms} ms: times must not decrease")
            }
            ScenarioFault::Twice { input, at_ms } => {
                write!(f, "input {input} moves twice at {at_ms} ms")
            }
            ScenarioFault::EmptyLine => write!(f, "empty line inside the scenario"),
            ScenarioFault::LineTooLong => write!(f, "the line is too long"),
            ScenarioFault::NotText => write!(f, "the line is not UTF-8 text"),
            ScenarioFault::TooManySteps => write!(f, "more than {MAX_STEPS} steps"),
            ScenarioFault::Unreadable(error) => write!(f, "cannot be read: {error}"),
        }
    }
}
