//! What stands at the recorder's end of the line: the recorder in virtual time, or the emulated
//! board.

pub(crate) mod native;
pub(crate) mod non_volatile;
pub(crate) mod pace;
pub(crate) mod sim_node;

#[cfg(unix)]
use std::os::fd::BorrowedFd;
use std::time::{Duration, Instant};

use ser_proto::Baud;

use crate::contacts::player::Played;
use crate::contacts::scenario::Scenario;
use crate::contacts::scenario_lines::Item;
use crate::error::SimError;

/// A recorder that is served on a line. Nothing here waits.
pub(crate) trait Machine {
    /// Lets it catch up with the present.
    fn advance(&mut self) -> Result<(), SimError>;

    /// How many bytes it can take now.
    fn room(&self) -> usize;

    /// Gives it bytes from the line, at most [`room`](Self::room) of them.
    fn receive(&mut self, bytes: &[u8]);

    /// Bytes that it has sent at its present rate and that have not been taken.
    fn output(&mut self) -> &[u8];

    /// Says that the first `count` bytes of the output have been taken.
    fn taken(&mut self, count: usize);

    /// The rate at which its line runs.
    fn baud(&self) -> Baud;

    /// The rate that bytes from the host keep where the line itself has none, as behind a terminal
    /// server. `None` if they take no time.
    fn paced_rate(&self) -> Option<u32> {
        None
    }

    /// How many milliseconds of its own time are left until a moment of this computer's.
    fn ms_until(&self, at: Instant) -> u64 {
        let left = at.saturating_duration_since(Instant::now());
        u64::try_from(left.as_millis()).unwrap_or(u64::MAX)
    }

    /// Plays a scenario. Returns the millisecond in which it begins.
    fn play(&mut self, scenario: &Scenario) -> u64;

    /// Plays what arrived on a stream. Returns by how much it was late.
    fn stream(&mut self, items: &[Item]) -> Option<u64>;

    /// How many steps of scenarios wait for their time.
    fn waiting_steps(&self) -> usize;

    /// Whether no contact is going to move.
    fn is_idle(&self) -> bool;

    /// What has moved since this was last asked.
    fn take_played(&mut self) -> Vec<Played>;

    /// By how much the latest contact move came late since this was last asked.
    fn take_lateness_ms(&mut self) -> u64;

    /// How a host reaches the recorders on the Genius bus.
    fn bus_ports(&self) -> Vec<String> {
        Vec::new()
    }

    /// Sentences for the user about problems since this was last asked.
    fn take_complaints(&mut self) -> Vec<String> {
        Vec::new()
    }

    /// How long it may be left alone.
    fn patience(&self) -> Duration;

    /// Descriptors that become readable when it has something to send.
    #[cfg(unix)]
    fn descriptors(&self) -> Vec<BorrowedFd<'_>>;
}
