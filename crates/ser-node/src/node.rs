//! The recorder as a board or the simulator sees it: samples, bytes and ticks in, bytes out.
//!
//! A main loop reads the tick, hands over the bytes that have arrived, calls [`Node::poll`] with
//! that tick, and takes bytes to send for as long as there is room for them. Nothing is decided
//! here: the ports know bytes, the recorder knows what they mean, and a node carries from one to
//! the other.

use geni_board::SharedRam;
use ser_proto::genius::max_entries;
use ser_proto::{AutoReport, Baud, ReadReply};

use crate::arrival::Way;
use crate::clock::Rtc;
use crate::diagnostics::Diagnostics;
use crate::genius_port::{FromBus, GeniusPort};
use crate::recorder::{NodeParts, Recorder};
use crate::serial_port::SerialPort;
use crate::settings::Storage;
use crate::waiting::Request;

/// Things the GENI board has to say that are dealt with in one poll.
const EVENTS_PER_POLL: usize = 4;

/// A recorder.
pub struct Node<'a, S, R> {
    recorder: Recorder<'a, S, R>,
    serial: SerialPort,
}

impl<'a, S: Storage, R: Rtc> Node<'a, S, R> {
    /// Powers the recorder up: loads the configuration and reads the clock. Recording is on.
    pub fn new(parts: NodeParts<'a, S, R>) -> Node<'a, S, R> {
        let recorder = Recorder::new(parts);
        Node { serial: SerialPort::new(recorder.configuration().baud), recorder }
    }

    /// The tick of the latest sample: what a main loop reads first and passes to
    /// [`poll`](Self::poll) last.
    pub fn tick_ms(&self) -> u32 {
        self.recorder.tick_ms()
    }

    /// Records all changes up to the sample of `now_ms`.
    ///
    /// The main loop reads `now_ms` from [`tick_ms`](Self::tick_ms) *before* it hands over received
    /// bytes: a command that arrives later than `now_ms` then never finds changes recorded that
    /// came after it.
    pub fn poll(&mut self, now_ms: u32) {
        self.recorder.record_until(now_ms);
    }

    /// Takes a byte from the RS-232 line that arrived at `tick_ms`, and the command that it
    /// completes.
    ///
    /// Clock and mode are set at once, by that tick; everything else is done when the reply has its
    /// turn.
    pub fn serial_receive(&mut self, byte: u8, tick_ms: u32) {
        match self.serial.receive(byte, tick_ms) {
            Some(Ok(arrival)) => self.recorder.arrived(&arrival),
            Some(Err(error)) => self.recorder.count_frame_error(error),
            None => {}
        }
    }

    /// Whether another command finds room to wait for its turn. A board that can keep bytes back
    /// does so until then.
    pub fn serial_has_room(&self) -> bool {
        self.recorder.has_room(Way::Line)
    }

    /// The UART lost or misread so many more bytes.
    pub fn serial_line_errors(&mut self, bytes: u32) {
        self.recorder.count_line_errors(bytes);
    }

    /// The next byte for the RS-232 line; `None` when there is nothing to send, or the rate must
    /// change first.
    pub fn serial_transmit(&mut self) -> Option<u8> {
        if let Some(byte) = self.serial.next_byte() {
            return Some(byte);
        }
        if self.baud_change().is_some() {
            return None;
        }
        self.begin_message();
        self.serial.next_byte()
    }

    /// The rate at which the line starts after power-up.
    pub fn baud(&self) -> Baud {
        self.recorder.configuration().baud
    }

    /// The rate to which the line shall change, as soon as all bytes handed out have left the
    /// transmitter.
    ///
    /// Until [`baud_changed`](Self::baud_changed) is called, nothing more is handed out.
    pub fn baud_change(&self) -> Option<Baud> {
        self.serial.baud_change(self.baud())
    }

    /// The line has changed to the rate that [`baud_change`](Self::baud_change) gave.
    pub fn baud_changed(&mut self, baud: Baud) {
        self.serial.baud_changed(baud);
    }

    /// The interrupt line of the GENI board was pulsed at `tick_ms`: a datagram arrived then.
    /// Called before [`poll`](Self::poll), so that no change after it is recorded before it has
    /// been read. A board that does not connect the line need not call this; the flags are looked
    /// at all the same.
    pub fn genius_interrupt<W: SharedRam>(&mut self, port: &mut GeniusPort<W>, tick_ms: u32) {
        port.interrupt(tick_ms);
        self.recorder.hold_after(port.oldest_arrival_ms());
    }

    /// Does what is due on the Genius bus, a bounded amount of it: global data, commands that have
    /// arrived, one datagram to be sent. Called after [`poll`](Self::poll).
    // Apart from the main loop: in one function they are longer than a table of jumps reaches, and
    // what a compiler does instead, no check of an image follows.
    #[inline(never)]
    pub fn genius_poll<W: SharedRam>(&mut self, port: &mut GeniusPort<W>) {
        // Not that of `poll`: what was done since may have taken long, and a flag is seen now.
        let now_ms = self.tick_ms();
        port.show(self.recorder.inputs());
        for _ in 0..EVENTS_PER_POLL {
            let Some(said) = port.poll(now_ms) else { break };
            self.deal_with(said, port);
            // That may have taken long, as the storing of a configuration does. Pulses are handed
            // in before flags are looked at again.
            if self.tick_ms() != now_ms {
                break;
            }
        }
        self.recorder.hold_after(port.oldest_arrival_ms());
        if port.can_send() {
            self.send_on_bus(port, now_ms);
        }
    }

    /// What was dropped, refused or lost so far.
    pub fn diagnostics(&self) -> Diagnostics {
        self.recorder.diagnostics()
    }

    /// Whether events are being recorded.
    pub fn is_recording(&self) -> bool {
        self.recorder.is_recording()
    }

    /// Events recorded since power-up, erased ones included; wraps.
    pub fn events(&self) -> u32 {
        self.recorder.events()
    }

    /// What a read of `count` entries (at most 10) from number `start` on would bring now, without
    /// a port and without a trace.
    pub fn read(&self, start: u16, count: u8) -> ReadReply {
        self.recorder.read(start, count.into())
    }

    /// Commands that have arrived since power-up on any port, those included that were refused;
    /// wraps.
    pub fn commands(&self) -> u32 {
        self.recorder.commands()
    }

    /// Lines up the next message for RS-232: replies first, then what was ordered, then what nobody
    /// asked for.
    fn begin_message(&mut self) {
        let Node { recorder, serial } = self;
        if let Some(reply) = recorder.next_line_reply() {
            serial.send(&reply);
        } else if let Some(line) = recorder.next_ordered_line() {
            serial.print(line);
        } else if let Some(report) = recorder.next_line_report() {
            serial.send(&report);
        } else if let Some(line) = recorder.next_auto_line() {
            serial.print(line);
        }
    }

    fn deal_with<W: SharedRam>(&mut self, said: FromBus, port: &mut GeniusPort<W>) {
        match said {
            FromBus::Arrived(arrival) => self.recorder.arrived(&arrival),
            FromBus::ForcesAsked { device, table } => {
                if !self.recorder.forces_asked(device, table) {
                    port.count_lost(1);
                }
            }
            FromBus::Reported { first, entries } => self.recorder.reported(first, entries),
            // By the time the board is back, nobody waits for these any more.
            FromBus::Failed => port.count_lost(self.recorder.forget_bus_requests()),
            FromBus::DealtWith => {}
        }
    }

    /// Replies go before reports: somebody waits for them.
    fn send_on_bus<W: SharedRam>(&mut self, port: &mut GeniusPort<W>, now_ms: u32) {
        let max_entries = max_entries(self.recorder.model());
        match self.recorder.next_bus_request() {
            Some((device, Request::Command(pending))) => {
                match self.recorder.reply(pending, max_entries) {
                    Some(reply) => port.reply(device, &reply),
                    None => port.count_lost(1),
                }
            }
            Some((device, Request::Forces(table))) => {
                port.reply_forces(device, table, self.recorder.inputs());
            }
            None => self.report_on_bus(port, max_entries, now_ms),
        }
    }

    fn report_on_bus<W: SharedRam>(
        &mut self,
        port: &mut GeniusPort<W>,
        max_entries: usize,
        now_ms: u32,
    ) {
        if self.recorder.configuration().auto_report != AutoReport::Genius {
            port.forget_pause();
        } else if port.may_report(now_ms)
            && let Some((first, report)) = self.recorder.report(max_entries)
        {
            port.report(self.recorder.configuration().report_address, first, report);
        }
    }
}
