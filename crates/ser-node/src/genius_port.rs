//! The Genius port: datagrams in, datagrams out, and the state of all inputs in every bus scan,
//! through a GENI board.
//!
//! Commands come as datagrams 40h/50h, directed or by broadcast. Replies go to the sender of a
//! directed one. The port resets the board when it fails, and the board then joins the bus again.
//! RS-232 and recording are not affected.
//!
//! The port turns datagrams into commands and replies into datagrams. It knows neither what a
//! command means nor who waits for which reply. A [`Node`](crate::Node) carries from one to the
//! other.
//!
//! - **Time of arrival** is the tick at which the board raised its Receive-Queue flag. That is the
//!   tick of the pulse that was handed in ([`genius_interrupt`](crate::Node::genius_interrupt)) or,
//!   without the line, of the [`genius_poll`](crate::Node::genius_poll) that saw the flag. Clock,
//!   mode and Last Broadcast go by this tick, however long the board then takes to hand the
//!   datagram over. Changes after it wait for the datagram ([`HELD_BACK_MS`](crate::HELD_BACK_MS)).
//! - **Replies** are sent once. A host that misses one asks again, as on RS-232. A repeated reply
//!   might be taken for the answer to the next command.
//! - **Auto reports** are repeated, with growing pauses, until their receiver has acknowledged one.
//!   The pauses grow because an absent receiver would otherwise cost all other devices their place
//!   in the bus scan. A receiver may get a report twice when its acknowledgement was lost; total
//!   and next slot show that. All devices together have one datagram of normal priority per bus
//!   scan, and low bus addresses have the first chance. After each report the port therefore waits
//!   out the present scan and one scan for each other device.
//! - **Read I/O Forces** is answered with the recorder's own input tables. No input is forced, and
//!   the values are the states of the inputs. The recorder has no outputs, so the output tables are
//!   empty.
//! - **Requests for memory** are refused, because a recorder has no memory to read.

mod diagnostics;
mod options;
mod reporter;

use geni_board::{
    Completion, Data, Destination, DeviceChange, Driver, Event, MAX_DATA_LEN, ReceivedDatagram,
    SharedRam, Status, Transmission, TransmitPriority,
};
use heapless::Vec;
use ser_proto::genius::{
    FUNCTION_GENIUS, FUNCTION_HORNER, ForceTable, GlobalData, IoForces, SUBFUNCTION_SER,
    Subfunction,
};
use ser_proto::{Command, Inputs, Model, ReadReply, Reply};

use crate::arrival::{Arrival, Way};
use crate::diagnostics::count;

use reporter::Reporter;

pub use diagnostics::GeniusDiagnostics;
pub use options::GeniusOptions;

/// What the board reported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FromBus {
    /// A command.
    Arrived(Arrival),
    /// A device asks for a force table.
    ForcesAsked { device: u8, table: ForceTable },
    /// That many events from `first` on have reached their receiver.
    Reported { first: u64, entries: usize },
    /// The board has failed. Hosts that asked no longer expect an answer.
    Failed,
    /// Something that concerns the port alone.
    DealtWith,
}

/// The kind of datagram that the driver is sending.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum OnItsWay {
    Reply,
    Report,
}

/// The Genius port of a [`Node`](crate::Node), over the shared RAM of its GENI board.
///
/// In every pass of its main loop a board does four things, in this order: it hands in the pulses
/// of the interrupt line ([`Node::genius_interrupt`](crate::Node::genius_interrupt)), calls
/// [`Node::poll`](crate::Node::poll), calls [`Node::genius_poll`](crate::Node::genius_poll), and
/// drives the GENI board's reset line with [`reset_held`](Self::reset_held).
pub struct GeniusPort<W> {
    driver: Driver<W>,
    model: Model,
    on_its_way: Option<OnItsWay>,
    reporter: Reporter,
    /// Devices that are logged in, bus address 0 in bit 0.
    others: u32,
    diagnostics: GeniusDiagnostics,
}

impl<W: SharedRam> GeniusPort<W> {
    /// A port whose board is behind `window`. Nothing is read or written before the port is polled.
    pub fn new(window: W, options: GeniusOptions) -> GeniusPort<W> {
        GeniusPort {
            driver: Driver::new(window, options.driver_options()),
            model: options.model,
            on_its_way: None,
            reporter: Reporter::new(),
            others: 0,
            diagnostics: GeniusDiagnostics::default(),
        }
    }

    /// Whether the board's reset line must be held low until the next poll.
    pub fn reset_held(&self) -> bool {
        self.driver.reset_held()
    }

    /// The shared RAM.
    pub fn window(&mut self) -> &mut W {
        self.driver.ram_mut()
    }

    /// Whether the board is started and configured. Its [`status`](Self::status) says whether it
    /// has its turns on the bus.
    pub fn is_ready(&self) -> bool {
        self.driver.is_ready()
    }

    /// The board's status table as last read; `None` if it has not been read since the board
    /// started.
    pub fn status(&self) -> Option<Status> {
        self.driver.status()
    }

    /// What has been ignored, lost or repeated since power-up.
    pub fn diagnostics(&self) -> GeniusDiagnostics {
        GeniusDiagnostics { board: self.driver.counters(), ..self.diagnostics }
    }

    /// Says that the board's interrupt line was pulsed at `tick_ms`.
    pub(crate) fn interrupt(&mut self, tick_ms: u32) {
        self.driver.interrupt(tick_ms);
    }

    /// When the oldest datagram that waits to be read arrived.
    pub(crate) fn oldest_arrival_ms(&self) -> Option<u32> {
        self.driver.oldest_arrival_ms()
    }

    /// Shows the state of all inputs in every bus scan.
    pub(crate) fn show(&mut self, inputs: Inputs) {
        let global = GlobalData { model: self.model, state: inputs }.to_bytes();
        // Never refused: the length follows from the model, and so did the configured one.
        let _ = self.driver.set_global_data(&global);
    }

    /// The next event of the board, if any.
    pub(crate) fn poll(&mut self, now_ms: u32) -> Option<FromBus> {
        Some(match self.driver.poll(now_ms)? {
            Event::Received(datagram) => self.receive(&datagram, now_ms),
            Event::Sent(result) => self.sent(result.is_ok(), now_ms),
            Event::Failed(failure) => {
                self.diagnostics.last_failure = Some(failure);
                self.others = 0;
                FromBus::Failed
            }
            Event::Ready(_) => {
                self.reporter.hurry();
                FromBus::DealtWith
            }
            Event::Device { number, change } => {
                match change {
                    DeviceChange::LoggedOut => self.others &= !bit(number),
                    _ => self.others |= bit(number),
                }
                FromBus::DealtWith
            }
            // The driver remembers or has handled these, or the port never asks for them.
            Event::Configured(_)
            | Event::StatusChanged(_)
            | Event::RequestRefused(_)
            | Event::Request(_)
            | Event::Replied(_)
            | Event::TablesLocked
            | Event::OutputsSent => FromBus::DealtWith,
        })
    }

    /// Whether a datagram can be sent now.
    pub(crate) fn can_send(&self) -> bool {
        self.on_its_way.is_none() && self.driver.can_transmit()
    }

    /// Sends a reply to the device that asked.
    pub(crate) fn reply(&mut self, to: u8, reply: &Reply) {
        let sent = self.transmit_ser(to, reply);
        self.reply_sent(sent);
    }

    /// Sends a force table to the device that asked.
    pub(crate) fn reply_forces(&mut self, to: u8, table: ForceTable, inputs: Inputs) {
        let data = forces(table, GlobalData { model: self.model, state: inputs });
        let sent = self.transmit(to, FUNCTION_GENIUS, Subfunction::ReadIoForcesReply.code(), &data);
        self.reply_sent(sent);
    }

    /// Counts that many requests that get no reply.
    pub(crate) fn count_lost(&mut self, replies: usize) {
        count(&mut self.diagnostics.replies_lost, replies as u64);
    }

    /// Whether a report may go now.
    pub(crate) fn may_report(&self, now_ms: u32) -> bool {
        self.reporter.may_send(now_ms)
    }

    /// Sends a report of events from `first` on.
    pub(crate) fn report(&mut self, to: u8, first: u64, report: ReadReply) {
        let entries = report.entries.len();
        if self.transmit_ser(to, &Reply::Read(report)) {
            self.reporter.sent(first, entries);
            self.on_its_way = Some(OnItsWay::Report);
        }
    }

    /// Ends the pause, because nobody gets reports over the bus now. The next report need not wait.
    pub(crate) fn forget_pause(&mut self) {
        self.reporter.hurry();
    }

    fn receive(&mut self, datagram: &ReceivedDatagram, now_ms: u32) -> FromBus {
        const READ_IO_FORCES: u8 = Subfunction::ReadIoForces.code();
        match (datagram.function, datagram.subfunction) {
            (FUNCTION_HORNER, SUBFUNCTION_SER) => self.receive_message(datagram, now_ms),
            (FUNCTION_GENIUS, READ_IO_FORCES) if !datagram.broadcast => {
                let table = match *datagram.data {
                    [code] => ForceTable::from_code(code),
                    _ => None,
                };
                match table {
                    Some(table) => FromBus::ForcesAsked { device: datagram.source, table },
                    None => self.ignore(),
                }
            }
            _ => self.ignore(),
        }
    }

    fn ignore(&mut self) -> FromBus {
        count(&mut self.diagnostics.datagrams_ignored, 1);
        FromBus::DealtWith
    }

    fn receive_message(&mut self, datagram: &ReceivedDatagram, now_ms: u32) -> FromBus {
        let command = Command::parse(&datagram.data);
        // The time in it was right at its arrival, or is asked for as of that, and nobody saw the
        // arrival. The reply to a question that is not broadcast is right nevertheless: its moment
        // is between question and reply.
        let is_mark = datagram.broadcast && matches!(command, Ok(Command::Time { .. }));
        let is_clock = matches!(command, Ok(Command::SetClock(_)));
        if datagram.arrived_ms.is_none() && (is_clock || is_mark) {
            count(&mut self.diagnostics.clocks_refused, 1);
            return FromBus::DealtWith;
        }
        let way = if datagram.broadcast {
            count(&mut self.diagnostics.broadcasts, command.is_ok().into());
            Way::Broadcast
        } else {
            Way::Bus(datagram.source)
        };
        let tick_ms = datagram.arrived_ms.unwrap_or(now_ms);
        let at = tick_ms.into();
        FromBus::Arrived(Arrival { command, at, is_seen: datagram.arrived_ms.is_some(), way })
    }

    fn sent(&mut self, arrived: bool, now_ms: u32) -> FromBus {
        match self.on_its_way.take() {
            Some(OnItsWay::Reply) => count(&mut self.diagnostics.replies_lost, (!arrived).into()),
            Some(OnItsWay::Report) if arrived => {
                count(&mut self.diagnostics.reports_sent, 1);
                let (first, entries) = self.reporter.arrived(now_ms, self.turns_of_others_ms());
                return FromBus::Reported { first, entries };
            }
            Some(OnItsWay::Report) => {
                count(&mut self.diagnostics.reports_failed, 1);
                self.reporter.failed(now_ms);
            }
            None => {}
        }
        FromBus::DealtWith
    }

    /// How long it takes until each other device could have sent a datagram: one scan each, and the
    /// rest of the present one.
    fn turns_of_others_ms(&self) -> u32 {
        let scan_ms = self.status().and_then(|status| status.scan_ms).unwrap_or(0);
        u32::from(scan_ms) * (self.others.count_ones() + 1)
    }

    fn reply_sent(&mut self, sent: bool) {
        if sent {
            self.on_its_way = Some(OnItsWay::Reply);
        } else {
            self.count_lost(1);
        }
    }

    fn transmit_ser(&mut self, to: u8, reply: &Reply) -> bool {
        self.transmit(to, FUNCTION_HORNER, SUBFUNCTION_SER, &reply.to_body())
    }

    fn transmit(&mut self, to: u8, function: u8, subfunction: u8, data: &[u8]) -> bool {
        const { assert!(ser_proto::genius::MAX_DATA <= MAX_DATA_LEN) };
        let Ok(data) = Data::from_slice(data) else { return false };
        let transmission = Transmission {
            destination: Destination::Device(to),
            function,
            subfunction,
            priority: TransmitPriority::Normal,
            completion: Completion::Acknowledged,
            data,
        };
        self.driver.transmit(transmission).is_ok()
    }
}

/// The bit of a bus address, 0–31.
fn bit(number: u8) -> u32 {
    1_u32.checked_shl(number.into()).unwrap_or(0)
}

/// The reply to Read I/O Forces: the table's number and the table. Nothing is ever forced. The
/// input values are real, for a host that shows them without checking which of them are forced.
fn forces(table: ForceTable, inputs: GlobalData) -> Vec<u8, { ser_proto::genius::MAX_DATA }> {
    let mut forces = IoForces::none(table, inputs.model);
    if table == ForceTable::InputValues {
        // The table is as long as the inputs, because the model decides both lengths.
        for (content, byte) in forces.contents.iter_mut().zip(inputs.to_bytes()) {
            *content = byte;
        }
    }
    ser_proto::genius::Message::ReadIoForcesReply(forces).to_data()
}
