//! A contact scenario: which field contact opens or closes at which millisecond.
//!
//! In a file it is CSV under the header `ms,input,state`: milliseconds from the start, input number
//! from 1, and 1 for a contact that closes or 0 for one that opens. A file with any error is
//! refused as a whole, with the line and the reason, because a typing error would falsify the test
//! that plays the file.

use std::io::{ErrorKind, Read};

use ser_proto::Model;

use crate::contacts::scenario_error::{MAX_STEPS, ScenarioError, ScenarioFault};
use crate::contacts::scenario_lines::{Item, ScenarioLines, Scenarios};
use crate::contacts::step::Step;

/// Steps in the order of their times.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Scenario {
    steps: Vec<Step>,
    /// The node of each step. Empty when no nodes are named.
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

    /// The same, that much later.
    #[must_use]
    pub(crate) fn later(mut self, by_ms: u64) -> Scenario {
        for step in &mut self.steps {
            step.at_ms = step.at_ms.saturating_add(by_ms);
        }
        self
    }

    pub(crate) fn with_names(mut self, names: &[(u8, &'static str)]) -> Scenario {
        self.names = names.to_vec();
        self
    }

    /// Reads CSV. `name` is what errors call the file.
    ///
    /// Line ends may be LF or CR LF. A byte order mark, spaces around fields, lines that start with
    /// `#` and empty lines at the end are ignored. Times may repeat but not decrease, and an input
    /// may not be named twice in the same millisecond.
    ///
    /// # Errors
    /// The first line that is wrong, or the failure to read.
    pub fn from_csv(
        name: &str,
        reader: impl Read,
        model: Model,
    ) -> Result<Scenario, ScenarioError> {
        Scenario::read(ScenarioLines::new(name, model, Scenarios::One), reader)
    }

    /// Reads CSV for several nodes on a bus. Each line names one under the header
    /// `ms,input,state,node`. In a file without that column, the first node is meant.
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

    /// The steps of one node. Steps that name no node belong to the first one.
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
