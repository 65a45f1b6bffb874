//! The recorder's other port: datagrams and auto reports over a board that acts at once.

use std::collections::VecDeque;

use geni_board::Start;
use ser_node::{GeniusOptions, GeniusPort};
use ser_proto::genius::{FUNCTION_GENIUS, FUNCTION_HORNER, SUBFUNCTION_SER, Subfunction};
use ser_proto::{Entry, Model, Reply};
use ser_sim::SimNode;

use super::prompt_board::{Incoming, Outgoing, PromptBoard};

/// A port, its board, and what is still to come from it.
pub(super) struct Genius {
    port: GeniusPort<PromptBoard>,
    board: PromptBoard,
    /// Whether the board's interrupt line is connected.
    pub(super) has_line: bool,
    /// The reply that is awaited.
    pub(super) reply: Option<Outgoing>,
    /// Events that auto report owes.
    pub(super) owed: VecDeque<Entry>,
    /// How many datagrams were not for a recorder.
    ignored: u32,
}

impl Genius {
    pub(super) fn new(model: Model, has_line: bool) -> Genius {
        let board = PromptBoard::new();
        let options = GeniusOptions { start: Start::Running, ..GeniusOptions::new(model) };
        let port = GeniusPort::new(board.clone(), options);
        Genius { port, board, has_line, reply: None, owed: VecDeque::new(), ignored: 0 }
    }

    /// Lets the port work in the present millisecond. Reports are compared with the events that are
    /// owed to `report_address`; `is_overwritten` says which of these the ring has lost.
    pub(super) fn serve(
        &mut self,
        node: &mut SimNode<'_>,
        report_address: u8,
        is_overwritten: impl Fn(&Entry) -> bool,
    ) {
        node.serve(&mut self.port);
        while let Some(sent) = self.board.take_sent() {
            if self.reply.is_none() && self.awaits_no_reply(&sent) {
                self.compare(&sent, report_address, &is_overwritten);
            } else {
                assert_eq!(self.reply.replace(sent), None, "two replies");
            }
        }
    }

    /// Whether a datagram must be a report, because everything that was asked has been answered and
    /// events are owed.
    fn awaits_no_reply(&self, sent: &Outgoing) -> bool {
        !self.owed.is_empty() && matches!(Reply::parse(&sent.data), Ok(Reply::Read(_)))
    }

    fn compare(&mut self, sent: &Outgoing, address: u8, is_overwritten: &impl Fn(&Entry) -> bool) {
        let header = (sent.destination, sent.function, sent.subfunction);
        assert_eq!(header, (address, FUNCTION_HORNER, SUBFUNCTION_SER));
        let Ok(Reply::Read(report)) = Reply::parse(&sent.data) else {
            panic!("{sent:?} is not a report")
        };
        assert!(!report.entries.is_empty(), "an empty report");
        for entry in report.entries {
            let place =
                self.owed.iter().position(|owed| *owed == entry).expect("an event that is owed");
            // Later events overwrite earlier ones.
            assert!(
                self.owed.drain(..=place).rev().skip(1).all(|skipped| is_overwritten(&skipped)),
                "left out"
            );
        }
    }

    pub(super) fn bring_command(&mut self, source: u8, is_broadcast: bool, body: &[u8]) {
        let (function, subfunction) = (FUNCTION_HORNER, SUBFUNCTION_SER);
        self.board.bring(Incoming {
            source,
            is_broadcast,
            function,
            subfunction,
            data: body.to_vec(),
        });
    }

    /// The board pulls its interrupt line for what it has received.
    pub(super) fn pulse(&mut self, node: &mut SimNode<'_>) {
        if self.has_line {
            node.interrupt(&mut self.port, node.now_ms());
        }
    }

    /// Asks for one of the four force tables.
    pub(super) fn bring_read_io_forces(&mut self, source: u8, table: u8) {
        self.ignored += u32::from(table > 3);
        self.board.bring(Incoming {
            source,
            is_broadcast: false,
            function: FUNCTION_GENIUS,
            subfunction: Subfunction::ReadIoForces.code(),
            data: vec![table],
        });
    }

    pub(super) fn is_ready(&self) -> bool {
        self.port.is_ready()
    }

    /// The states of the inputs as the bus has them.
    pub(super) fn global_data(&self, model: Model) -> Vec<u8> {
        self.board.global_data(usize::from(model.inputs()) / 8)
    }

    pub(super) fn check_diagnostics(&self) {
        let diagnostics = self.port.diagnostics();
        assert_eq!(diagnostics.board.failures, 0);
        assert_eq!((diagnostics.replies_lost, diagnostics.reports_failed), (0, 0));
        assert_eq!(diagnostics.datagrams_ignored, self.ignored);
    }
}
