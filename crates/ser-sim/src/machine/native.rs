//! The recorder itself as a machine: virtual time that keeps pace with real time.

#[cfg(unix)]
use std::os::fd::BorrowedFd;
use std::time::{Duration, Instant};

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
        // This thread may have been held up since time last passed, and a command counts from when
        // it arrives.
        self.node.advance_to(self.pace.now_ms());
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

    fn paced_rate(&self) -> Option<u32> {
        self.node.is_paced().then(|| self.node.baud().bits_per_second())
    }

    fn ms_until(&self, at: Instant) -> u64 {
        // Reckoned from the pace, so that no delay of this thread moves a contact.
        self.pace.ms_at(at).saturating_sub(self.node.now_ms())
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::sim_node::{LineRate, Ram, SimNode, SimNodeOptions};
    use ser_proto::Model;

    #[test]
    fn a_moment_is_a_millisecond_of_its_pace_however_late_it_is_asked_for() {
        let began = Instant::now();
        let mut ram = Ram::new();
        let node = SimNode::new(SimNodeOptions::new(Model::Ser160), &mut ram);
        let mut native = Native { node, pace: Pace::from(began, 0) };
        assert_eq!(native.ms_until(began + Duration::from_micros(250_999)), 250);
        native.node.advance_to(240);
        assert_eq!(native.ms_until(began + Duration::from_millis(250)), 10);
        assert_eq!(native.ms_until(began), 0);
    }

    #[test]
    fn bytes_from_the_host_take_as_long_as_those_to_it() {
        for (line_rate, rate) in [(LineRate::Real, Some(9600)), (LineRate::Unlimited, None)] {
            let mut ram = Ram::new();
            let options = SimNodeOptions { line_rate, ..SimNodeOptions::new(Model::Ser160) };
            let native = Native { node: SimNode::new(options, &mut ram), pace: Pace::new() };
            assert_eq!(native.paced_rate(), rate);
        }
    }
}
