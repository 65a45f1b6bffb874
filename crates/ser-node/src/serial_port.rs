//! The RS-232 port: frames in, frames and text lines out.
//!
//! Commands wait in line and are answered in the order in which they came. What nobody asked for
//! (print jobs, auto report, auto print) goes out when no command is waiting, from the log itself:
//! only a position is kept, so nothing is lost until the ring overwrites it, and then it is
//! counted.

use heapless::Deque;
use ser_proto::{
    AutoReport, Baud, Command, Configuration, Decoded, FrameDecoder, FrameEncoder, MAX_ENTRIES,
    ParseError, Reply,
};

use crate::clock::Rtc;
use crate::diagnostics::count;
use crate::event_log::EventLog;
use crate::print_line::PrintLine;
use crate::recorder::{Answer, Recorder};
use crate::settings::Storage;

/// Commands that may wait while a message is being sent.
const MAX_ANSWERS: usize = 16;

/// Print jobs that may wait.
const MAX_PRINT_JOBS: usize = 4;

/// Bytes of the longest command (set clock and configure are shorter than this).
const MAX_COMMAND_LEN: usize = 16;

/// State of the port.
pub(crate) struct SerialPort {
    decoder: FrameDecoder<MAX_COMMAND_LEN>,
    answers: Deque<Answer, MAX_ANSWERS>,
    print_jobs: Deque<PrintJob, MAX_PRINT_JOBS>,
    outgoing: Outgoing,
    /// Rate at which the board drives the line.
    baud: Baud,
    /// Sequence number of the next event to print.
    print_next: u64,
    edges_lost_printed: u32,
}

/// Entries still to be printed.
#[derive(Clone, Copy, Debug)]
struct PrintJob {
    next: u16,
    left: u16,
}

/// What is being sent.
enum Outgoing {
    Nothing,
    Frame(FrameEncoder),
    Line(PrintLine),
}

impl Iterator for Outgoing {
    type Item = u8;

    fn next(&mut self) -> Option<u8> {
        let byte = match self {
            Outgoing::Nothing => None,
            Outgoing::Frame(frame) => frame.next(),
            Outgoing::Line(line) => line.next(),
        };
        if byte.is_none() {
            *self = Outgoing::Nothing;
        }
        byte
    }
}

/// A frame that has arrived.
pub(crate) type Received = Result<Command, ParseError>;

impl SerialPort {
    pub(crate) fn new(baud: Baud) -> SerialPort {
        SerialPort {
            decoder: FrameDecoder::new(),
            answers: Deque::new(),
            print_jobs: Deque::new(),
            outgoing: Outgoing::Nothing,
            baud,
            print_next: 0,
            edges_lost_printed: 0,
        }
    }

    /// Takes a byte from the line; gives the message that it completes.
    pub(crate) fn receive<S: Storage, R: Rtc>(
        &mut self,
        byte: u8,
        recorder: &mut Recorder<'_, S, R>,
    ) -> Option<Received> {
        match self.decoder.push(byte)? {
            Decoded::Frame(body) => Some(Command::parse(body)),
            Decoded::Dropped(dropped) => {
                recorder.diagnostics.count_frame_error(dropped.cause);
                None
            }
            // Nobody talks text to a recorder.
            Decoded::Text(_) => None,
        }
    }

    /// Whether another reply may be put in line.
    pub(crate) fn has_room(&self) -> bool {
        !self.answers.is_full()
    }

    /// Puts an answer in line; false when there is no room.
    pub(crate) fn answer(&mut self, answer: Answer) -> bool {
        self.answers.push_back(answer).is_ok()
    }

    /// The answer whose turn it is.
    pub(crate) fn next_answer(&mut self) -> Option<Answer> {
        self.answers.pop_front()
    }

    /// Sends a reply after what is being sent, which must be nothing.
    pub(crate) fn send(&mut self, reply: &Reply) {
        self.outgoing = Outgoing::Frame(FrameEncoder::new(reply.to_body()));
    }

    /// Puts a print job in line; false when too many are waiting.
    pub(crate) fn print(&mut self, start: u16, count: u16) -> bool {
        self.print_jobs.push_back(PrintJob { next: start, left: count }).is_ok()
    }

    /// Auto print begins with the next event when it is switched on.
    pub(crate) fn configured(
        &mut self,
        before: &Configuration,
        after: &Configuration,
        log: &EventLog<'_>,
    ) {
        if before.auto_print != after.auto_print {
            self.print_next = log.next_sequence();
        }
    }

    /// Erased events are not printed, and neither is what a print job was still to find among them.
    pub(crate) fn erased(&mut self, log: &EventLog<'_>) {
        self.print_next = log.next_sequence();
        self.print_jobs.clear();
    }

    /// The next byte of what is being sent.
    pub(crate) fn next_byte(&mut self) -> Option<u8> {
        self.outgoing.next()
    }

    /// Sends what nobody asked for, if there is any.
    pub(crate) fn begin_unasked<S: Storage, R: Rtc>(
        &mut self,
        recorder: &mut Recorder<'_, S, R>,
        edges_lost: u32,
    ) {
        self.outgoing = self
            .next_print_line(&recorder.log)
            .or_else(|| self.next_report(recorder))
            .or_else(|| self.next_auto_line(recorder, edges_lost))
            .unwrap_or(Outgoing::Nothing);
    }

    /// The rate to which the line shall change now. A configuration is carried out when its reply
    /// goes out, so that reply is the last message at the old rate.
    pub(crate) fn baud_change(&self, configuration: &Configuration) -> Option<Baud> {
        let drained = matches!(self.outgoing, Outgoing::Nothing);
        (configuration.baud != self.baud && drained).then_some(configuration.baud)
    }

    /// The line has changed its rate.
    pub(crate) fn baud_changed(&mut self, baud: Baud) {
        self.baud = baud;
    }

    fn next_print_line(&mut self, log: &EventLog<'_>) -> Option<Outgoing> {
        while let Some(job) = self.print_jobs.front_mut() {
            let entry_number = job.next;
            match log.entry(entry_number) {
                Some(event) if job.left > 0 => {
                    job.next += 1;
                    job.left -= 1;
                    return Some(Outgoing::Line(PrintLine::event(entry_number, event)));
                }
                _ => {
                    self.print_jobs.pop_front();
                }
            }
        }
        None
    }

    fn next_report<S: Storage, R: Rtc>(
        &self,
        recorder: &mut Recorder<'_, S, R>,
    ) -> Option<Outgoing> {
        if recorder.configuration.auto_report != AutoReport::Rs232 {
            return None;
        }
        let (first, reply) = recorder.report(MAX_ENTRIES)?;
        recorder.reported(first, reply.entries.len());
        Some(Outgoing::Frame(FrameEncoder::new(Reply::Read(reply).to_body())))
    }

    fn next_auto_line<S: Storage, R: Rtc>(
        &mut self,
        recorder: &mut Recorder<'_, S, R>,
        edges_lost: u32,
    ) -> Option<Outgoing> {
        if !recorder.configuration.auto_print {
            self.edges_lost_printed = edges_lost;
            return None;
        }
        let newly_lost = edges_lost - self.edges_lost_printed;
        if newly_lost > 0 {
            self.edges_lost_printed = edges_lost;
            return Some(Outgoing::Line(PrintLine::lost(
                newly_lost,
                b"INPUT CHANGES NOT RECORDED",
            )));
        }
        let overwritten = skip_overwritten(&mut self.print_next, &recorder.log);
        if overwritten > 0 {
            count(&mut recorder.diagnostics.events_unprinted, overwritten);
            let overwritten = u32::try_from(overwritten).unwrap_or(u32::MAX);
            return Some(Outgoing::Line(PrintLine::lost(overwritten, b"EVENTS NOT PRINTED")));
        }
        let entry_number = recorder.log.entry_number(self.print_next)?;
        let event = recorder.log.entry(entry_number)?;
        self.print_next += 1;
        Some(Outgoing::Line(PrintLine::event(entry_number, event)))
    }
}

/// Moves a position in the log to the oldest event that is still there; says how many it passed
/// over.
fn skip_overwritten(next: &mut u64, log: &EventLog<'_>) -> u64 {
    let overwritten = log.oldest_sequence().saturating_sub(*next);
    *next += overwritten;
    overwritten
}
