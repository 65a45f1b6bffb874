//! A simulated node on a pseudo-terminal: the life of its link, hosts that come and go, rates that do not agree.
#![cfg(unix)]

mod common;

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::time::Duration;

use common::{Terminal, wait_for};
use ser_proto::{AutoReport, Baud, Command, Configure, Model, Reply};
use ser_sim::{Backend, LineRate, NonVolatile, Port, Scenario, SimError, SimOptions, Simulator, Step};

fn on(link: &Path) -> SimOptions {
    SimOptions::new(Model::Ser160, Port::Pty { link: Some(link.to_owned()) })
}

/// A place for a link.
struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Place {
        Place(tempfile::tempdir().unwrap())
    }

    fn link(&self) -> PathBuf {
        self.0.path().join("ser")
    }
}

fn exists(link: &Path) -> bool {
    fs::symlink_metadata(link).is_ok()
}

fn configure(baud: Baud, auto_report: AutoReport) -> Command {
    Command::Configure(Configure {
        size: None,
        baud: Some(baud),
        auto_report,
        report_address: 0,
        auto_print: false,
    })
}

#[test]
fn the_link_is_there_while_the_node_answers() {
    let place = Place::new();
    let link = place.link();
    assert!(!exists(&link));
    let simulator = Simulator::start(on(&link)).unwrap();
    assert_eq!(simulator.port(), link.to_str().unwrap());
    let mut host = Terminal::open(&link, 9600);
    assert!(matches!(host.ask(&Command::QueryMode), Reply::Mode(mode) if mode.recording));
    simulator.stop().unwrap();
    assert!(!exists(&link));
}

#[test]
fn without_a_place_the_link_is_in_a_directory_that_goes_with_it() {
    let simulator = Simulator::start(SimOptions::new(Model::Ser320, Port::Pty { link: None })).unwrap();
    let link = PathBuf::from(simulator.port());
    Terminal::open(&link, 9600).ask(&Command::QueryMode);
    drop(simulator);
    assert!(!exists(link.parent().unwrap()));
}

#[test]
fn the_link_of_a_simulator_that_runs_is_left_to_it() {
    let place = Place::new();
    let link = place.link();
    let first = Simulator::start(on(&link)).unwrap();
    let error = Simulator::start(on(&link)).unwrap_err();
    assert!(matches!(&error, SimError::LinkInUse(path) if *path == link), "{error}");
    Terminal::open(&link, 9600).ask(&Command::QueryMode);
    drop(first);
    Simulator::start(on(&link)).unwrap();
}

#[test]
fn a_link_left_behind_is_replaced_and_anything_else_is_refused() {
    let place = Place::new();
    let link = place.link();
    for stale in ["/dev/pts/4000000", "/nonexistent/terminal"] {
        symlink(stale, &link).unwrap();
        let simulator = Simulator::start(on(&link)).unwrap();
        Terminal::open(&link, 9600).ask(&Command::QueryMode);
        drop(simulator);
        assert!(!exists(&link));
    }

    fs::write(&link, "a report").unwrap();
    let error = Simulator::start(on(&link)).unwrap_err();
    assert!(matches!(&error, SimError::LinkTaken(path) if *path == link), "{error}");
    assert!(error.to_string().contains("exists already"), "{error}");
    assert_eq!(fs::read_to_string(&link).unwrap(), "a report");

    let other = place.0.path().join("link to a file");
    symlink(&link, &other).unwrap();
    assert!(matches!(Simulator::start(on(&other)), Err(SimError::LinkTaken(_))));
    assert!(exists(&other));

    let nowhere = place.0.path().join("no such directory/ser");
    let error = Simulator::start(on(&nowhere)).unwrap_err().to_string();
    assert!(error.contains("no such directory/ser") && error.contains("os error 2"), "{error}");
}

#[test]
fn a_link_that_somebody_else_has_put_there_meanwhile_is_left_alone() {
    let place = Place::new();
    let link = place.link();
    let simulator = Simulator::start(on(&link)).unwrap();
    fs::remove_file(&link).unwrap();
    symlink("/nonexistent/terminal", &link).unwrap();
    drop(simulator);
    assert!(exists(&link));
}

#[test]
fn hosts_come_and_go_and_nothing_waits_for_them_meanwhile() {
    let place = Place::new();
    let simulator = Simulator::start(on(&place.link())).unwrap();
    let mut host = Terminal::open(place.link(), 9600);
    host.ask(&configure(Baud::B9600, AutoReport::Rs232));
    // The reports of what happens without a host go nowhere.
    drop(host);
    let tap = Scenario::from_steps((0..50).map(|index| Step {
        at_ms: index,
        input: 1,
        on: index.is_multiple_of(2),
    }));
    simulator.play(tap).unwrap();
    simulator.wait_played(common::LONG).unwrap();
    for _ in 0..20 {
        let mut host = Terminal::open(place.link(), 9600);
        assert!(matches!(host.ask(&Command::QueryMode), Reply::Mode(_)));
    }
    assert_eq!(simulator.played().len(), 50);
}

#[test]
fn what_the_node_says_by_itself_is_garbage_to_a_host_at_another_rate() {
    let place = Place::new();
    let simulator = Simulator::start(on(&place.link())).unwrap();
    let mut host = Terminal::open(place.link(), 9600);
    host.ask(&configure(Baud::B9600, AutoReport::Rs232));
    host.set_rate(4800);
    simulator.play(Scenario::from_steps([Step { at_ms: 0, input: 1, on: true }])).unwrap();
    let heard = host.read();
    assert!(heard.iter().all(|byte| !byte.is_ascii()), "{heard:02X?}");
}

#[test]
fn a_power_cycle_forgets_the_events_and_keeps_configuration_contacts_and_host() {
    let place = Place::new();
    let simulator = Simulator::start(on(&place.link())).unwrap();
    let mut host = Terminal::open(place.link(), 9600);
    host.ask(&configure(Baud::B19200, AutoReport::Off));
    host.set_rate(19_200);
    simulator.play(Scenario::from_steps([Step { at_ms: 0, input: 7, on: true }])).unwrap();
    simulator.wait_played(common::LONG).unwrap();
    let read = Command::Read { start: 1, count: 1 };
    wait_for("an event", || matches!(host.ask(&read), Reply::Read(reply) if reply.total == 1).then_some(()));
    simulator.power_cycle().unwrap();
    assert!(matches!(host.ask(&read), Reply::Read(reply) if reply.total == 0));
}

#[test]
fn a_node_whose_memory_is_kept_comes_back_as_it_was() {
    let place = Place::new();
    let non_volatile = NonVolatile::new();
    let options = || {
        let mut options = on(&place.link());
        let line_rate = LineRate::Real;
        options.backend = Backend::Native { line_rate, non_volatile: non_volatile.clone() };
        options
    };
    let simulator = Simulator::start(options()).unwrap();
    Terminal::open(place.link(), 9600).ask(&configure(Baud::B4800, AutoReport::Off));
    drop(simulator);
    let _simulator = Simulator::start(options()).unwrap();
    let reply = Terminal::open(place.link(), 4800).ask(&Command::QueryConfiguration);
    assert!(matches!(reply, Reply::Configuration(configuration) if configuration.baud == Baud::B4800));
}

#[test]
fn a_host_that_was_killed_while_it_had_the_terminal_to_itself_does_not_lock_out_the_next() {
    let place = Place::new();
    let _simulator = Simulator::start(on(&place.link())).unwrap();
    let host = Terminal::open(place.link(), 9600);
    rustix::termios::ioctl_tiocexcl(&host.0).unwrap();
    // Closed without giving it back, as the kernel does for a process that is killed.
    drop(host);
    let mut host = wait_for("a terminal that can be opened", || {
        let opened = fs::OpenOptions::new().read(true).write(true).open(place.link());
        opened.is_ok().then(|| Terminal::open(place.link(), 9600))
    });
    assert!(matches!(host.ask(&Command::QueryMode), Reply::Mode(_)));
    assert!(host.read_within(Duration::ZERO).is_none());
}
