//! Every command that changes a recorder is archived: who sent it, what it was, and what came of
//! it.

use std::sync::{Arc, Mutex, PoisonError};

use ser_archive::Batch;
use ser_client::{Stage, Unit};
use ser_evidence::record::Record;
use ser_observer::{Author, host_reading};
use tracing::warn;

use super::{Shared, Task};

/// Records of commands that could not be archived at once.
#[derive(Clone, Debug, Default)]
pub(super) struct Unfiled(Arc<Mutex<Vec<Record>>>);

impl Unfiled {
    /// Takes what waits.
    pub(super) fn take(&self) -> Vec<Record> {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Lets records wait.
    pub(super) fn add(&self, records: Vec<Record>) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).extend(records);
    }
}

impl Task {
    /// Archives each command that is sent over this connection, before anybody sees what came of
    /// it.
    pub(super) fn audit(&self, unit: &mut Unit, unfiled: &Unfiled) {
        let author = Author::of_this_program(&self.shared.options.program);
        let (shared, unfiled) = (Arc::clone(&self.shared), unfiled.clone());
        let recorder = self.recorder.name.clone();
        let peer = self.recorder.port.clone().unwrap_or_default();
        unit.on_change(Box::new(move |change, stage| {
            // A collector that is told to stop ends the command first.
            let Stage::Ended(outcome) = stage else { return };
            let record = Record::Command(author.record(&peer, change.to_string(), outcome));
            if let Err(error) = file(&shared, &recorder, record.clone()) {
                warn!("{recorder}: a command is archived later: {error}");
                unfiled.add(vec![record]);
            }
        }));
    }
}

fn file(shared: &Shared, recorder: &str, record: Record) -> ser_archive::Result<()> {
    let now = host_reading::now().utc;
    let batch = Batch::of(shared.options.name.as_str(), recorder, vec![record], now);
    shared.writer.append(batch)?.wait().map(drop)
}
