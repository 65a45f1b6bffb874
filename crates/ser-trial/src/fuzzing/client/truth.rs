//! Following a log over a line that loses, cuts and damages messages and brings some of them late.

use std::collections::VecDeque;
use std::time::Duration;

use ser_client::{
    Cursor, Delivery, Disturbed, LineRate, LogPosition, LogReader, Lost, Session, Timing,
};
use ser_proto::{Command, Decoded, FrameDecoder, ReadReply, Reply};

use super::truthful_unit::{TruthfulUnit, number_of};
use crate::fuzzing::framing::frame_of;
use crate::fuzzing::script::Script;

const TIMEOUT: Duration = Duration::from_millis(100);

/// Attempts of one request.
const RETRIES: u32 = 2;

/// How many readings in a row may begin anew because the log was changed under them.
const MAX_RESYNCS: u32 = 4;

/// The longest delay of a message. A request may be repeated before the first answer has come.
const LATEST: Duration = Duration::from_millis(150);

/// How many events may lie between two readings for the total to tell their number.
const MAX_UNREAD: u32 = u16::MAX as u32;

/// The total counts modulo this.
const TOTAL_TURNS_AT: u32 = 1 << 16;

/// What has reached the host, in order.
#[derive(Default)]
struct Received {
    /// The event that must come next, unless some are lost.
    next: u32,
    /// Whether the host knows the event before, and therefore finds out when it is gone.
    anchored: bool,
    /// Whether a restart of the log was reported since the latest event.
    restart_told: bool,
    /// How many events were reported as lost since the latest event.
    lost: u32,
    /// Whether the total has wrapped since the latest event, so that it cannot tell how many there
    /// were.
    turned: bool,
    /// Whether the log was erased since the reading began.
    erased_meanwhile: bool,
    /// How often the log was resized since the reading began.
    resized_meanwhile: u32,
    /// Whether the log was resized more than once during one reading, which may spoil the host's
    /// count for good.
    muddled: bool,
}

struct World {
    unit: TruthfulUnit,
    session: Session,
    now: Duration,
    /// What the recorder has said and the line has not brought yet.
    under_way: VecDeque<(Duration, Vec<u8>)>,
    to_unit: FrameDecoder<16>,
    received: Received,
    cursor: Option<Cursor>,
    position: Option<LogPosition>,
}

fn any_size(script: &mut Script<'_>) -> u16 {
    [1, 2, 3, 7, 10, 11, 40, 300][usize::from(script.byte() % 8)]
}

pub(super) fn follow(mut script: Script<'_>) {
    let unit = TruthfulUnit::new(any_size(&mut script), script.word());
    let timing = Timing { timeout: TIMEOUT, retries: RETRIES, line_rate: LineRate::Instant };
    let mut world = World {
        unit,
        session: Session::new(timing),
        now: Duration::ZERO,
        under_way: VecDeque::new(),
        to_unit: FrameDecoder::new(),
        received: Received::default(),
        cursor: None,
        position: None,
    };
    while !script.is_over() && world.unit.happened() < 200_000 {
        match script.byte() % 8 {
            0 => world.record(script.byte().into()),
            1 => world.record(u32::from(script.word()) >> 6),
            // Sometimes enough events to wrap the total, which has 16 bits.
            2 if script.byte() == 7 => world.record(0xFF00),
            2 if script.byte().is_multiple_of(4) => world.erase(),
            2 if script.byte().is_multiple_of(4) => world.resize(any_size(&mut script)),
            3 => world.report(&mut script),
            _ => world.read_new(&mut script),
        }
    }
    // On a line without faults, the rest arrives too.
    world.bring_all();
    world.read_new(&mut Script::new(&[]));
    world.received.assert_complete(&world.unit);
}

impl World {
    fn record(&mut self, count: u32) {
        self.unit.record(count);
        self.received.turned |= self.unit.happened() - self.received.next > MAX_UNREAD;
    }

    /// Somebody erases the log.
    fn erase(&mut self) {
        self.unit.erase();
        self.received.erased_meanwhile = true;
    }

    /// Somebody resizes the log.
    fn resize(&mut self, size: u16) {
        self.unit.resize(size);
        self.received.resized_meanwhile += 1;
        self.received.muddled |= self.received.resized_meanwhile > 1;
    }

    /// Reads from the cursor on, until a reading comes to its end or the line is too bad.
    fn read_new(&mut self, script: &mut Script<'_>) {
        for _ in 0..=MAX_RESYNCS {
            // Reading on beyond the end is a choice of the client's.
            let keeps_up = self.unit.happened() % 2 == 1;
            let mut reader = LogReader::new(self.cursor, self.unit.size()).keeping_up(keeps_up);
            if let Some(position) = self.position.take() {
                reader = reader.starting_near(position);
            }
            let end = self.read_once(&mut reader, script);
            self.cursor = reader.cursor();
            match end {
                Some(Ok(())) => {
                    self.position = Some(reader.summary().position);
                    return;
                }
                None | Some(Err(Disturbed::NoProgress)) => return,
                Some(Err(Disturbed::Changed | Disturbed::WrongSize)) => {}
            }
        }
    }

    /// Makes one reading; `None` when there was no reply.
    fn read_once(
        &mut self,
        reader: &mut LogReader,
        script: &mut Script<'_>,
    ) -> Option<Result<(), Disturbed>> {
        self.session.cancel(self.now);
        self.received.begin_reading();
        let mut first = true;
        loop {
            while self.session.has_room()
                && let Some(request) = reader.request()
            {
                self.session.request(request.into()).expect("there is room");
            }
            if !reader.is_waiting() {
                return Some(Ok(()));
            }
            let reply = self.next_reply(script)?;
            if std::mem::take(&mut first) {
                // The client does the same: such reports only tell what the log is about to be read
                // for.
                self.session.forget_earlier_reports();
            }
            let (received, unit) = (&mut self.received, &self.unit);
            if let Err(disturbed) =
                reader.take(&reply, &mut |delivery| received.take(delivery, unit))
            {
                return Some(Err(disturbed));
            }
        }
    }

    /// The reply to one of the requests over the line, which may do to them all that it can.
    fn next_reply(&mut self, script: &mut Script<'_>) -> Option<ReadReply> {
        loop {
            while let Some(attempt) = self.session.dispatch(self.now) {
                let frame = attempt.frame().to_vec();
                self.arrive_at_unit(&frame, script);
            }
            self.bring();
            match self.session.take_answer() {
                Some(Ok(Reply::Read(reply))) => return Some(reply),
                Some(Ok(other)) => panic!("the answer to a read is {other:?}"),
                Some(Err(_)) => return None,
                None => {}
            }
            let due = self.under_way.front().map(|(at, _)| *at);
            let next = due
                .into_iter()
                .chain(self.session.poll_at())
                .min()
                .expect("a request has a deadline");
            self.now = self.now.max(next);
        }
    }

    fn arrive_at_unit(&mut self, frame: &[u8], script: &mut Script<'_>) {
        if script.byte() % 16 == 15 {
            return;
        }
        for &byte in frame {
            let command = match self.to_unit.push(byte) {
                Some(Decoded::Frame(body)) => {
                    Command::parse(body).expect("a session sends commands")
                }
                _ => continue,
            };
            match script.byte() {
                0..=0xDD => {}
                0xDE => self.resize(any_size(script)),
                0xDF => self.erase(),
                meanwhile => self.record(u32::from(meanwhile - 0xE0)),
            }
            let reply = self.unit.answer(&command);
            self.say(&frame_of(&reply.to_body()), script);
        }
    }

    /// Sends a message over the line, which may lose, damage or delay it.
    fn say(&mut self, frame: &[u8], script: &mut Script<'_>) {
        let mut frame = frame.to_vec();
        let delay = match script.byte() {
            0..=0xBF => Duration::ZERO,
            late => LATEST * u32::from(late - 0xC0) / 63,
        };
        let at = usize::from(script.byte()) * frame.len() / 256;
        match script.byte() {
            0xF8.. => frame.clear(),
            0xF0.. => frame.truncate(at),
            0xE8.. => frame.insert(at, b'~'),
            0xE0.. => {
                frame.splice(0..0, *b"\x1B12 noise\r\n");
            }
            // One wrong digit is always noticed, except in the length.
            0xD8.. if at > 2 => frame[at] = if frame[at] == b'7' { b'8' } else { b'7' },
            0xD0.. if at > 0 => frame[at] = 0x80,
            _ => {}
        }
        self.under_way.push_back((self.now + delay, frame));
    }

    /// Lets the line bring what is due. A serial line keeps the order.
    fn bring(&mut self) {
        while self.under_way.front().is_some_and(|(at, _)| *at <= self.now)
            && let Some((_, frame)) = self.under_way.pop_front()
        {
            self.session.process(self.now, &frame);
        }
    }

    fn bring_all(&mut self) {
        self.now += LATEST;
        self.bring();
    }

    fn report(&mut self, script: &mut Script<'_>) {
        if let Some(report) = self.unit.report(script.byte()) {
            self.say(&frame_of(&Reply::Read(report).to_body()), script);
            self.bring_all();
            self.take_reports();
        }
    }

    /// Takes reports. A report is only a reason to read, and readings may happen without one.
    fn take_reports(&mut self) {
        while self.session.take_unsolicited().is_some() {}
    }
}

impl Received {
    fn begin_reading(&mut self) {
        (self.erased_meanwhile, self.resized_meanwhile) = (false, 0);
    }

    fn take(&mut self, delivery: Delivery, unit: &TruthfulUnit) {
        match delivery {
            _ if self.muddled => {}
            Delivery::Event { entry, .. } => self.take_event(number_of(&entry), unit),
            Delivery::Lost { lost: Lost::LogRestarted, .. } => {
                let erased = unit.log_began(unit.happened()) >= self.next;
                assert!(self.restart_told || self.turned || erased, "nobody has erased the log");
                self.restart_told = true;
                self.anchored = false;
                self.lost = 0;
            }
            Delivery::Lost { lost: Lost::Unrecorded { .. }, .. } => {
                assert!(
                    self.turned || self.erased_meanwhile || self.resized_meanwhile > 0,
                    "everything was recorded"
                );
            }
            Delivery::Lost { lost, .. } => self.lost += lost.known_count(),
        }
    }

    fn take_event(&mut self, number: u32, unit: &TruthfulUnit) {
        assert!(number >= self.next, "{number} comes after {}", self.next - 1);
        let began = unit.log_began(number);
        let unseen = unit.was_full(began) && (self.erased_meanwhile || began >= self.next);
        // A reader that knows no event of this log counts from the log's beginning.
        let from = if self.anchored { self.next } else { began };
        if self.anchored && began >= self.next {
            assert!(unseen, "no word of the erase before {began}");
        }
        let right = match (from + self.lost).abs_diff(number) {
            0 => true,
            wrong => self.turned && wrong.is_multiple_of(TOTAL_TURNS_AT),
        };
        assert!(
            right || unseen,
            "after {from}, {} are told to be lost, and {number} comes",
            self.lost
        );
        self.next = number + 1;
        self.anchored = true;
        (self.restart_told, self.lost, self.turned) = (false, 0, false);
    }

    /// Checks that everything has arrived on a line without faults.
    fn assert_complete(&self, unit: &TruthfulUnit) {
        let is_empty = unit.log_began(unit.happened()) == unit.happened();
        let told = self.restart_told || !self.anchored || self.next == unit.happened();
        assert!(
            self.muddled || if is_empty { told } else { self.next == unit.happened() },
            "of {} events, {} have come",
            unit.happened(),
            self.next,
        );
    }
}
