//! What a host on the Genius bus does to the recorder, and what must come of it.

use ser_proto::genius::{
    FUNCTION_GENIUS, FUNCTION_HORNER, SUBFUNCTION_SER, Subfunction, max_entries,
};
use ser_proto::{
    AutoReport, ClockSource, Command, Decoded, FrameDecoder, LastBroadcast, MAX_BODY_LEN, Reply,
};
use ser_sim::{Scenario, Step};

use super::bench::Bench;
use super::genius::Genius;
use super::model::Said;
use super::prompt_board::{NUMBER, Outgoing};
use crate::fuzzing::framing::frame_of;

/// How soon everything that was brought over the bus is dealt with.
const BUS_MS: u32 = 20;

/// How long a flag takes to be seen. The main loop sees the flag of a datagram in the next
/// millisecond, and a free board that acts at once hands the datagram over in the one after that.
const SEEN_AFTER_MS: u64 = 1;
const READ_AFTER_MS: u64 = 2;

/// How long the main loop may be held up: less than changes wait for a datagram.
const MAX_AWAY_MS: u8 = 200;

/// How soon the longest backlog of reports has gone out.
const MAX_REPORTING_MS: u32 = 4_000;

impl Bench<'_, '_> {
    /// The same bench with a Genius port that is ready.
    pub(super) fn on_bus(mut self, has_line: bool) -> Self {
        self.genius = Some(Genius::new(self.model.model, has_line));
        self.pass(BUS_MS);
        assert!(self.genius.as_ref().is_some_and(Genius::is_ready));
        self
    }

    /// Lets all reports go out, because what is owed depends on the settings at the time of the
    /// event.
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

    /// When a datagram counts as arrived that the board receives now: in the millisecond of its
    /// pulse, or in that of the look that sees its flag.
    fn arrives_ms(&self) -> u64 {
        let has_line = self.genius.as_ref().is_some_and(|genius| genius.has_line);
        self.tick_ms + if has_line { 0 } else { SEEN_AFTER_MS }
    }

    /// The board receives something.
    fn bring(&mut self, bring: impl FnOnce(&mut Genius)) {
        let Some(genius) = &mut self.genius else { return };
        bring(genius);
        genius.pulse(&mut self.node);
    }

    /// A command arrives in a datagram.
    pub(super) fn ask_over_bus(&mut self, source: u8, body: &[u8]) {
        if self.genius.is_none() {
            return;
        }
        self.await_reports();
        // A few milliseconds pass until a command is carried out.
        let depends_on_the_moment = match Command::parse(body) {
            Ok(Command::Diagnostics { .. }) => true,
            Ok(Command::Time { .. } | Command::SetFilter { .. }) => !self.model.is_quiet(),
            _ => false,
        };
        if depends_on_the_moment {
            return;
        }
        let arrives_ms = self.arrives_ms();
        let most = u8::try_from(max_entries(self.model.model)).expect("at most ten");
        let mut said = self.model.body(body, arrives_ms, most).into_iter();
        if let Ok(Command::SetClock(_)) = Command::parse(body) {
            self.model.set_battery_clock(self.tick_ms + READ_AFTER_MS);
            self.model.source = ClockSource::HostOverGenius;
        }
        let expected = said.next().map(|said| match said {
            Said::Reply(reply) => {
                reply_to(source, FUNCTION_HORNER, SUBFUNCTION_SER, reply.to_body().to_vec())
            }
            other => panic!("{other:?} is not a reply"),
        });
        // Printouts go to the serial line.
        self.expected.extend(said);
        self.bring(|genius| genius.bring_command(source, false, body));
        self.await_reply(expected.as_ref());
    }

    /// Somebody asks for a force table. No input is forced, and the values are those of the inputs.
    pub(super) fn ask_forces(&mut self, source: u8, table: u8) {
        self.await_reports();
        let state = self.global_data();
        let contents = match table {
            0 => vec![0; state.len()],
            2 => state,
            _ => Vec::new(),
        };
        if self.genius.is_none() {
            return;
        }
        self.bring(|genius| genius.bring_read_io_forces(source, table));
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
        // It is carried out a few milliseconds later.
        if matches!(Command::parse(body), Ok(Command::SetFilter { .. })) && !self.model.is_quiet() {
            return;
        }
        let expected = self.expect_broadcast(source, body, READ_AFTER_MS);
        self.bring(|genius| genius.bring_command(source, true, body));
        self.await_reply(None);
        self.check_last_broadcast(expected);
    }

    /// The same with the interrupt line while the main loop is held up. The loop comes back after
    /// this long and finds contacts that have moved repeatedly since. A recorder that says
    /// something about each change would say it later than the model, so it must be set to say
    /// nothing.
    pub(super) fn broadcast_while_away(
        &mut self,
        source: u8,
        body: &[u8],
        for_ms: u8,
        contacts: u8,
    ) {
        let is_quiet = self.model.configuration.auto_report == AutoReport::Off
            && !self.model.configuration.auto_print;
        let is_quiet = is_quiet && self.model.has_no_debounce();
        let decides =
            matches!(Command::parse(body), Ok(Command::SetClock(_) | Command::SetMode { .. }));
        if !self.genius.as_ref().is_some_and(|genius| genius.has_line) || !is_quiet || !decides {
            return;
        }
        self.await_reports();
        let away_ms = for_ms % MAX_AWAY_MS;
        let expected = self.expect_broadcast(source, body, u64::from(away_ms) + READ_AFTER_MS);
        self.bring(|genius| genius.bring_command(source, true, body));
        self.stay_away(away_ms, contacts.into());
        self.await_reply(None);
        self.check_last_broadcast(expected);
    }

    /// Contacts move in every millisecond, and the main loop comes back in the last of them.
    fn stay_away(&mut self, for_ms: u8, contacts: u32) {
        let mut steps = Vec::new();
        for at_ms in 0..u64::from(for_ms) {
            self.inputs ^= contacts.rotate_left(u32::from(for_ms));
            self.tick_ms += 1;
            let inputs = self.inputs;
            steps.extend((0..32).map(|index| Step {
                at_ms,
                input: index + 1,
                on: inputs >> index & 1 != 0,
            }));
            assert_eq!(self.model.sample(self.tick_ms, self.inputs), []);
        }
        self.node.play(&Scenario::from_steps(steps));
        self.node.hold_up_to(self.node.now_ms() + u64::from(for_ms));
    }

    /// What the recorder will say about a broadcast that it reads this long from now, if it acts on
    /// the broadcast.
    fn expect_broadcast(
        &mut self,
        source: u8,
        body: &[u8],
        read_after_ms: u64,
    ) -> Option<(Command, i64)> {
        let arrives_ms = self.arrives_ms();
        // A board receives its own broadcasts, and the driver drops them.
        let command = if source == NUMBER { None } else { self.model.broadcast(body, arrives_ms) }?;
        if let Command::SetClock(_) = command {
            self.model.set_battery_clock(self.tick_ms + read_after_ms);
        }
        Some((command, self.model.now_ms(arrives_ms)))
    }

    fn check_last_broadcast(&mut self, expected: Option<(Command, i64)>) {
        let Some((command, arrived_ms)) = expected else { return };
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
            // This frame may stand in the middle of another one.
            self.frames_dropped +=
                u32::from(matches!(self.commands.push(byte), Some(Decoded::Dropped(_))));
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
