//! The Genius port: the node's, on the GENI board of the external bus.

use geni_board::WindowRam;
use ser_node::{GeniusDiagnostics, GeniusOptions, GeniusPort};
use ser_proto::Model;

use crate::app::BoardNode;
use crate::external_bus::GeniBoard;

/// The port with its board.
pub(crate) struct Genius {
    port: GeniusPort<WindowRam>,
    board: GeniBoard,
}

impl Genius {
    pub(crate) fn new(board: GeniBoard, window: WindowRam, model: Model) -> Genius {
        Genius { port: GeniusPort::new(window, GeniusOptions::new(model)), board }
    }

    /// Does what is due, when the node has been polled.
    pub(crate) fn poll(&mut self, node: &mut BoardNode) {
        self.port.poll(node);
        self.board.drive_reset(self.port.reset_held());
    }

    pub(crate) fn diagnostics(&self) -> GeniusDiagnostics {
        self.port.diagnostics()
    }
}
