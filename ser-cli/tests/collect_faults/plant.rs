//! Recorders, their links, and the books: what each of them has really seen, life by life.

use std::net::SocketAddr;
use std::thread;
use std::time::{Duration, Instant};

use oorandom::Rand64;
use ser_client::{Endpoint, Options, Unit};
use ser_proto::{AutoReport, Configure, Model};
use ser_sim::testing::PATIENCE;
use ser_sim::{Played, Port, Scenario, SimOptions, Simulator, Step};

use crate::link::{Link, Wiring};

/// How many inputs each recorder has.
const INPUTS: u8 = 32;

/// A recorder.
pub(crate) struct Recorder {
    pub(crate) name: String,
    pub(crate) size: u16,
    sim: Simulator,
    pub(crate) address: SocketAddr,
    /// How many moves there had been when each life of the log began.
    began: Vec<usize>,
    state: u32,
}

impl Recorder {
    /// A recorder of our own that has nothing in its log.
    fn start(name: String, size: u16) -> Recorder {
        let options = SimOptions {
            keep_played: true,
            ..SimOptions::new(Model::Ser320, Port::tcp("127.0.0.1:0"))
        };
        let sim = Simulator::start(options).expect("a recorder");
        let address = sim.port().trim_start_matches("tcp://").parse().expect("an address");
        let recorder = Recorder { name, size, sim, address, began: vec![0], state: 0 };
        let resized = Configure {
            size: Some(size),
            baud: None,
            auto_report: AutoReport::Off,
            report_address: 0,
            auto_print: false,
        };
        recorder.unit(|unit| unit.configure(resized).is_ok());
        recorder
    }

    /// Does something at the recorder's own port as soon as that is free.
    fn unit(&self, mut act: impl FnMut(&mut Unit) -> bool) {
        let endpoint: Endpoint = self.sim.port().parse().expect("a port");
        let options = Options { timeout: Duration::from_secs(20), retries: 0 };
        let deadline = Instant::now() + PATIENCE;
        loop {
            let mut unit = Unit::open(&endpoint, 9600, options).expect("it listens");
            if act(&mut unit) {
                return;
            }
            assert!(Instant::now() < deadline, "{} is not free", self.name);
            thread::sleep(Duration::from_millis(5));
        }
    }

    /// Lays out so many moves, each of about half of all inputs in one millisecond. The state after
    /// it says which move of which recorder it was.
    pub(crate) fn play(&mut self, random: &mut Rand64, moves: u32, longest_ms: u64) {
        let (mut steps, mut at_ms) = (Vec::new(), 0);
        for _ in 0..moves {
            at_ms += random.rand_range(1..longest_ms + 1);
            let next = random.rand_u64() as u32;
            let changed = self.state ^ next;
            steps.extend((0..INPUTS).filter(|bit| changed >> bit & 1 == 1).map(|bit| Step {
                at_ms,
                input: bit + 1,
                on: next >> bit & 1 == 1,
            }));
            self.state = next;
        }
        self.sim.play(Scenario::from_steps(steps)).expect("it runs");
    }

    /// How many moves have been recorded in this life of the log, as far as they have happened.
    pub(crate) fn moves_of_life(&self) -> usize {
        self.sim.played().len() - self.began.last().copied().unwrap_or(0)
    }

    /// Waits until everything that was laid out has happened.
    pub(crate) fn wait(&self) {
        self.sim.wait_played(PATIENCE).expect("the contacts move");
    }

    pub(crate) fn power_cycle(&mut self) {
        self.wait();
        self.sim.power_cycle().expect("it comes up again");
        self.a_life_begins();
    }

    /// Erases the log at the recorder's own port, which nobody else has.
    pub(crate) fn erase(&mut self) {
        self.wait();
        self.unit(|unit| unit.log_position().is_ok() && unit.erase().is_ok());
        self.a_life_begins();
    }

    fn a_life_begins(&mut self) {
        self.began.push(self.sim.played().len());
    }

    /// What was recorded, life by life. Everything that was laid out must have happened.
    pub(crate) fn books(&self) -> Book {
        let played = self.sim.played();
        let ends = self.began.iter().skip(1).copied().chain([played.len()]);
        let lives = self.began.iter().zip(ends).map(|(&from, to)| played[from..to].to_vec());
        Book { name: self.name.clone(), size: self.size, lives: lives.collect() }
    }
}

/// What a recorder has really seen.
pub(crate) struct Book {
    pub(crate) name: String,
    pub(crate) size: u16,
    pub(crate) lives: Vec<Vec<Played>>,
}

/// Recorders, and a link to each of them for each collector.
pub(crate) struct Plant {
    pub(crate) recorders: Vec<Recorder>,
    pub(crate) links: Vec<Vec<Link>>,
    /// Whether collectors take the recorders for original ones.
    pub(crate) are_original: bool,
}

impl Plant {
    /// Recorders with logs of these sizes, for so many collectors. The links of the first are
    /// plugged in.
    pub(crate) fn start(sizes: &[u16], collectors: usize, are_original: bool) -> Plant {
        let recorders: Vec<Recorder> = sizes
            .iter()
            .enumerate()
            .map(|(place, &size)| Recorder::start(format!("U{}", place + 1), size))
            .collect();
        let link = |recorder: &Recorder| Link::to(recorder.address, are_original);
        let links = (0..collectors).map(|_| recorders.iter().map(link).collect()).collect();
        let plant = Plant { links, recorders, are_original };
        for links in plant.links.iter().skip(1) {
            for link in links {
                link.wire(Wiring { to: None, ..link.wiring() });
            }
        }
        plant
    }

    /// The site file of a collector.
    pub(crate) fn site(&self, collector: usize) -> String {
        let mut site = "site = \"Trial\"\ntime_zone = \"UTC\"\n".to_owned();
        for (recorder, link) in self.recorders.iter().zip(&self.links[collector]) {
            let (name, port) = (&recorder.name, link.port());
            site += &format!("\n[[recorder]]\nname = \"{name}\"\nport = \"{port}\"\n");
            if self.are_original {
                site += &format!("original = true\nlog_size = {}\n", recorder.size);
            }
        }
        site
    }

    /// All cables where they belong, in the links of one collector.
    pub(crate) fn restore(&self, collector: usize) {
        for (place, links) in self.links.iter().enumerate() {
            for (recorder, link) in self.recorders.iter().zip(links) {
                let to = (place == collector).then_some(recorder.address);
                link.wire(Wiring { to, is_open: true, is_original: self.are_original });
            }
        }
    }

    pub(crate) fn books(&self) -> Vec<Book> {
        self.recorders.iter().map(Recorder::books).collect()
    }
}
