//! The recorder as a board or the simulator sees it: samples, bytes and ticks in, bytes out.
//!
//! A main loop reads the tick, hands over the bytes that have arrived, calls [`Node::poll`] with
//! that tick, and takes bytes to send for as long as there is room for them. A node decides
//! nothing: the ports know bytes, the recorder knows what they mean, and the node carries from one
//! to the other.

use geni_board::SharedRam;
use ser_proto::genius::max_entries;
use ser_proto::{AutoReport, Baud, Inputs, ReadReply};

use crate::arrival::Way;
use crate::clock::Rtc;
use crate::debounce::Debounce;
use crate::diagnostics::Diagnostics;
use crate::genius_port::{FromBus, GeniusPort};
use crate::recorder::{NodeParts, Recorder};
use crate::serial_port::SerialPort;
use crate::settings::Storage;
use crate::tick_stamp::TickStamp;
use crate::waiting::Request;

/// Events of the GENI board that one poll handles at most.
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

    /// The tick of the latest sample. A main loop reads it first and passes it to
    /// [`poll`](Self::poll) last.
    pub fn tick_ms(&self) -> u32 {
        self.recorder.tick_ms()
    }

    /// Records all changes up to the sample of `now_ms`.
    ///
    /// The main loop reads `now_ms` from [`tick_ms`](Self::tick_ms) *before* it hands over received
    /// bytes. A change that came after a command is then never recorded before that command is
    /// seen.
    pub fn poll(&mut self, now_ms: u32) {
        self.recorder.begin_filtering();
        self.recorder.record_until(now_ms);
        self.recorder.keep_power_up();
    }

    /// Takes a byte that arrived from the RS-232 line at this moment, which may be the bare tick of
    /// a sample. The command that it completes is accepted here.
    ///
    /// Clock and mode are set at once, as of that tick. Every other command is carried out when its
    /// reply has its turn.
    pub fn serial_receive(&mut self, byte: u8, at: impl Into<TickStamp>) {
        match self.serial.receive(byte, at.into()) {
            Some(Ok(arrival)) => self.recorder.arrived(&arrival),
            Some(Err(error)) => self.recorder.count_frame_error(error),
            None => {}
        }
    }

    /// Whether another command finds room to wait for its turn. A board that can keep bytes back
    /// does so while this is false.
    pub fn serial_has_room(&self) -> bool {
        self.recorder.has_room(Way::Line)
    }

    /// Counts that many more bytes that the UART lost or misread.
    pub fn serial_line_errors(&mut self, bytes: u32) {
        self.recorder.count_line_errors(bytes);
    }

    /// The next byte for the RS-232 line. `None` when there is nothing to send, or when the rate
    /// must change first.
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

    /// The rate to which the line must change once all bytes handed out have left the transmitter.
    ///
    /// Nothing more is handed out until [`baud_changed`](Self::baud_changed) is called.
    pub fn baud_change(&self) -> Option<Baud> {
        self.serial.baud_change(self.baud())
    }

    /// The line has changed to the rate that [`baud_change`](Self::baud_change) gave.
    pub fn baud_changed(&mut self, baud: Baud) {
        self.serial.baud_changed(baud);
    }

    /// The debounce times that the capture interrupt has to take over
    /// ([`Capture::take_times`](crate::Capture::take_times)); `None` if it has them.
    pub fn debounce_change(&self) -> Option<Debounce> {
        self.recorder.debounce_change()
    }

    /// The capture interrupt has taken over the times that [`debounce_change`](Self::debounce_change)
    /// gave.
    pub fn debounce_changed(&mut self, debounce: Debounce) {
        self.recorder.debounce_changed(debounce);
    }

    /// Says that the GENI board pulsed its interrupt line at `tick_ms`, because a datagram arrived
    /// then. Called before [`poll`](Self::poll), which then records no change after that tick until
    /// the datagram has been read. A board that does not connect the line need not call this: the
    /// flags are polled in any case.
    pub fn genius_interrupt<W: SharedRam>(&mut self, port: &mut GeniusPort<W>, tick_ms: u32) {
        port.interrupt(tick_ms);
        self.recorder.hold_after(port.oldest_arrival_ms());
    }

    /// Does a bounded amount of the work that is due on the Genius bus: global data, commands that
    /// have arrived, one datagram to send. Called after [`poll`](Self::poll).
    // Not inlined into the main loop: the merged function would be too long for the branches of a
    // jump table. The code that a compiler emits instead cannot be followed by the image check.
    #[inline(never)]
    pub fn genius_poll<W: SharedRam>(&mut self, port: &mut GeniusPort<W>) {
        // Read anew, not taken from `poll`: work since then may have taken long, and a flag is seen
        // now.
        let now_ms = self.tick_ms();
        port.show(self.recorder.inputs());
        for _ in 0..EVENTS_PER_POLL {
            let Some(said) = port.poll(now_ms) else { break };
            self.deal_with(said, port);
            // That may have taken long, as storing a configuration does. Pulses must be handed in
            // before the flags are looked at again.
            if self.tick_ms() != now_ms {
                break;
            }
        }
        self.recorder.hold_after(port.oldest_arrival_ms());
        self.recorder.note_genius(port.diagnostics());
        if port.can_send() {
            self.send_on_bus(port, now_ms);
        }
    }

    /// What has been dropped, refused or lost since power-up.
    pub fn diagnostics(&self) -> Diagnostics {
        self.recorder.diagnostics()
    }

    /// Whether events are being recorded.
    pub fn is_recording(&self) -> bool {
        self.recorder.is_recording()
    }

    /// The inputs that chatter now, so that their changes are counted and not recorded.
    pub fn chattering(&self) -> Inputs {
        self.recorder.chattering()
    }

    /// How many changes of an input (1–32) were left out as chatter since power-up. Stops at the
    /// largest value.
    pub fn suppressed(&self, input: u8) -> u32 {
        self.recorder.suppressed(input)
    }

    /// Events recorded since power-up, erased ones included; wraps.
    pub fn events(&self) -> u32 {
        self.recorder.events()
    }

    /// What a read of `count` entries (at most 10) from number `start` on would return now. Uses no
    /// port and leaves no trace.
    pub fn read(&self, start: u16, count: u8) -> ReadReply {
        self.recorder.read(start, count.into())
    }

    /// Commands that have arrived on any port since power-up, refused ones included; wraps.
    pub fn commands(&self) -> u32 {
        self.recorder.commands()
    }

    /// Lines up the next message for RS-232: replies first, then ordered print jobs, then
    /// unsolicited messages.
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
            // Nobody waits for these replies any more once the board is back.
            FromBus::Failed => port.count_lost(self.recorder.forget_bus_requests()),
            FromBus::DealtWith => {}
        }
    }

    /// Sends replies before reports, because a host waits for a reply.
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
