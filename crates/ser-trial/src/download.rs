//! How long it takes to read a full log over RS-232, beside the least that it could take.
//!
//! The client's own session and log reader talk to the recorder over a line that has its rate in
//! both directions. Time is virtual, so the result is the same on every computer. Everything
//! counts, from the first bit of the first request to the moment in which the last event is
//! delivered.

use std::collections::VecDeque;
use std::time::Duration;

use ser_client::{Delivery, LineRate, LogReader, Session, Summary, Timing};
use ser_proto::{
    AutoReport, Baud, Command, Configure, Entry, MAX_ENTRIES, MAX_SIZE, Model, Reply, encoded_len,
};
use ser_sim::{Ram, Scenario, SimNode, SimNodeOptions, Step};

/// Events before the download. The ring is then full and begins somewhere in its middle.
const EVENTS: u16 = 3000;

const NS_PER_MS: u64 = 1_000_000;

/// Start bit, eight data bits, stop bit.
const BITS_PER_BYTE: u64 = 10;

/// A download of all entries that fit a log.
#[derive(Clone, Debug)]
pub struct Download {
    /// What was read, in order.
    pub entries: Vec<Entry>,
    /// How the reading ended.
    pub summary: Summary,
    /// Bytes of the fewest reply frames that hold the log.
    pub least_bytes: usize,
    /// How long these frames alone take on the line.
    pub least: Duration,
    /// How long it took.
    pub took: Duration,
}

impl Download {
    /// Reads a full log at a rate, with as many requests under way as the client has, or with one.
    ///
    /// # Panics
    /// If the recorder does not answer.
    #[must_use]
    pub fn run(model: Model, baud: Baud, one_at_a_time: bool) -> Download {
        let mut ram = Ram::new();
        let mut host = Host::new(model, &mut ram);
        host.record(EVENTS);
        host.change_rate(baud);
        if one_at_a_time {
            host.session = Session::new(host.session.timing()).one_at_a_time();
        }
        let least_bytes = least_bytes(model);
        let began_ms = host.node.now_ms();
        let (entries, summary) = host.read_all();
        Download {
            entries,
            summary,
            least_bytes,
            least: LineRate::BitsPerSecond(baud.bits_per_second()).time_for(least_bytes),
            took: Duration::from_millis(host.node.now_ms() - began_ms),
        }
    }

    /// What share of the time the replies alone needed, in per cent.
    #[must_use]
    pub fn percent(&self) -> f64 {
        100.0 * self.least.as_secs_f64() / self.took.as_secs_f64()
    }
}

fn least_bytes(model: Model) -> usize {
    let size = usize::from(MAX_SIZE);
    let reply = |entries| encoded_len(model.read_reply_len(entries));
    let rest = size % MAX_ENTRIES;
    size / MAX_ENTRIES * reply(MAX_ENTRIES) + if rest > 0 { reply(rest) } else { 0 }
}

/// The host, and the recorder at the other end of its line.
struct Host<'a> {
    session: Session,
    node: SimNode<'a>,
    /// Bytes on their way to the recorder, and when their stop bits end.
    on_the_way: VecDeque<(u64, u8)>,
    free_ns: u64,
}

impl<'a> Host<'a> {
    fn new(model: Model, ram: &'a mut Ram) -> Host<'a> {
        let options =
            SimNodeOptions { line_rate: ser_sim::LineRate::Real, ..SimNodeOptions::new(model) };
        let node = SimNode::new(options, ram);
        let line_rate = LineRate::BitsPerSecond(node.baud().bits_per_second());
        let timing = Timing { timeout: Duration::from_secs(1), retries: 2, line_rate };
        Host { session: Session::new(timing), node, on_the_way: VecDeque::new(), free_ns: 0 }
    }

    /// Lets events happen, one in each millisecond.
    fn record(&mut self, events: u16) {
        let steps = (0..events).map(|event| Step {
            at_ms: event.into(),
            input: 1,
            on: event.is_multiple_of(2),
        });
        self.node.play(&Scenario::from_steps(steps));
        self.node.advance_to(self.node.now_ms() + u64::from(events) + 1);
    }

    fn change_rate(&mut self, baud: Baud) {
        let configure = Configure {
            size: None,
            baud: Some(baud),
            auto_report: AutoReport::Off,
            report_address: 0,
            auto_print: false,
        };
        self.session.request(Command::Configure(configure)).expect("nothing else is under way");
        let reply = self.next_reply();
        assert!(
            matches!(reply, Reply::Configuration(in_force) if in_force.baud == baud),
            "{reply:?}"
        );
        self.session.set_line_rate(LineRate::BitsPerSecond(baud.bits_per_second()));
        self.node.advance_to(self.node.now_ms() + 100);
    }

    fn read_all(&mut self) -> (Vec<Entry>, Summary) {
        let mut reader = LogReader::new(None, MAX_SIZE);
        let mut entries = Vec::new();
        loop {
            while self.session.has_room()
                && let Some(request) = reader.request()
            {
                self.session.request(request.into()).expect("there is room");
            }
            if !reader.is_waiting() {
                return (entries, reader.summary());
            }
            let Reply::Read(reply) = self.next_reply() else {
                panic!("another answer than to a read")
            };
            let mut take = |delivery| {
                if let Delivery::Event { entry, .. } = delivery {
                    entries.push(entry);
                }
            };
            reader.take(&reply, &mut take).expect("nobody changes the log");
        }
    }

    /// Lets time pass until an answer is there.
    fn next_reply(&mut self) -> Reply {
        loop {
            let now_ms = self.node.now_ms();
            let now = Duration::from_millis(now_ms);
            let said = self.node.output().to_vec();
            self.node.taken(said.len());
            self.session.process(now, &said);
            if let Some(answer) = self.session.take_answer() {
                return answer.expect("an answer");
            }
            while let Some(attempt) = self.session.dispatch(now) {
                let byte_ns =
                    BITS_PER_BYTE * 1_000_000_000 / u64::from(self.node.baud().bits_per_second());
                self.free_ns = self.free_ns.max(now_ms * NS_PER_MS);
                for &byte in attempt.frame() {
                    self.free_ns += byte_ns;
                    self.on_the_way.push_back((self.free_ns, byte));
                }
            }
            self.node.advance_to(now_ms + 1);
            while let Some(&(at_ns, byte)) = self.on_the_way.front()
                && at_ns <= self.node.now_ms() * NS_PER_MS
            {
                self.on_the_way.pop_front();
                self.node.receive(&[byte]);
            }
        }
    }
}
