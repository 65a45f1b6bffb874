//! The Genius port: datagrams in, datagrams out, and the state of all inputs in every bus scan,
//! through a GENI board.
//!
//! Commands come as datagrams 40h/50h, directed or by broadcast; replies go to the sender of a
//! directed one. The board is reset when it fails, and the bus is joined again; RS-232 and
//! recording know nothing of it.
//!
//! - **Time of arrival** is the tick at which the board raised its Receive-Queue flag: that of the
//!   pulse that was handed in ([`interrupt`](GeniusPort::interrupt)), or, without the line, of the
//!   [`poll`](GeniusPort::poll) that saw the flag. However long the board then takes to hand the
//!   datagram over, clock, mode and Last Broadcast go by it, and changes that come after it wait
//!   for it ([`HELD_BACK_MS`](crate::HELD_BACK_MS)).
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

mod reporter;

use geni_board::{
    Completion, Configuration, Counters, Data, Destination, DeviceChange, Driver, Event, Failure,
    Interrupts, MAX_DATA_LEN, Options, ReceivedDatagram, SharedRam, Start, Status, Transmission,
    TransmitPriority, timing,
};
use heapless::{Deque, Vec};
use ser_proto::genius::{
    FUNCTION_GENIUS, FUNCTION_HORNER, ForceTable, GlobalData, IoForces, SUBFUNCTION_SER,
    Subfunction, max_entries,
};
use ser_proto::{AutoReport, Command, Model, Reply};

use crate::clock::Rtc;
use crate::diagnostics::count;
use crate::node::Node;
use crate::recorder::Answer;
use crate::settings::Storage;

use reporter::Reporter;

/// Replies that may wait while another one is on its way. The board itself holds no more than 15
/// commands.
const MAX_REPLIES: usize = 16;

/// Things the board has to say that are dealt with in one poll.
const EVENTS_PER_POLL: usize = 4;

/// No reference address is assigned.
const NO_REFERENCE: u16 = 0xFFFF;

/// How the port is set up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct GeniusOptions {
    /// The recorder's model: it decides how many bytes of global data there are.
    pub model: Model,
    /// State of the board when the port begins.
    pub start: Start,
    /// Whether [`GeniusPort::reset_held`] reaches the board. Without it, a failed board can only be
    /// waited for.
    pub reset_line: bool,
    /// How long the board may go without a heartbeat.
    pub heartbeat_timeout_ms: u32,
    /// Reference address that the board tells devices that ask; it means nothing to the recorder.
    pub reference: u16,
}

impl GeniusOptions {
    /// A board that is reset at power-up and whenever it fails.
    #[must_use]
    pub const fn new(model: Model) -> GeniusOptions {
        GeniusOptions {
            model,
            start: Start::Reset { hold_ms: timing::POWER_UP_RESET_MS },
            reset_line: true,
            heartbeat_timeout_ms: timing::HEARTBEAT_TIMEOUT_MS,
            reference: NO_REFERENCE,
        }
    }

    fn driver_options(self) -> Options {
        let len = match self.model {
            Model::Ser160 => 2,
            Model::Ser320 => 4,
        };
        // Nobody looks at other devices' inputs, but with shorter buffers the board would not log
        // all of them in.
        let configuration =
            Configuration::new(self.reference, len, 0, Configuration::DEFAULT.buffer_len());
        Options {
            start: self.start,
            reset_line: self.reset_line,
            heartbeat_timeout_ms: self.heartbeat_timeout_ms,
            // A pulse of the line is a datagram, then. All else can wait until flags are looked at
            // anyway.
            interrupts: Interrupts::RECEIVE_QUEUE,
            ..Options::new(configuration.unwrap_or(Configuration::DEFAULT))
        }
    }
}

impl Default for GeniusOptions {
    /// For the 16-input model.
    fn default() -> GeniusOptions {
        GeniusOptions::new(Model::Ser160)
    }
}

/// Counts since power-up; they stop at the largest value. What was wrong with commands is in
/// [`Diagnostics`](crate::Diagnostics), whichever port they came from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct GeniusDiagnostics {
    /// What the driver has met with at the board.
    pub board: Counters,
    /// How the board failed last.
    pub last_failure: Option<Failure>,
    /// Datagrams that are not for a recorder, or not as they should be.
    pub datagrams_ignored: u32,
    /// Commands that came by broadcast and were carried out.
    pub broadcasts: u32,
    /// Replies that the board could not send, or that went down with it before or after their
    /// commands were carried out.
    pub replies_lost: u32,
    /// Commands that set the clock and were not carried out, because nobody saw them arrive.
    pub clocks_refused: u32,
    /// Auto reports that arrived.
    pub reports_sent: u32,
    /// Auto reports that did not arrive, or of which it is not known; each is sent again.
    pub reports_failed: u32,
}

/// A reply that waits. Its content is looked up when it goes out, so that it is true then.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Waiting {
    /// Device number of who asked.
    to: u8,
    what: What,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum What {
    Answer(Answer),
    Forces(ForceTable),
}

/// The datagram that the driver has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum OnItsWay {
    Reply,
    Report,
}

/// The Genius port of a [`Node`], over the shared RAM of its GENI board.
///
/// In every turn of its main loop a board hands in the pulses of the interrupt line
/// ([`interrupt`](Self::interrupt)), calls [`Node::poll`], then [`poll`](Self::poll), and then
/// drives the GENI board's reset line with [`reset_held`](Self::reset_held).
pub struct GeniusPort<W> {
    driver: Driver<W>,
    model: Model,
    replies: Deque<Waiting, MAX_REPLIES>,
    on_its_way: Option<OnItsWay>,
    reporter: Reporter,
    /// Devices that are logged in, number 0 in bit 0.
    others: u32,
    diagnostics: GeniusDiagnostics,
}

impl<W: SharedRam> GeniusPort<W> {
    /// A port whose board is behind `window`. Nothing is read or written before the first
    /// [`poll`](Self::poll).
    pub fn new(window: W, options: GeniusOptions) -> GeniusPort<W> {
        GeniusPort {
            driver: Driver::new(window, options.driver_options()),
            model: options.model,
            replies: Deque::new(),
            on_its_way: None,
            reporter: Reporter::new(),
            others: 0,
            diagnostics: GeniusDiagnostics::default(),
        }
    }

    /// Does what is due, a bounded amount of it: global data, commands that have arrived, one
    /// datagram to be sent.
    pub fn poll<S: Storage, R: Rtc>(&mut self, node: &mut Node<'_, S, R>) {
        // Not that of `Node::poll`: what was done since may have taken long, and a flag is seen
        // now.
        let now_ms = node.tick_ms();
        let global = GlobalData { model: self.model, state: node.inputs() }.to_bytes();
        // As long as the model says, and that is what was configured.
        let _ = self.driver.set_global_data(&global);
        for _ in 0..EVENTS_PER_POLL {
            let Some(event) = self.driver.poll(now_ms) else { break };
            self.deal_with(event, node, now_ms);
            // That may have taken long, as the storing of a configuration does. Pulses are handed
            // in before flags are looked at again.
            if node.tick_ms() != now_ms {
                break;
            }
        }
        node.hold_after(self.driver.oldest_arrival_ms());
        if self.on_its_way.is_none() && self.driver.can_transmit() {
            self.send_next(node, now_ms);
        }
    }

    /// Whether the board's reset line is to be held low until the next [`poll`](Self::poll).
    pub fn reset_held(&self) -> bool {
        self.driver.reset_held()
    }

    /// The board's interrupt line was pulsed at `tick_ms`: a datagram arrived then. Called before
    /// [`Node::poll`], so that no change after it is recorded before it has been read. A board that
    /// does not connect the line need not call this; the flags are looked at all the same.
    pub fn interrupt<S: Storage, R: Rtc>(&mut self, node: &mut Node<'_, S, R>, tick_ms: u32) {
        self.driver.interrupt(tick_ms);
        node.hold_after(self.driver.oldest_arrival_ms());
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

    fn deal_with<S: Storage, R: Rtc>(
        &mut self,
        event: Event,
        node: &mut Node<'_, S, R>,
        now_ms: u32,
    ) {
        match event {
            Event::Received(datagram) => self.receive(&datagram, node, now_ms),
            Event::Sent(result) => self.sent(result.is_ok(), node, now_ms),
            Event::Failed(failure) => {
                self.diagnostics.last_failure = Some(failure);
                // By the time the board is back, nobody waits for these any more.
                count(&mut self.diagnostics.replies_lost, self.replies.len() as u64);
                self.replies.clear();
                self.others = 0;
            }
            Event::Ready(_) => self.reporter.hurry(),
            Event::Device { number, change: DeviceChange::LoggedOut } => {
                self.others &= !bit(number)
            }
            Event::Device { number, .. } => self.others |= bit(number),
            // The driver remembers or has dealt with it, or it is not asked for.
            Event::Configured(_)
            | Event::StatusChanged(_)
            | Event::RequestRefused(_)
            | Event::Request(_)
            | Event::Replied(_)
            | Event::TablesLocked
            | Event::OutputsSent => {}
        }
    }

    fn receive<S: Storage, R: Rtc>(
        &mut self,
        datagram: &ReceivedDatagram,
        node: &mut Node<'_, S, R>,
        now_ms: u32,
    ) {
        const READ_IO_FORCES: u8 = Subfunction::ReadIoForces.code();
        match (datagram.function, datagram.subfunction) {
            (FUNCTION_HORNER, SUBFUNCTION_SER) => self.receive_message(datagram, node, now_ms),
            (FUNCTION_GENIUS, READ_IO_FORCES) if !datagram.broadcast => {
                let table = match *datagram.data {
                    [code] => ForceTable::from_code(code),
                    _ => None,
                };
                match table {
                    Some(table) => self.reply(datagram.source, What::Forces(table)),
                    None => count(&mut self.diagnostics.datagrams_ignored, 1),
                }
            }
            _ => count(&mut self.diagnostics.datagrams_ignored, 1),
        }
    }

    fn receive_message<S: Storage, R: Rtc>(
        &mut self,
        datagram: &ReceivedDatagram,
        node: &mut Node<'_, S, R>,
        now_ms: u32,
    ) {
        let message = Command::parse(&datagram.data);
        // The time that it brings was that of its arrival, and no other is known to be right.
        if datagram.arrived_ms.is_none() && matches!(message, Ok(Command::SetClock(_))) {
            count(&mut self.diagnostics.clocks_refused, 1);
            return;
        }
        if datagram.arrived_ms.is_none() && matches!(message, Ok(Command::SetMode { .. })) {
            // Better late than never; but changes of that time have been judged by the mode of
            // before.
            count(&mut node.recorder.diagnostics.settings_late, 1);
        }
        let arrived_ms = datagram.arrived_ms.unwrap_or(now_ms);
        if datagram.broadcast {
            count(&mut self.diagnostics.broadcasts, message.is_ok().into());
            node.genius_broadcast(message, arrived_ms);
        } else if self.replies.is_full() {
            count(&mut node.recorder.diagnostics.commands_overrun, 1);
        } else if let Some(answer) = node.arrived(message, arrived_ms) {
            self.reply(datagram.source, What::Answer(answer));
        }
    }

    fn reply(&mut self, to: u8, what: What) {
        if self.replies.push_back(Waiting { to, what }).is_err() {
            count(&mut self.diagnostics.replies_lost, 1);
        }
    }

    fn sent<S: Storage, R: Rtc>(&mut self, arrived: bool, node: &mut Node<'_, S, R>, now_ms: u32) {
        match self.on_its_way.take() {
            Some(OnItsWay::Reply) => count(&mut self.diagnostics.replies_lost, (!arrived).into()),
            Some(OnItsWay::Report) if arrived => {
                count(&mut self.diagnostics.reports_sent, 1);
                let turns_ms = self.turns_of_others_ms();
                self.reporter.arrived(&mut node.recorder, now_ms, turns_ms);
            }
            Some(OnItsWay::Report) => {
                count(&mut self.diagnostics.reports_failed, 1);
                self.reporter.failed(now_ms);
            }
            None => {}
        }
    }

    /// How long it takes until each other device could have sent a datagram: a scan each, and what
    /// is left of this one.
    fn turns_of_others_ms(&self) -> u32 {
        let scan_ms = self.status().and_then(|status| status.scan_ms).unwrap_or(0);
        u32::from(scan_ms) * (self.others.count_ones() + 1)
    }

    /// Replies go before reports: somebody waits for them.
    fn send_next<S: Storage, R: Rtc>(&mut self, node: &mut Node<'_, S, R>, now_ms: u32) {
        let max_entries = max_entries(node.recorder.model);
        if let Some(Waiting { to, what }) = self.replies.pop_front() {
            let sent = match what {
                What::Answer(answer) => node
                    .reply(answer, max_entries)
                    .is_some_and(|reply| self.transmit_ser(to, &reply)),
                What::Forces(table) => {
                    let data =
                        forces(table, GlobalData { model: self.model, state: node.inputs() });
                    self.transmit(to, FUNCTION_GENIUS, Subfunction::ReadIoForcesReply.code(), &data)
                }
            };
            if sent {
                self.on_its_way = Some(OnItsWay::Reply);
            } else {
                count(&mut self.diagnostics.replies_lost, 1);
            }
            return;
        }
        let configuration = node.recorder.configuration;
        if configuration.auto_report != AutoReport::Genius {
            self.reporter.hurry();
        } else if let Some(report) = self.reporter.next(&mut node.recorder, max_entries, now_ms)
            && self.transmit_ser(configuration.report_address, &Reply::Read(report))
        {
            self.on_its_way = Some(OnItsWay::Report);
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
