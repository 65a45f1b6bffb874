//! The recorder's Genius port in the main loop, over the GENI board that a recorder's board is
//! wired to.

use geni_board::SharedRam;
use ser_node::{GeniusDiagnostics, GeniusOptions, GeniusPort, Node, Rtc, Storage};

use crate::budget::PULSE_RING_LEN;

/// The lines of a GENI board as the main loop sees them.
pub trait GeniBoard {
    /// The tick of the oldest pulse of the interrupt line that has not been fetched yet. A board
    /// that does not connect the line always returns `None`.
    fn next_pulse(&mut self) -> Option<u32>;

    /// Drives the reset line.
    fn drive_reset(&mut self, held: bool);
}

/// The port with its board.
pub struct Genius<W, B> {
    port: GeniusPort<W>,
    board: B,
}

impl<W: SharedRam, B: GeniBoard> Genius<W, B> {
    /// A port for the board whose shared RAM is behind `window`.
    pub fn new(board: B, window: W, options: GeniusOptions) -> Genius<W, B> {
        Genius { port: GeniusPort::new(window, options), board }
    }

    /// Hands in the pulses of the interrupt line. The node then holds back the changes after them.
    pub(crate) fn take_pulses<S: Storage, R: Rtc>(&mut self, node: &mut Node<'_, S, R>) {
        // Bounded by the ring's length: a chattering line must not keep the main loop busy.
        for _ in 0..PULSE_RING_LEN {
            let Some(tick_ms) = self.board.next_pulse() else { break };
            node.genius_interrupt(&mut self.port, tick_ms);
        }
    }

    /// Does what is due once the node has been polled.
    pub(crate) fn serve<S: Storage, R: Rtc>(&mut self, node: &mut Node<'_, S, R>) {
        // The pass may have taken long. A flag that is seen now must have had its pulse handed in.
        self.take_pulses(node);
        node.genius_poll(&mut self.port);
        self.board.drive_reset(self.port.reset_held());
    }

    /// Whether the board is started and configured.
    pub fn is_ready(&self) -> bool {
        self.port.is_ready()
    }

    /// What has been ignored, lost or repeated since power-up.
    pub fn diagnostics(&self) -> GeniusDiagnostics {
        self.port.diagnostics()
    }
}
