//! The recorder as a board or the simulator sees it: samples, bytes and ticks in, bytes out.
//!
//! A main loop reads the tick, hands over the bytes that have arrived, calls [`Node::poll`] with
//! that tick, and takes bytes to send for as long as there is room for them.

use ser_proto::{Baud, Command, Inputs, MAX_ENTRIES, Model, ReadReply, Reply};

use crate::capture::CaptureReader;
use crate::clock::Rtc;
use crate::diagnostics::{Diagnostics, count};
use crate::event_log::Event;
use crate::recorder::{Answer, Recorder};
use crate::sequencer::Sequencer;
use crate::serial_port::{Received, SerialPort};
use crate::settings::Storage;
use crate::ticks::Ticks;

/// Firmware version as the `M` reply has it, in hundredths: 0.1.0 is 10, 1.2.3 is 123.
pub const VERSION: u8 = 100 * digit(env!("CARGO_PKG_VERSION_MAJOR"))
    + 10 * digit(env!("CARGO_PKG_VERSION_MINOR"))
    + digit(env!("CARGO_PKG_VERSION_PATCH"));

#[expect(clippy::panic, reason = "evaluated by the compiler only")]
const fn digit(text: &str) -> u8 {
    match text.as_bytes() {
        [digit @ b'0'..=b'9'] => *digit - b'0',
        _ => panic!("the version byte has room for one digit per part of the version"),
    }
}

/// What a node is made of.
pub struct NodeParts<'a, S, R> {
    /// Which recorder it is.
    pub model: Model,
    /// Memory of the event log: 2048 events for the full range of sizes.
    pub log: &'a mut [Event],
    /// The main loop's end of the capture channel.
    pub capture: CaptureReader<'a>,
    /// Where the configuration is kept.
    pub storage: S,
    /// The battery-backed clock, or [`NoRtc`](crate::NoRtc).
    pub rtc: R,
}

/// A recorder.
pub struct Node<'a, S, R> {
    capture: CaptureReader<'a>,
    ticks: Ticks,
    sequencer: Sequencer,
    pub(crate) recorder: Recorder<'a, S, R>,
    serial: SerialPort,
    /// Commands that have arrived on any port, wrapping.
    commands: u32,
}

impl<'a, S: Storage, R: Rtc> Node<'a, S, R> {
    /// Powers the recorder up: loads the configuration and reads the clock. Recording is on.
    pub fn new(parts: NodeParts<'a, S, R>) -> Node<'a, S, R> {
        let NodeParts { model, log, capture, storage, rtc } = parts;
        let mut ticks = Ticks::new();
        let now_ms = ticks.extend(capture.tick_ms());
        let recorder = Recorder::new(model, log, storage, rtc, now_ms);
        let sequencer = Sequencer::new(*capture.debounce());
        let serial = SerialPort::new(recorder.configuration.baud);
        Node { capture, ticks, sequencer, recorder, serial, commands: 0 }
    }

    /// The tick of the latest sample: what a main loop reads first and passes to
    /// [`poll`](Self::poll) last.
    pub fn tick_ms(&self) -> u32 {
        self.capture.tick_ms()
    }

    /// Records all changes up to the sample of `now_ms`.
    ///
    /// The main loop reads `now_ms` from [`tick_ms`](Self::tick_ms) *before* it hands over received
    /// bytes: a command that arrives later than `now_ms` then never finds changes recorded that
    /// came after it.
    pub fn poll(&mut self, now_ms: u32) {
        let now_ms = self.ticks.extend(now_ms);
        self.record_until(now_ms);
    }

    /// A datagram that arrived at this tick waits to be read: changes that come after it are
    /// recorded when it has been, as it may set clock or mode. No change waits for longer than
    /// [`HELD_BACK_MS`](crate::HELD_BACK_MS).
    pub(crate) fn hold_after(&mut self, arrived_ms: Option<u32>) {
        let arrived_ms = arrived_ms.map(|tick_ms| self.ticks.extend(tick_ms));
        self.sequencer.hold_after(arrived_ms);
    }

    /// Takes a byte from the RS-232 line that arrived at `tick_ms`, and the command that it
    /// completes.
    ///
    /// Clock and mode are set at once, by that tick; everything else is done when the reply has its
    /// turn.
    pub fn serial_receive(&mut self, byte: u8, tick_ms: u32) {
        let Some(received) = self.serial.receive(byte, &mut self.recorder) else { return };
        let answer = match received {
            Ok(_) if !self.serial.has_room() => {
                count(&mut self.recorder.diagnostics.commands_overrun, 1);
                None
            }
            received => self.arrived(received, tick_ms),
        };
        if let Some(answer) = answer
            && !self.serial.answer(answer)
        {
            count(&mut self.recorder.diagnostics.commands_overrun, 1);
        }
    }

    /// Whether another command finds room to wait for its turn. A board that can keep bytes back
    /// does so until then.
    pub fn serial_has_room(&self) -> bool {
        self.serial.has_room()
    }

    /// The UART lost or misread so many more bytes.
    pub fn serial_line_errors(&mut self, bytes: u32) {
        count(&mut self.recorder.diagnostics.line_errors, bytes.into());
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
        self.recorder.configuration.baud
    }

    /// The rate to which the line shall change, as soon as all bytes handed out have left the
    /// transmitter.
    ///
    /// Until [`baud_changed`](Self::baud_changed) is called, nothing more is handed out.
    pub fn baud_change(&self) -> Option<Baud> {
        self.serial.baud_change(&self.recorder.configuration)
    }

    /// The line has changed to the rate that [`baud_change`](Self::baud_change) gave.
    pub fn baud_changed(&mut self, baud: Baud) {
        self.serial.baud_changed(baud);
    }

    /// What was dropped, refused or lost so far.
    pub fn diagnostics(&self) -> Diagnostics {
        Diagnostics {
            edges_lost: self.capture.edges_lost(),
            samples_missed: self.capture.samples_missed(),
            ..self.recorder.diagnostics
        }
    }

    /// Whether events are being recorded.
    pub fn is_recording(&self) -> bool {
        self.recorder.is_recording()
    }

    /// Events recorded since power-up, erased ones included; wraps.
    pub fn events(&self) -> u32 {
        let [a, b, c, d, ..] = self.recorder.log.next_sequence().to_le_bytes();
        u32::from_le_bytes([a, b, c, d])
    }

    /// What a read of `count` entries (at most 10) from number `start` on would bring now, without
    /// a port and without a trace.
    pub fn read(&self, start: u16, count: u8) -> ReadReply {
        self.recorder.read(start, count.into())
    }

    /// Commands that have arrived since power-up on any port, those included that were refused;
    /// wraps.
    pub fn commands(&self) -> u32 {
        self.commands
    }

    /// The inputs that are on now, whether or not events are recorded.
    pub(crate) fn inputs(&self) -> Inputs {
        Inputs(self.capture.state())
    }

    /// Carries out a command that was meant for all recorders. Nobody is answered; reading and
    /// printing, which are requests of one host to one recorder, have no effect.
    pub(crate) fn genius_broadcast(&mut self, received: Received, tick_ms: u32) {
        let answer = self.arrived(received, tick_ms);
        if let Some(answer @ Answer::To(Command::Configure(_) | Command::Erase)) = answer {
            self.reply(answer, 0);
        }
        if let Ok(command) = received {
            let tick_ms = self.ticks.extend(tick_ms);
            self.recorder.broadcast_received(command.code(), tick_ms);
        }
    }

    /// Does what an answer needs, and gives the reply; `None` when it is refused by silence.
    pub(crate) fn reply(&mut self, answer: Answer, max_entries: usize) -> Option<Reply> {
        if let Answer::To(Command::Print { start, count: entries }) = answer
            && !self.serial.print(start, entries)
        {
            count(&mut self.recorder.diagnostics.commands_overrun, 1);
            return None;
        }
        let before = self.recorder.configuration;
        let reply = self.recorder.reply(answer, max_entries);
        self.serial.configured(&before, &self.recorder.configuration, &self.recorder.log);
        if reply == Reply::Erased {
            self.serial.erased(&self.recorder.log);
        }
        Some(reply)
    }

    /// Lines up the next message for RS-232: replies first, in the order of their commands.
    fn begin_message(&mut self) {
        while let Some(answer) = self.serial.next_answer() {
            if let Some(reply) = self.reply(answer, MAX_ENTRIES) {
                return self.serial.send(&reply);
            }
        }
        self.serial.begin_unasked(&mut self.recorder, self.capture.edges_lost());
    }

    /// Takes a command that arrived at `tick_ms`; what is to be answered, if anything. What changed
    /// before is recorded first, by the clock and mode of that time.
    pub(crate) fn arrived(&mut self, received: Received, tick_ms: u32) -> Option<Answer> {
        self.commands = self.commands.wrapping_add(1);
        let tick_ms = self.ticks.extend(tick_ms);
        self.record_until(tick_ms);
        match received {
            Ok(command) => {
                let decides = matches!(command, Command::SetClock(_) | Command::SetMode { .. });
                if decides && self.sequencer.is_past(tick_ms) {
                    count(&mut self.recorder.diagnostics.settings_late, 1);
                }
                let now_ms = self.ticks.extend(self.capture.tick_ms());
                Some(self.recorder.arrived(&command, tick_ms, now_ms))
            }
            Err(error) => self.recorder.refuse(error),
        }
    }

    /// Takes the changes of all samples up to `until_ms` into the log.
    fn record_until(&mut self, until_ms: u64) {
        let Node { capture, ticks, sequencer, recorder, .. } = self;
        let mask = recorder.model.mask();
        while let Some(sample) = capture.next_if(|sample| ticks.extend(sample.tick_ms) <= until_ms)
        {
            let tick_ms = ticks.extend(sample.tick_ms);
            while let Some(change) = sequencer.next(tick_ms) {
                recorder.record(change);
            }
            if sample.changed == 0 {
                sequencer.baseline(sample.state & mask);
            } else if sample.changed & mask != 0 {
                sequencer.push(tick_ms, sample.changed & mask, sample.state & mask);
            }
        }
        while let Some(change) = sequencer.next(until_ms + 1) {
            recorder.record(change);
        }
    }
}
