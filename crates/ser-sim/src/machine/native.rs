//! The recorder itself as a machine: virtual time that keeps pace with real time.

#[cfg(unix)]
use std::os::fd::BorrowedFd;
use std::time::Duration;

use ser_proto::Baud;

use crate::contacts::player::Played;
use crate::contacts::scenario::Scenario;
use crate::contacts::scenario_lines::Item;
use crate::error::SimError;
use crate::machine::Machine;
use crate::machine::pace::Pace;
use crate::machine::sim_node::SimNode;

/// How soon a recorder that is left alone notices that time has passed. Stamps do not depend on it,
/// only the delay until an event is reported.
const PATIENCE: Duration = Duration::from_millis(2);

/// A node and the pace of its time.
pub(crate) struct Native<'a> {
    pub(crate) node: SimNode<'a>,
    pub(crate) pace: Pace,
}

impl Machine for Native<'_> {
    fn advance(&mut self) -> Result<(), SimError> {
        self.node.advance_to(self.pace.now_ms());
        Ok(())
    }

    fn room(&self) -> usize {
        usize::MAX
    }

    fn receive(&mut self, bytes: &[u8]) {
        self.node.receive(bytes);
    }

    fn output(&mut self) -> &[u8] {
        self.node.output()
    }

    fn taken(&mut self, count: usize) {
        self.node.taken(count);
    }

    fn baud(&self) -> Baud {
        self.node.baud()
    }

    fn play(&mut self, scenario: &Scenario) -> u64 {
        self.node.play(scenario)
    }

    fn stream(&mut self, items: &[Item]) -> Option<u64> {
        self.node.stream(items)
    }

    fn waiting_steps(&self) -> usize {
        self.node.waiting_steps()
    }

    fn is_idle(&self) -> bool {
        self.node.is_idle()
    }

    fn take_played(&mut self) -> Vec<Played> {
        self.node.take_played()
    }

    fn take_lateness_ms(&mut self) -> u64 {
        // Virtual time waits for no host, and no host for it.
        0
    }

    fn patience(&self) -> Duration {
        PATIENCE
    }

    #[cfg(unix)]
    fn descriptors(&self) -> Vec<BorrowedFd<'_>> {
        Vec::new()
    }
}
