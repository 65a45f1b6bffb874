//! A recorder that says anything.

use std::collections::VecDeque;
use std::time::Duration;

use ser_client::{
    Cursor, Delivery, LineRate, LogPosition, LogReader, MAX_LINE_LEN, RangeReader, Session, Timing,
    Unsolicited,
};
use ser_proto::{Command, Entry, ReadReply, Reply};

use crate::fuzzing::framing::frame_of;
use crate::fuzzing::script::Script;

/// How many messages that nobody asked for may be kept.
const MAX_KEPT: u32 = 4096;

const TIMEOUT: Duration = Duration::from_millis(300);

/// A session and readers that take whatever comes.
struct Talk {
    session: Session,
    now: Duration,
    /// Commands that are not answered yet.
    asked: Vec<Command>,
    readers: Readers,
}

pub(super) fn talk(mut script: Script<'_>) {
    let rate = match script.byte() {
        0 => LineRate::Instant,
        hundreds => LineRate::BitsPerSecond(u32::from(hundreds) * 100),
    };
    let timing = Timing { timeout: TIMEOUT, retries: script.byte().into(), line_rate: rate };
    let readers = Readers::new(&mut script);
    let mut talk =
        Talk { session: Session::new(timing), now: Duration::ZERO, asked: Vec::new(), readers };
    while !script.is_over() {
        talk.act(&mut script);
        talk.check();
    }
}

impl Talk {
    fn act(&mut self, script: &mut Script<'_>) {
        match script.byte() % 8 {
            0 => self.hear(script.run()),
            1 => {
                let len = usize::from(script.byte());
                self.hear(&frame_of(script.take(len)));
            }
            2 => self.session.process_body(self.now, script.run()),
            3 => self.ask(script),
            4 => self.now += Duration::from_millis(script.word().into()),
            5 => {
                self.session.cancel(self.now);
                self.asked.clear();
            }
            6 => self.session.set_line_rate(LineRate::BitsPerSecond(script.word().into())),
            _ => {
                let body = script.run();
                if let Ok(Reply::Read(reply)) = Reply::parse(body) {
                    self.readers.take(reply);
                }
            }
        }
    }

    fn hear(&mut self, bytes: &[u8]) {
        self.session.process(self.now, bytes);
    }

    fn ask(&mut self, script: &mut Script<'_>) {
        let Ok(command) = Command::parse(script.run()) else { return };
        let is_read = matches!(command, Command::Read { .. });
        let may_join = is_read && self.session.has_room();
        let begun = match command {
            Command::SetClock(_) => self.session.request_set_clock(),
            command => self.session.request(command),
        };
        assert_eq!(
            begun.is_ok(),
            self.asked.is_empty() || may_join,
            "one request at a time, unless these are reads"
        );
        if begun.is_ok() {
            self.asked.push(command);
        }
        let only_reads = self.asked.iter().all(|asked| matches!(asked, Command::Read { .. }));
        assert!(
            self.asked.len() <= 1 || (only_reads && self.asked.len() == 2),
            "two reads at most"
        );
    }

    /// Does what is due, and takes what has arrived.
    fn check(&mut self) {
        for sent in 0.. {
            let Some(attempt) = self.session.dispatch(self.now) else { break };
            assert!(sent < self.asked.len(), "each request is sent once at a time");
            let is_it = |asked: &Command| match (asked, attempt.command()) {
                (Command::SetClock(_), command) => matches!(command, Command::SetClock(_)),
                (asked, command) => asked == command,
            };
            assert!(self.asked.iter().any(is_it), "nobody asked for that");
            assert!(attempt.number() >= 1 && attempt.frame().len() >= 7);
        }
        while let Some(answer) = self.session.take_answer() {
            match answer {
                Ok(reply) => self.answered(reply),
                Err(no_reply) => {
                    assert!(self.asked.iter().any(|asked| asked.code() == no_reply.command));
                    assert!(no_reply.attempts >= 1 && !no_reply.diagnosis.to_string().is_empty());
                    self.asked.clear();
                }
            }
        }
        assert_eq!(
            self.session.poll_at().is_some(),
            !self.asked.is_empty(),
            "somebody waits for a request only"
        );
        assert_eq!(self.session.is_idle(), self.asked.is_empty());
        self.take_unasked();
    }

    fn answered(&mut self, reply: Reply) {
        let is_answer = |asked: &Command| match (asked, &reply) {
            (&Command::Read { start, count }, Reply::Read(reply)) => {
                reply.start == start && reply.entries.len() <= usize::from(count)
            }
            (asked, reply) => asked.code() == reply.code(),
        };
        let place = self.asked.iter().position(is_answer).expect("a request");
        self.asked.remove(place);
        if let Reply::Read(reply) = reply {
            self.readers.take(reply);
        }
    }

    fn take_unasked(&mut self) {
        for _ in 0..=MAX_KEPT {
            match self.session.take_unsolicited() {
                None => return,
                Some(Unsolicited::Line(line)) => assert!(line.text.len() <= MAX_LINE_LEN),
                Some(Unsolicited::Report(report)) => self.readers.take(report),
            }
        }
        panic!("more than {MAX_KEPT} messages were kept");
    }
}

/// Readers of a log whose size may be the right one.
struct Readers {
    size: u16,
    keeps_up: bool,
    reader: LogReader,
    /// How many requests of the reader may be under way at once, and the starts of those that are.
    window: usize,
    asked: VecDeque<u16>,
    /// All entries that the reader was shown.
    shown: Vec<Entry>,
    range: RangeReader,
}

/// A sequence for a cursor: small, or larger than any recorder will ever count.
fn sequence(word: u16) -> u64 {
    match word {
        0xFF00.. => u64::MAX - u64::from(word & 0xFF),
        word => word.into(),
    }
}

impl Readers {
    fn new(script: &mut Script<'_>) -> Readers {
        let size = script.word() % 2100;
        let cursor = Cursor { sequence: sequence(script.word()), is_exact: false, anchor: None };
        let choice = script.byte();
        let cursor = (choice % 2 == 1).then_some(cursor);
        let keeps_up = choice >= 0x80;
        let position = LogPosition { total: script.word(), next_slot: script.word() % 2048 };
        Readers {
            size,
            keeps_up,
            reader: LogReader::new(cursor, size).starting_near(position).keeping_up(keeps_up),
            window: usize::from(choice / 2 % 4) + 1,
            asked: VecDeque::new(),
            shown: Vec::new(),
            range: RangeReader::new(script.word(), script.word(), size),
        }
    }

    /// Takes a reply as it is, and as the answer to a pending request.
    fn take(&mut self, reply: ReadReply) {
        let fitting = self.range.request().map_or(reply.start, |request| request.start);
        self.take_range(&ReadReply { start: fitting, ..reply.clone() });
        self.take_new(&reply);
        self.ask();
        let fitting = self.asked.front().copied().unwrap_or(reply.start);
        self.take_new(&ReadReply { start: fitting, ..reply });
    }

    fn ask(&mut self) {
        while self.asked.len() < self.window
            && let Some(request) = self.reader.request()
        {
            assert!(!self.asked.contains(&request.start), "an answer could belong to two requests");
            self.asked.push_back(request.start);
        }
    }

    fn take_new(&mut self, reply: &ReadReply) {
        let before = self.reader.cursor();
        let mut last = None;
        let mut delivered = 0;
        self.asked.retain(|&start| start != reply.start);
        self.shown.extend(&reply.entries);
        let result = self.reader.take(reply, &mut |delivery| {
            if let Delivery::Event { entry_number, entry, .. } = delivery {
                assert!((1..=self.size.clamp(1, 2048)).contains(&entry_number));
                assert!(self.shown.contains(&entry), "an event that nobody told of");
                last = Some(entry);
                delivered += 1;
            }
        });
        match self.reader.cursor() {
            Some(cursor) if delivered > 0 => assert_eq!(cursor.anchor, last),
            // Only in an empty log can a cursor stand without an event.
            cursor => {
                assert!(cursor == before || cursor.is_some_and(|cursor| cursor.anchor.is_none()));
            }
        }
        let summary = self.reader.summary();
        assert!(
            self.reader.pending() <= 2048
                && u32::try_from(delivered).is_ok_and(|now| now <= summary.delivered)
        );
        assert_eq!(self.reader.is_waiting(), !self.asked.is_empty());
        self.ask();
        if result.is_err() || self.asked.is_empty() {
            // Continues where this reading stopped, as a program does.
            self.asked.clear();
            self.shown.clear();
            let reader =
                LogReader::new(self.reader.cursor(), self.size).starting_near(summary.position);
            self.reader = reader.keeping_up(self.keeps_up);
        }
    }

    fn take_range(&mut self, reply: &ReadReply) {
        let before = self.range.delivered();
        let mut delivered = 0;
        self.range.take(reply, &mut |delivery| {
            delivered += u16::from(matches!(delivery, Delivery::Event { .. }));
        });
        assert_eq!(self.range.delivered(), before + delivered);
        let _ = self.range.is_mixed();
    }
}
