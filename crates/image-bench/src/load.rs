//! A recorder at its limit: all inputs change in every millisecond, while hosts on both ports read
//! as fast as they can. Every event is delivered once or reported as overwritten, to each of them.

use std::collections::VecDeque;
use std::time::Duration;

use crate::lockstep::INSTRUCTIONS_PER_MS;
use ser_board::budget::MAX_BITS_PER_SECOND;
use ser_client::LineRate;

use ser_proto::{ClockSource, Command, InputFilter, MAX_SIZE, Model, Reply};

use super::bench::{Bench, Carried, Parts, Setup};
use super::costs::beginnings;
use super::genius::Genius;
use super::lateness::{Lateness, expiry};
use super::program::Program;
use ser_trial::genius_world::REPORT;
use ser_trial::simulation::account::Tally as Told;
use ser_trial::simulation::conversation::{Conversation, Order, Outgoing, Talk};
use ser_trial::simulation::ledger::Ledger;

/// 2000-01-01 00:00, what a clock that has never been set shows at tick 0.
const NEVER_SET_MS: i64 = 946_684_800_000;

/// How many bytes always wait on the line: more than it carries in a millisecond.
const LINE_AHEAD: usize = 4;

/// A byte of noise, which stands outside every frame.
const NOISE: u8 = 0x55;

/// When the GENI boards have started.
const START_LIMIT_MS: u64 = 30_000;

/// How long after the last change hosts have read everything.
const CATCH_UP_MS: u64 = 60_000;

/// The total counts modulo this.
const TOTAL_WRAPS: u64 = 1 << 16;

/// The board with its hosts.
pub struct Load<'p> {
    /// Where the board is.
    pub bench: Bench<'p>,
    ledger: Ledger,
    line: Conversation,
    bus: Conversation,
    outgoing: VecDeque<Command>,
    /// Samples in which contacts have moved.
    changes: u64,
    /// The events that the recorder has counted, by its latest word.
    total: Option<u16>,
    /// When capture interrupts began while nothing happened.
    quiet: Vec<u64>,
    /// What the line carried while contacts moved.
    carried: Carried,
    /// A host that has read everything since then may rest.
    still_since_ms: u64,
}

/// What became of the events of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Account {
    /// Samples that saw a change.
    pub changes: u64,
    /// The total that the recorder gave last, modulo 65536; `None` when it never gave one.
    pub total: Option<u16>,
    /// The host on RS-232, and the one on the bus, each with what it was told and the counts of its
    /// conversation.
    pub hosts: [(&'static str, Told, Talk); 2],
    /// What went over RS-232 while contacts moved.
    pub carried: Carried,
    /// How long it took, in milliseconds, until the hosts had read everything.
    pub lasted_ms: u64,
}

impl Account {
    /// Whether nothing is missing: the recorder has counted each change, and each was delivered or
    /// reported as lost, to each host.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        let all = |told: &Told| told.delivered + told.overwritten == self.changes;
        let total = self.total.map(u64::from);
        total == Some(self.changes % TOTAL_WRAPS) && self.hosts.iter().all(|(_, told, _)| all(told))
    }
}

impl<'p> Load<'p> {
    /// Switches a board on, and waits until both hosts can talk to it.
    ///
    /// # Errors
    /// When the board does not do what it must.
    pub fn start(parts: &Parts, program: &'p Program) -> Result<Load<'p>, String> {
        let mut bench = Bench::start(parts, program, Setup { debounce_ms: 0, genius: true })?;
        while !bench.genius.as_ref().is_some_and(Genius::is_ready) {
            if bench.now_ms() > START_LIMIT_MS {
                return Err("the hosts do not find the recorder on the bus".to_owned());
            }
            bench.pass_ms()?;
        }
        let mut ledger = Ledger::new(Model::Ser320);
        ledger.power_up(
            0,
            (ClockSource::NeverSet, NEVER_SET_MS),
            MAX_SIZE,
            &[InputFilter::OFF; 32],
        );
        let mut line = Conversation::new("RS-232", LineRate::BitsPerSecond(MAX_BITS_PER_SECOND));
        // The recorder also reports every event to the host on the bus.
        line.begin(Order::Ask(Command::Configure(REPORT)), bench.now_ms());
        Ok(Load {
            bench,
            ledger,
            line,
            bus: Conversation::new("Genius", LineRate::Instant).one_at_a_time(),
            outgoing: VecDeque::new(),
            changes: 0,
            total: None,
            quiet: Vec::new(),
            carried: Carried::default(),
            still_since_ms: u64::MAX,
        })
    }

    /// Lets this many milliseconds pass in which nothing changes and nobody says anything. Only
    /// what comes after them counts as load.
    ///
    /// # Errors
    /// When the board does not do what it must.
    pub fn rest_ms(&mut self, ms: u64) -> Result<(), String> {
        self.bench.tell(true);
        (0..ms).try_for_each(|_| self.bench.pass_ms())?;
        self.quiet = beginnings(&self.bench.tally);
        self.bench.tally.begin_anew();
        Ok(())
    }

    /// How late the capture interrupts were, at rest and later, both measured by the earliest of
    /// them.
    #[must_use]
    pub fn lateness(&self) -> [Lateness; 2] {
        let busy = beginnings(&self.bench.tally);
        let expiry = expiry(&[&self.quiet[..], &busy].concat(), INSTRUCTIONS_PER_MS);
        [&self.quiet, &busy].map(|began| Lateness::of(began, expiry, INSTRUCTIONS_PER_MS))
    }

    /// Changes all inputs in every one of this many milliseconds, while both hosts read all the
    /// time.
    ///
    /// # Errors
    /// When the board or a host's account is not as it must be.
    pub fn run_ms(&mut self, ms: u64) -> Result<(), String> {
        let before = self.bench.carried();
        for _ in 0..ms {
            self.pass_ms(true)?;
        }
        let after = self.bench.carried();
        self.carried.to += after.to - before.to;
        self.carried.from += after.from - before.from;
        Ok(())
    }

    fn pass_ms(&mut self, moving: bool) -> Result<(), String> {
        self.bench.pass_ms()?;
        let now_ms = self.bench.now_ms();
        self.talk_on_line(now_ms)?;
        self.talk_on_bus(now_ms)?;
        if moving {
            self.changes += 1;
            self.bench.toggle(u32::MAX);
            self.ledger.contacts_moved(now_ms, u32::MAX);
        }
        self.ledger.settle(now_ms);
        Ok(())
    }

    fn talk_on_line(&mut self, now_ms: u64) -> Result<(), String> {
        let sent = self.bench.take_sent();
        self.line.session().process(Duration::from_millis(now_ms), &sent);
        if let Some(outgoing) = next(&mut self.line, now_ms, self.still_since_ms, &self.ledger)? {
            self.bench.send(&outgoing.frame);
        }
        // The line never rests. Where the board has nothing to answer, it is also asked for the
        // mode. The way back has no room for the answers to more questions, so noise fills the
        // rest.
        if self.bench.waiting() < LINE_AHEAD && self.bench.is_silent() {
            self.bench.send_command(&Command::QueryMode);
        }
        while self.bench.waiting() < LINE_AHEAD {
            self.bench.send(&[NOISE]);
        }
        Ok(())
    }

    fn talk_on_bus(&mut self, now_ms: u64) -> Result<(), String> {
        let Some(genius) = &mut self.bench.genius else { return Ok(()) };
        for body in genius.take_received() {
            if let Ok(Reply::Read(reply)) = Reply::parse(&body) {
                self.total = Some(reply.total);
            }
            self.bus.session().process_body(Duration::from_millis(now_ms), &body);
        }
        if let Some(outgoing) = next(&mut self.bus, now_ms, self.still_since_ms, &self.ledger)? {
            self.outgoing.push_back(outgoing.command);
        }
        if genius.is_ready()
            && let Some(command) = self.outgoing.pop_front()
        {
            genius.send(&command)?;
        }
        Ok(())
    }

    /// Leaves contacts as they are, and lets the hosts read the rest.
    ///
    /// # Errors
    /// When something is missing in the end.
    pub fn settle(mut self) -> Result<Account, String> {
        let still_since_ms = self.bench.now_ms() + 1;
        self.still_since_ms = still_since_ms;
        while ![&self.line, &self.bus].iter().all(|host| host.has_read_since(still_since_ms)) {
            if self.bench.now_ms() > still_since_ms + CATCH_UP_MS {
                return Err(format!(
                    "not read to the end: {}, {}",
                    self.line.describe(),
                    self.bus.describe()
                ));
            }
            self.pass_ms(false)?;
        }
        for host in [&mut self.line, &mut self.bus] {
            host.account_mut().finish_reading(&self.ledger)?;
        }
        if let Some(genius) = &self.bench.genius {
            genius.check()?;
        }
        let told =
            |host: &Conversation| (host.account().name(), host.account().tally(), host.talk());
        Ok(Account {
            changes: self.changes,
            total: self.total,
            hosts: [told(&self.line), told(&self.bus)],
            carried: self.carried,
            lasted_ms: self.bench.now_ms(),
        })
    }
}

/// What a host says next. It reads, and when it has come to the end, it reads on.
fn next(
    host: &mut Conversation,
    now_ms: u64,
    still_since_ms: u64,
    ledger: &Ledger,
) -> Result<Option<Outgoing>, String> {
    let outgoing = host.poll(now_ms, ledger)?;
    if outgoing.is_none() && host.is_resting() && !host.has_read_since(still_since_ms) {
        host.begin(Order::Read, now_ms);
        return host.poll(now_ms, ledger);
    }
    Ok(outgoing)
}
