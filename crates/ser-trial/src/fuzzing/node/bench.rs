//! A node in virtual time, and the model beside it.

use std::collections::VecDeque;

use ser_node::Diagnostics;
use ser_proto::{Counter, Counters, Decoded, FrameDecoder, MAX_BODY_LEN, Reply};
use ser_sim::{Scenario, SimNode, Step};

use super::genius::Genius;
use super::model::{Recorder, Said};

/// Bytes of the longest body that a node takes.
const MAX_COMMAND_LEN: usize = 16;

/// Entries in a message on RS-232.
const MAX_ENTRIES: u8 = 10;

/// Virtual time from one power-up to the next. The limit bounds the work.
const MAX_MS: u64 = 20_000;

/// The time in which a node that has something to say sends a byte, at every rate that a slow host
/// allows it.
const SILENCE_MS: u32 = 10;

/// The time after which no change of an input is held back any more.
const MAX_DEBOUNCE_MS: u32 = 2 * u8::MAX as u32;

/// How the host treats the node's bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Host {
    /// Takes each byte at once, so it is certain when each command is carried out.
    Prompt,
    /// Takes bytes when the line has brought them, at the real rate and late.
    Slow,
}

/// The node and its model, under power.
pub(super) struct Bench<'a, 'm> {
    pub(super) node: SimNode<'a>,
    pub(super) model: &'m mut Recorder,
    host: Host,
    pub(super) inputs: u32,
    pub(super) tick_ms: u64,
    /// How many bytes the line carries in a millisecond, where that matters.
    bytes_per_ms: Option<u32>,
    bytes: u32,
    pub(super) commands: FrameDecoder<MAX_COMMAND_LEN>,
    pub(super) frames_dropped: u32,
    line_errors: u32,
    overruns: u32,
    output: FrameDecoder<MAX_BODY_LEN>,
    line: Vec<u8>,
    pub(super) expected: VecDeque<Said>,
    pub(super) genius: Option<Genius>,
    /// Whether what the node says is compared with what is expected.
    compares: bool,
}

impl<'a, 'm> Bench<'a, 'm> {
    pub(super) fn new(
        node: SimNode<'a>,
        model: &'m mut Recorder,
        host: Host,
        inputs: u32,
        bytes_per_ms: Option<u32>,
    ) -> Bench<'a, 'm> {
        Bench {
            node,
            model,
            host,
            inputs,
            tick_ms: 0,
            bytes_per_ms,
            bytes: 0,
            commands: FrameDecoder::new(),
            frames_dropped: 0,
            line_errors: 0,
            overruns: 0,
            output: FrameDecoder::new(),
            line: Vec::new(),
            expected: VecDeque::new(),
            genius: None,
            compares: host == Host::Prompt,
        }
    }

    pub(super) fn inputs(&self) -> u32 {
        self.inputs
    }

    pub(super) fn is_over(&self) -> bool {
        self.tick_ms >= MAX_MS
    }

    /// Lets milliseconds pass.
    pub(super) fn pass(&mut self, ms: u32) {
        for _ in 0..ms {
            self.pass_ms();
            self.listen();
        }
    }

    /// Lets a millisecond pass. The node may be late with what it has to say.
    pub(super) fn pass_ms(&mut self) {
        self.tick_ms += 1;
        self.node.advance_to(self.node.now_ms() + 1);
        for said in self.model.sample(self.tick_ms, self.inputs) {
            match said {
                // Without a port nobody will ever ask for it.
                Said::Owed(entry) => {
                    self.genius.iter_mut().for_each(|genius| genius.owed.push_back(entry));
                }
                said => self.expected.push_back(said),
            }
        }
        if let Some(genius) = &mut self.genius {
            let address = self.model.configuration.report_address;
            genius.serve(&mut self.node, address, |entry| self.model.has_lost(entry));
        }
    }

    /// Moves contacts in the next millisecond.
    pub(super) fn toggle(&mut self, contacts: u32) {
        self.inputs ^= contacts;
        let moved = (0..32).filter(|index| contacts >> index & 1 != 0);
        let steps = moved.map(|index| Step {
            at_ms: 0,
            input: index + 1,
            on: self.inputs >> index & 1 != 0,
        });
        let start_ms = self.node.play(&Scenario::from_steps(steps));
        assert_eq!(start_ms, self.node.now_ms() + 1);
        self.pass(1);
    }

    /// Bytes arrive at the node.
    pub(super) fn receive(&mut self, bytes: &[u8]) {
        self.await_reports();
        for &byte in bytes {
            self.node.receive(&[byte]);
            let is_overrun = self.node.diagnostics().commands_overrun > self.overruns;
            self.overruns = self.node.diagnostics().commands_overrun;
            match self.commands.push(byte) {
                Some(Decoded::Frame(body)) if !is_overrun => {
                    let body = body.to_vec();
                    self.expected.extend(self.model.body(&body, self.tick_ms, MAX_ENTRIES));
                }
                Some(Decoded::Frame(_)) => {
                    assert_eq!(self.host, Host::Slow, "a command found no room");
                }
                Some(Decoded::Dropped(_)) => self.frames_dropped += 1,
                Some(Decoded::Text(_)) | None => {}
            }
            self.listen();
            self.bytes += 1;
            if let Some(per_ms) = self.bytes_per_ms
                && self.bytes.is_multiple_of(per_ms)
            {
                self.pass(1);
            }
        }
    }

    pub(super) fn line_error(&mut self) {
        self.node.line_error();
        self.line_errors += 1;
    }

    /// Takes what the node says, if the host is prompt.
    fn listen(&mut self) {
        if self.host == Host::Prompt {
            self.hear();
            assert_eq!(self.expected.pop_front(), None, "the node has not said it");
        }
    }

    /// Takes what the node has said.
    pub(super) fn hear(&mut self) {
        for byte in self.node.take_output() {
            let said = match self.output.push(byte) {
                None => continue,
                Some(Decoded::Frame(body)) => Said::Reply(Reply::parse(body).expect("a reply")),
                Some(Decoded::Text(b'\n')) => {
                    let line = String::from_utf8(std::mem::take(&mut self.line)).expect("ASCII");
                    Said::Line(line.strip_suffix('\r').expect("CR LF").to_owned())
                }
                Some(Decoded::Text(byte)) => {
                    assert!(
                        byte == b'\r' || (b' '..=b'~').contains(&byte),
                        "{byte:02X}h in a line"
                    );
                    self.line.push(byte);
                    continue;
                }
                Some(Decoded::Dropped(dropped)) => panic!("the node sent {dropped:?}"),
            };
            if !self.compares {
                continue;
            }
            match (self.expected.pop_front(), said) {
                (Some(Said::Counters(first)), Said::Reply(Reply::Diagnostics(page))) => {
                    self.check_counters(first, &page);
                }
                (expected, said) => assert_eq!(Some(said), expected),
            }
        }
    }

    /// Checks a page of counters: it begins where it was asked to, or behind ids that there are not,
    /// and its values are those that the node shows otherwise.
    fn check_counters(&self, first: Counter, page: &Counters) {
        let Diagnostics { edges_lost, parameters_refused, commands_unknown, .. } =
            self.node.diagnostics();
        assert!(page.first >= first);
        for (counter, value) in page.counters() {
            match counter {
                Counter::EDGES_LOST => assert_eq!(value, edges_lost),
                Counter::PARAMETERS_REFUSED => assert_eq!(value, parameters_refused),
                Counter::COMMANDS_UNKNOWN => assert_eq!(value, commands_unknown),
                _ => {}
            }
            if let Some(input) = counter.suppressed_input() {
                assert!(input <= self.model.model.inputs());
                assert_eq!(value, self.model.suppressed(input), "of input {input}");
            }
        }
    }

    /// Checks what was counted.
    pub(super) fn check_diagnostics(&self) {
        if let Some(genius) = &self.genius {
            genius.check_diagnostics();
        }
        let counted = self.node.diagnostics();
        let dropped = counted.frames_interrupted
            + counted.frames_not_hex
            + counted.frames_checksum
            + counted.frames_too_long
            + counted.frames_empty;
        assert_eq!(dropped, self.frames_dropped + self.model.refused.empty);
        assert_eq!(counted.line_errors, self.line_errors);
        assert_eq!((counted.edges_lost, counted.samples_missed, counted.storage_errors), (0, 0, 0));
        if self.host == Host::Prompt {
            let refused = self.model.refused;
            assert_eq!(counted.commands_unknown, refused.unknown);
            assert_eq!(counted.commands_wrong_length, refused.wrong_length);
            assert_eq!(counted.parameters_refused, refused.parameters);
            assert_eq!((counted.events_unprinted, counted.commands_overrun), (0, 0));
            // Over the bus a report takes longer than a small ring keeps its events.
            assert!(counted.events_unreported == 0 || self.genius.is_some());
        }
    }

    /// Waits until the node has said all that it still owes to a slow host. From then on everything
    /// that it says is compared.
    pub(super) fn settle(&mut self) {
        if self.host == Host::Slow {
            // On a busy line, one report may contain changes that debounce accepts one after the
            // other.
            self.pass(MAX_DEBOUNCE_MS);
            while !self.is_silent() {}
            self.expected.clear();
            self.compares = true;
        }
    }

    /// Sends a command, and checks that everything expected is said.
    pub(super) fn ask(&mut self, frame: &[u8]) {
        self.receive(frame);
        while self.host == Host::Slow && !self.is_silent() {}
        assert_eq!(self.expected.pop_front(), None, "the node has not said it");
    }

    /// Lets some time pass. Returns whether the node said nothing in it.
    fn is_silent(&mut self) -> bool {
        let mut silent = true;
        for _ in 0..SILENCE_MS {
            self.pass(1);
            silent &= self.node.output().is_empty();
            self.hear();
        }
        silent
    }
}
