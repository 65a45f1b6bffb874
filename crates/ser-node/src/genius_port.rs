//! The Genius port: datagrams in, datagrams out, and the state of all inputs in every bus scan,
//! through a GENI board.
//!
//! Commands come as datagrams 40h/50h, directed or by broadcast; replies go to the sender of a
//! directed one. The board is reset when it fails, and the bus is joined again; RS-232 and
//! recording know nothing of it.
//!
//! The port turns datagrams into commands and replies into datagrams; what a command means, and who
//! waits for which reply, is not known here. A [`Node`](crate::Node) carries from one to the other.
//!
//! - **Time of arrival** is the tick at which the board raised its Receive-Queue flag: that of the
//!   pulse that was handed in ([`genius_interrupt`](crate::Node::genius_interrupt)), or, without
//!   the line, of the [`genius_poll`](crate::Node::genius_poll) that saw the flag. However long the
//!   board then takes to hand the datagram over, clock, mode and Last Broadcast go by it, and
//!   changes that come after it wait for it ([`HELD_BACK_MS`](crate::HELD_BACK_MS)).
//! - **Replies** are sent once. A host that misses one asks again, as on RS-232; a repeated reply
//!   might be taken for the answer to the next command.
//! - **Auto reports** are repeated until their receiver has acknowledged one, with growing pauses,
//!   as a receiver that is not there would cost all others their place in the bus scan. A receiver
//!   may get one twice when its acknowledgement was lost; total and next slot show it. All devices
//!   together have one datagram of normal priority per bus scan, and those with low numbers have
//!   the first chance: after each report as many scans are left to the others as there are others.
//! - **Read I/O Forces** is answered with the recorder's own input tables: none is forced, and the
//!   values are the states of the inputs. There are no outputs, so these tables are empty.
//! - **Requests for memory** are refused: a recorder has none.

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

/// What the board had to say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FromBus {
    /// A command.
    Arrived(Arrival),
    /// A device asks for a force table.
    ForcesAsked { device: u8, table: ForceTable },
    /// So many events from `first` on have reached their receiver.
    Reported { first: u64, entries: usize },
    /// The board has failed, and whoever asked knows nothing of us any more.
    Failed,
    /// Something that concerns the port alone.
    DealtWith,
}

/// The datagram that the driver has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum OnItsWay {
    Reply,
    Report,
}

/// The Genius port of a [`Node`](crate::Node), over the shared RAM of its GENI board.
///
/// In every turn of its main loop a board hands in the pulses of the interrupt line
/// ([`Node::genius_interrupt`](crate::Node::genius_interrupt)), calls
/// [`Node::poll`](crate::Node::poll), then [`Node::genius_poll`](crate::Node::genius_poll), and
/// then drives the GENI board's reset line with [`reset_held`](Self::reset_held).
pub struct GeniusPort<W> {
    driver: Driver<W>,
    model: Model,
    on_its_way: Option<OnItsWay>,
    reporter: Reporter,
    /// Devices that are logged in, number 0 in bit 0.
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

    /// Whether the board's reset line is to be held low until the port is polled again.
    pub fn reset_held(&self) -> bool {
        self.driver.reset_held()
    }

    /// The shared RAM.
    pub fn window(&mut self) -> &mut W {
        self.driver.ram_mut()
    }

    /// Whether the board is started and configured. Whether it has its turns on the bus is in its
    /// [`status`](Self::status).
    pub fn is_ready(&self) -> bool {
        self.driver.is_ready()
    }

    /// The board's status table as it was looked at last, if it was since the board was started.
    pub fn status(&self) -> Option<Status> {
        self.driver.status()
    }

    /// What was ignored, lost or repeated so far.
    pub fn diagnostics(&self) -> GeniusDiagnostics {
        GeniusDiagnostics { board: self.driver.counters(), ..self.diagnostics }
    }

    /// The board's interrupt line was pulsed at `tick_ms`.
    pub(crate) fn interrupt(&mut self, tick_ms: u32) {
        self.driver.interrupt(tick_ms);
    }

    /// When the oldest datagram arrived that waits to be read.
    pub(crate) fn oldest_arrival_ms(&self) -> Option<u32> {
        self.driver.oldest_arrival_ms()
    }

    /// Shows the state of all inputs in every bus scan.
    pub(crate) fn show(&mut self, inputs: Inputs) {
        let global = GlobalData { model: self.model, state: inputs }.to_bytes();
        // As long as the model says, and that is what was configured.
        let _ = self.driver.set_global_data(&global);
    }

    /// The next thing that the board has to say, if any.
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
            // The driver remembers or has dealt with it, or it is not asked for.
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

    /// So many requests get no reply.
    pub(crate) fn count_lost(&mut self, replies: usize) {
        count(&mut self.diagnostics.replies_lost, replies as u64);
    }

    /// Whether a report may go now, or is to be waited with.
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

    /// Nobody gets reports over the bus: the next one that is ever asked for need not wait.
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
        // The time that it brings was that of its arrival, and no other is known to be right.
        if datagram.arrived_ms.is_none() && matches!(command, Ok(Command::SetClock(_))) {
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
        FromBus::Arrived(Arrival { command, tick_ms, is_seen: datagram.arrived_ms.is_some(), way })
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

    /// How long it takes until each other device could have sent a datagram: a scan each, and what
    /// is left of this one.
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

/// The bit of a device number; there are 32 of these.
fn bit(number: u8) -> u32 {
    1_u32.checked_shl(number.into()).unwrap_or(0)
}

/// The reply to Read I/O Forces: the table's number and the table. Nothing is ever forced. A host
/// that shows the values of inputs without looking which of them are forced sees what they are.
fn forces(table: ForceTable, inputs: GlobalData) -> Vec<u8, { ser_proto::genius::MAX_DATA }> {
    let mut forces = IoForces::none(table, inputs.model);
    if table == ForceTable::InputValues {
        // The table is as long as the inputs are: both go by the model.
        for (content, byte) in forces.contents.iter_mut().zip(inputs.to_bytes()) {
            *content = byte;
        }
    }
    ser_proto::genius::Message::ReadIoForcesReply(forces).to_data()
}
