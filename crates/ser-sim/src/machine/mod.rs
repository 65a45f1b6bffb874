//! What stands at the node's end of the line: the node in virtual time, or the emulated board.

pub(crate) mod native;
pub(crate) mod non_volatile;
pub(crate) mod pace;
pub(crate) mod sim_node;

#[cfg(unix)]
use std::os::fd::BorrowedFd;
use std::time::Duration;

use ser_proto::Baud;

use crate::contacts::player::Played;
use crate::contacts::scenario::Scenario;
use crate::contacts::scenario_lines::Item;
use crate::error::SimError;

/// A node that is to be served. Nothing here waits.
pub(crate) trait Machine {
    /// Lets it come up to the present.
    fn advance(&mut self) -> Result<(), SimError>;

    /// How many bytes it takes now.
    fn room(&self) -> usize;

    /// Gives it bytes from the line, no more than there is [`room`](Self::room) for.
    fn receive(&mut self, bytes: &[u8]);

    /// Bytes that it has sent at its present rate and that have not been taken.
    fn output(&mut self) -> &[u8];

    /// The first `count` bytes of the output have been taken.
    fn taken(&mut self, count: usize);

    /// The rate at which its line runs.
    fn baud(&self) -> Baud;

    /// Plays a scenario; says in which millisecond it begins.
    fn play(&mut self, scenario: &Scenario) -> u64;

    /// Plays what arrived on a stream; says by how much it was late.
    fn stream(&mut self, items: &[Item]) -> Option<u64>;

    /// How many steps of scenarios wait for their time.
    fn waiting_steps(&self) -> usize;

    /// Whether no contact is going to move.
    fn is_idle(&self) -> bool;

    /// What has moved since this was last asked.
    fn take_played(&mut self) -> Vec<Played>;

    /// By how much contacts have moved too late at most, since this was last asked.
    fn take_lateness_ms(&mut self) -> u64;

    /// How a host reaches the nodes on the Genius bus.
    fn bus_ports(&self) -> Vec<String> {
        Vec::new()
    }

    /// Sentences for the user about what is not as it should be, since this was last asked.
    fn take_complaints(&mut self) -> Vec<String> {
        Vec::new()
    }

    /// How long it may be left alone.
    fn patience(&self) -> Duration;

    /// Descriptors that become readable when it has something to send.
    #[cfg(unix)]
    fn descriptors(&self) -> Vec<BorrowedFd<'_>>;
}
