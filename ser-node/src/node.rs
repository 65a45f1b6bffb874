//! The recorder as a board or the simulator sees it: samples, bytes and ticks in, bytes out.
//!
//! A main loop reads the tick, hands over the bytes that have arrived, calls [`Node::poll`] with that tick, and takes
//! bytes to send for as long as there is room for them.

use ser_proto::{Baud, Code, Command, Model};

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
    recorder: Recorder<'a, S, R>,
    serial: SerialPort,
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
        Node { capture, ticks, sequencer, recorder, serial }
    }

    /// The tick of the latest sample: what a main loop reads first and passes to [`poll`](Self::poll) last.
    pub fn tick_ms(&self) -> u32 {
        self.capture.tick_ms()
    }

    /// Records all changes up to the sample of `now_ms`.
    ///
    /// The main loop reads `now_ms` from [`tick_ms`](Self::tick_ms) *before* it hands over received bytes: a command that arrives
    /// later than `now_ms` then never finds changes recorded that came after it.
    pub fn poll(&mut self, now_ms: u32) {
        let now_ms = self.ticks.extend(now_ms);
        self.record_until(now_ms);
    }

    /// Takes a byte from the RS-232 line that arrived at `tick_ms`, and carries out the command that it completes.
    pub fn serial_receive(&mut self, byte: u8, tick_ms: u32) {
        let Some(received) = self.serial.receive(byte, &mut self.recorder) else { return };
        let tick_ms = self.ticks.extend(tick_ms);
        // What changed before the command arrived is recorded by the clock and mode of that time.
        self.record_until(tick_ms);
        if !self.serial.has_room() {
            count(&mut self.recorder.diagnostics.commands_overrun, 1);
            return;
        }
        if let Some(answer) = self.carry_out(received, tick_ms) {
            self.serial.answer(answer);
        }
    }

    /// The UART lost or misread a byte.
    pub fn serial_line_error(&mut self) {
        count(&mut self.recorder.diagnostics.line_errors, 1);
    }

    /// The next byte for the RS-232 line; `None` when there is nothing to send, or the rate must change first.
    pub fn serial_transmit(&mut self) -> Option<u8> {
        self.serial.transmit(&mut self.recorder, self.capture.edges_lost())
    }

    /// The rate at which the line starts after power-up.
    pub fn baud(&self) -> Baud {
        self.recorder.configuration.baud
    }

    /// The rate to which the line shall change, as soon as all bytes handed out have left the transmitter.
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

    fn carry_out(&mut self, received: Received, tick_ms: u64) -> Option<Answer> {
        let command = match received {
            Ok(command) => command,
            Err(error) => return self.recorder.refuse(error),
        };
        if let Command::Print { start, count: entries } = command
            && !self.serial.print(start, entries)
        {
            count(&mut self.recorder.diagnostics.commands_overrun, 1);
            return None;
        }
        let before = self.recorder.configuration;
        let answer = self.recorder.execute(&command, tick_ms);
        self.serial.configured(&before, &self.recorder.configuration, &self.recorder.log);
        if command.code() == Code::Erase {
            self.serial.erased(&self.recorder.log);
        }
        Some(answer)
    }

    /// Takes the changes of all samples up to `until_ms` into the log.
    fn record_until(&mut self, until_ms: u64) {
        let Node { capture, ticks, sequencer, recorder, .. } = self;
        while let Some(sample) = capture.next_if(|sample| ticks.extend(sample.tick_ms) <= until_ms) {
            let tick_ms = ticks.extend(sample.tick_ms);
            while let Some(change) = sequencer.next(tick_ms) {
                recorder.record(change);
            }
            if sample.changed == 0 {
                sequencer.baseline(sample.state);
            } else {
                sequencer.push(tick_ms, sample.changed, sample.state);
            }
        }
        while let Some(change) = sequencer.next(until_ms + 1) {
            recorder.record(change);
        }
    }
}
