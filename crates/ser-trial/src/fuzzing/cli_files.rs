//! Files that a user writes: contact scenarios.

use std::collections::BTreeSet;
use std::io::Read;

use ser_proto::Model;
use ser_sim::{Scenario, ScenarioError, ScenarioFault};

use super::dribble::Dribble;

/// What errors call the file.
const NAME: &str = "contacts.csv";

/// The nodes of the bus on which the file is tried as well.
const NODES: [(u8, Model); 2] = [(5, Model::Ser160), (9, Model::Ser320)];

/// `data` is the file. For both models, and for nodes on a bus:
///
/// - it is read or refused, always with the same result, however slowly it comes;
/// - an error names the file and one of its lines;
/// - steps are in order, only existing inputs move, none moves twice in a millisecond, and there
///   are no more steps than lines;
/// - steps that are written down again are read as the same steps.
///
/// # Panics
/// When one of these does not hold.
pub fn cli_files(data: &[u8]) {
    for model in [Model::Ser160, Model::Ser320] {
        let read = |source: &mut dyn Read| Scenario::from_csv(NAME, source, model);
        if let Some(scenario) = check(data, &read) {
            assert_in_order(&scenario, model);
            let written = read(&mut csv(&scenario).as_bytes());
            assert_eq!(
                written.map(|scenario| scenario.steps().to_vec()),
                Ok(scenario.steps().to_vec())
            );
        }
    }
    let read = |source: &mut dyn Read| Scenario::from_csv_on_bus(NAME, source, &NODES);
    if let Some(scenario) = check(data, &read) {
        let mut steps = 0;
        for (index, (node, model)) in NODES.into_iter().enumerate() {
            let own = scenario.for_node(node, index == 0);
            assert_in_order(&own, model);
            steps += own.steps().len();
        }
        assert_eq!(steps, scenario.steps().len(), "each step belongs to one node");
    }
}

type Reading<'a> = &'a dyn Fn(&mut dyn Read) -> Result<Scenario, ScenarioError>;

fn check(data: &[u8], read: Reading<'_>) -> Option<Scenario> {
    let lines = data.split(|&byte| byte == b'\n').count();
    let result = read(&mut &data[..]);
    assert_eq!(read(&mut Dribble { data }), result);
    match result {
        Ok(scenario) => {
            assert!(scenario.steps().len() < lines.max(1));
            Some(scenario)
        }
        Err(error) => {
            assert_eq!(error.file, NAME);
            // A missing header is reported after the last line.
            let places = lines as u64 + u64::from(error.reason == ScenarioFault::NoHeader);
            assert!((1..=places).contains(&error.line), "line {} of {lines}", error.line);
            assert!(error.to_string().starts_with(&format!("{NAME}, line {}: ", error.line)));
            None
        }
    }
}

fn assert_in_order(scenario: &Scenario, model: Model) {
    let steps = scenario.steps();
    assert!(steps.is_sorted_by_key(|step| step.at_ms));
    assert!(steps.iter().all(|step| (1..=model.inputs()).contains(&step.input)));
    let moves: BTreeSet<_> = steps.iter().map(|step| (step.at_ms, step.input)).collect();
    assert_eq!(moves.len(), steps.len(), "an input moves twice in a millisecond");
    assert_eq!(scenario.duration_ms(), steps.last().map_or(0, |step| step.at_ms));
}

fn csv(scenario: &Scenario) -> String {
    let mut text = String::from("ms,input,state\n");
    for step in scenario.steps() {
        text += &format!("{},{},{}\n", step.at_ms, step.input, u8::from(step.on));
    }
    text
}
