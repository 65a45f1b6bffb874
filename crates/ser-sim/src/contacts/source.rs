//! Where contact scenarios come from.

use std::fmt;
use std::fs::File;
use std::io::{self, ErrorKind, Read};
use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;

use ser_proto::Model;

use crate::contacts::scenario::Scenario;
use crate::contacts::scenario_error::{ScenarioError, ScenarioFault};
use crate::contacts::scenario_lines::{Item, ScenarioLines, Scenarios};
use crate::error::SimError;

/// What moves the contacts of a simulated recorder from its start on.
#[derive(Default)]
pub enum Contacts {
    /// Nothing; scenarios may be played later.
    #[default]
    None,
    /// A scenario, played as soon as the recorder answers.
    Scenario(Scenario),
    /// Scenarios that arrive while the recorder runs, with an empty line after each. Milliseconds
    /// count from the arrival of the scenario's first line, or from the end of the scenario before
    /// if that is later.
    Stream {
        /// What errors call the source.
        name: String,
        /// The source. Reading may block, because a thread of its own does it.
        source: Box<dyn Read + Send>,
    },
}

impl Contacts {
    /// Contacts from a path as a user gives it: `-` is standard input, anything else a file with
    /// one scenario.
    ///
    /// # Errors
    /// When the file cannot be opened or is wrong. An error on standard input shows only when the
    /// line arrives.
    pub fn from_path(path: &Path, model: Model) -> Result<Contacts, SimError> {
        if path == Path::new("-") {
            return Ok(Contacts::Stream {
                name: "standard input".to_owned(),
                source: Box::new(io::stdin()),
            });
        }
        let name = path.display().to_string();
        let file = File::open(path).map_err(SimError::io(format!("open {name}")))?;
        Ok(Contacts::Scenario(Scenario::from_csv(&name, file, model)?))
    }
}

impl Contacts {
    /// Contacts from a path for several nodes on a bus, which may be named in a fourth column.
    ///
    /// # Errors
    /// As for [`from_path`](Self::from_path).
    pub fn from_path_on_bus(path: &Path, nodes: &[(u8, Model)]) -> Result<Contacts, SimError> {
        let model = nodes.first().map_or(Model::Ser160, |&(_, model)| model);
        if path == Path::new("-") {
            return Contacts::from_path(path, model);
        }
        let name = path.display().to_string();
        let file = File::open(path).map_err(SimError::io(format!("open {name}")))?;
        Ok(Contacts::Scenario(Scenario::from_csv_on_bus(&name, file, nodes)?))
    }
}

impl fmt::Debug for Contacts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Contacts::None => write!(f, "None"),
            Contacts::Scenario(scenario) => f.debug_tuple("Scenario").field(scenario).finish(),
            Contacts::Stream { name, .. } => {
                f.debug_struct("Stream").field("name", name).finish_non_exhaustive()
            }
        }
    }
}

/// What one read from a stream brought. Lines that were written together stay together, so they
/// keep their milliseconds however late they are looked at.
pub(crate) type Arrived = Result<Vec<Item>, ScenarioError>;

/// How many reads from a stream may wait to be taken.
const MAX_ARRIVED: usize = 4;

/// Reads a stream in a thread of its own, as fast as its lines are taken. The channel closes at the
/// end of the stream and after an error.
pub(crate) fn read_stream(
    name: &str,
    source: Box<dyn Read + Send>,
    model: Model,
    nodes: &[(u8, Model)],
) -> Receiver<Arrived> {
    let (sender, receiver) = sync_channel(MAX_ARRIVED);
    let lines = ScenarioLines::new(name, model, Scenarios::Many).on_bus(nodes);
    // Nobody waits for this thread, because a read from a terminal cannot be cut short.
    thread::spawn(move || forward(lines, source, &sender));
    receiver
}

fn forward(
    mut lines: ScenarioLines,
    mut source: Box<dyn Read + Send>,
    sender: &SyncSender<Arrived>,
) {
    let mut chunk = [0; 65_536];
    loop {
        let mut items = Vec::new();
        let (result, more) = match source.read(&mut chunk) {
            Ok(0) => (lines.finish(&mut items), false),
            Ok(read) => (lines.push(&chunk[..read], &mut items), true),
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(error) => (Err(lines.fault(ScenarioFault::Unreadable(error.to_string()))), false),
        };
        let more = more && result.is_ok();
        if sender.send(result.map(|()| items)).is_err() || !more {
            return;
        }
    }
}
