//! What a host on the Genius bus does to the recorder, and what must come of it.

use ser_proto::genius::{FUNCTION_GENIUS, FUNCTION_HORNER, SUBFUNCTION_SER, Subfunction, max_entries};
use ser_proto::{Command, Decoded, FrameDecoder, LastBroadcast, MAX_BODY_LEN, Reply};

use super::bench::Bench;
use super::genius::Genius;
use super::model::Said;
use super::prompt_board::{NUMBER, Outgoing};
use crate::fuzzing::framing::frame_of;

/// Everything that was brought over the bus is dealt with in this time.
const BUS_MS: u32 = 20;

/// A prompt board that is not busy hands a datagram over in the pass of the main loop after the one
/// that saw its flag.
const READ_AFTER_MS: u64 = 1;

/// The longest backlog of reports has gone in this time.
const MAX_REPORTING_MS: u32 = 4_000;

impl Bench<'_, '_> {
    /// The same with a Genius port that is ready.
    pub(super) fn on_bus(mut self) -> Self {
        self.genius = Some(Genius::new(self.model.model));
        self.pass(BUS_MS);
        assert!(self.genius.as_ref().is_some_and(Genius::is_ready));
        self
    }

    /// Lets all reports go out: what is owed depends on what was in force when it happened.
    pub(super) fn await_reports(&mut self) {
        let owes = |genius: &Genius| !genius.owed.is_empty();
        for _ in 0..MAX_REPORTING_MS {
            if !self.genius.as_ref().is_some_and(owes) {
                return;
            }
            self.pass(1);
        }
        panic!("events were not reported");
    }

    /// A command arrives in a datagram. The board raises its flag in the next millisecond.
    pub(super) fn ask_over_bus(&mut self, source: u8, body: &[u8]) {
        if self.genius.is_none() {
            return;
        }
        self.await_reports();
        let arrives_ms = self.tick_ms + 1;
        let most = u8::try_from(max_entries(self.model.model)).expect("at most ten");
        let mut said = self.model.body(body, arrives_ms, most).into_iter();
        if let Ok(Command::SetClock(_)) = Command::parse(body) {
            self.model.set_battery_clock(arrives_ms + READ_AFTER_MS);
        }
        let expected = said.next().map(|said| match said {
            Said::Reply(reply) => {
                reply_to(source, FUNCTION_HORNER, SUBFUNCTION_SER, reply.to_body().to_vec())
            }
            other => panic!("{other:?} is no reply"),
        });
        // Printouts go to the serial line.
        self.expected.extend(said);
        self.genius.iter_mut().for_each(|genius| genius.bring_command(source, false, body));
        self.await_reply(expected.as_ref());
    }

    /// Somebody asks for a force table: none is forced, and the values are those of the inputs.
    pub(super) fn ask_forces(&mut self, source: u8, table: u8) {
        self.await_reports();
        let state = self.global_data();
        let contents = match table {
            0 => vec![0; state.len()],
            2 => state,
            _ => Vec::new(),
        };
        let Some(genius) = &mut self.genius else { return };
        genius.bring_read_io_forces(source, table);
        let code = Subfunction::ReadIoForcesReply.code();
        let reply = reply_to(source, FUNCTION_GENIUS, code, [vec![table], contents].concat());
        self.await_reply(Some(&reply).filter(|_| table <= 3));
    }

    fn await_reply(&mut self, expected: Option<&Outgoing>) {
        for _ in 0..BUS_MS {
            self.pass_ms();
            self.hear();
        }
        assert_eq!(self.expected.pop_front(), None, "the node has not said it");
        let reply = self.genius.as_mut().and_then(|genius| genius.reply.take());
        assert_eq!(reply.as_ref(), expected);
    }

    /// A command arrives in a datagram to everybody, and the recorder says when.
    pub(super) fn broadcast(&mut self, source: u8, body: &[u8]) {
        if self.genius.is_none() {
            return;
        }
        self.await_reports();
        let arrives_ms = self.tick_ms + 1;
        // A board receives its own broadcasts, and the driver drops them.
        let command = if source == NUMBER { None } else { self.model.broadcast(body, arrives_ms) };
        if let Some(Command::SetClock(_)) = command {
            self.model.set_battery_clock(arrives_ms + READ_AFTER_MS);
        }
        let arrived_ms = self.model.now_ms(arrives_ms);
        self.genius.iter_mut().for_each(|genius| genius.bring_command(source, true, body));
        self.await_reply(None);
        let Some(command) = command else { return };
        let told = self.last_broadcast();
        assert_eq!(told.code, command.code().byte());
        let told_ms = i64::from(told.hour) * 3_600_000
            + i64::from(told.minute) * 60_000
            + i64::from(told.second) * 1000
            + i64::from(told.millisecond);
        assert_eq!(told_ms, arrived_ms.rem_euclid(86_400_000), "{told}");
        self.model.last_broadcast = Some(told);
    }

    /// What the recorder says about the last broadcast.
    fn last_broadcast(&mut self) -> LastBroadcast {
        let question = frame_of(&Command::LastBroadcast.to_body());
        for &byte in &question {
            // It may stand in the middle of another frame.
            self.frames_dropped += u32::from(matches!(self.commands.push(byte), Some(Decoded::Dropped(_))));
        }
        self.node.receive(&question);
        let mut decoder = FrameDecoder::<MAX_BODY_LEN>::new();
        let output = self.node.take_output();
        let body = output.iter().find_map(|&byte| match decoder.push(byte) {
            Some(Decoded::Frame(body)) => Some(body.to_vec()),
            _ => None,
        });
        match Reply::parse(&body.expect("a reply")) {
            Ok(Reply::LastBroadcast(Some(told))) => told,
            other => panic!("{other:?}"),
        }
    }

    fn global_data(&self) -> Vec<u8> {
        let state = self.inputs & self.model.model.mask();
        state.to_le_bytes()[..usize::from(self.model.model.inputs()) / 8].to_vec()
    }

    /// Checks what is on the bus in every scan.
    pub(super) fn check_global_data(&mut self) {
        self.pass(BUS_MS);
        if let Some(genius) = &self.genius {
            assert_eq!(genius.global_data(self.model.model), self.global_data());
        }
    }
}

fn reply_to(destination: u8, function: u8, subfunction: u8, data: Vec<u8>) -> Outgoing {
    Outgoing { destination, function, subfunction, data }
}
