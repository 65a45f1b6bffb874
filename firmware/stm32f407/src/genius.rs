//! The Genius port: the node's, on the GENI board of the external bus.

use geni_board::WindowRam;
use ser_board::budget::PULSE_RING_LEN;
use ser_node::{GeniusDiagnostics, GeniusOptions, GeniusPort};
use ser_proto::Model;

use crate::app::BoardNode;
use crate::geni_bus::GeniBoard;

/// The port with its board.
pub(crate) struct Genius {
    port: GeniusPort<WindowRam>,
    board: GeniBoard,
}

impl Genius {
    pub(crate) fn new(board: GeniBoard, window: WindowRam, model: Model) -> Genius {
        Genius { port: GeniusPort::new(window, GeniusOptions::new(model)), board }
    }

    /// Hands the pulses of the interrupt line in, before the node records what came after them.
    pub(crate) fn take_pulses(&mut self, node: &mut BoardNode) {
        // No more than there is room for: a line that chatters must not keep the main loop.
        for _ in 0..PULSE_RING_LEN {
            let Some(tick_ms) = self.board.next_pulse() else { break };
            self.port.interrupt(node, tick_ms);
        }
    }

    /// Does what is due, when the node has been polled.
    pub(crate) fn poll(&mut self, node: &mut BoardNode) {
        // Again: a flag that is seen in this pass has had its pulse.
        self.take_pulses(node);
        self.port.poll(node);
        self.board.drive_reset(self.port.reset_held());
    }

    pub(crate) fn diagnostics(&self) -> GeniusDiagnostics {
        self.port.diagnostics()
    }
}
