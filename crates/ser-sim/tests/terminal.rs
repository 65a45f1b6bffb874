//! A simulated recorder on a pseudo-terminal: the life of its link, hosts that come and go, rates
//! that do not agree.
#![cfg(unix)]

mod common;

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::Duration;

use common::{Terminal, wait_for};
use ser_proto::{AutoReport, Baud, Command, Configure, Model, Reply};
use ser_sim::{
    Backend, LineRate, NonVolatile, Port, Scenario, SimError, SimOptions, Simulator, Step,
};

fn on(link: &Path) -> SimOptions {
    let port = Port::Pty { link: Some(link.to_owned()) };
    SimOptions { keep_played: true, ..SimOptions::new(Model::Ser160, port) }
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
    let simulator =
        Simulator::start(SimOptions::new(Model::Ser320, Port::Pty { link: None })).unwrap();
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
fn whatever_stands_under_the_name_is_refused_unharmed() {
    let place = Place::new();
    let link = place.link();
    fs::write(&link, "a report").unwrap();
    let error = Simulator::start(on(&link)).unwrap_err();
    assert!(matches!(&error, SimError::LinkTaken(path) if *path == link), "{error}");
    assert!(error.to_string().contains("exists already"), "{error}");
    assert_eq!(fs::read_to_string(&link).unwrap(), "a report");

    // Links of others, to a terminal, to a file or to nothing.
    for (name, target) in [
        ("of another program", Path::new("/dev/pts/4000000")),
        ("to a disk that is not there", Path::new("/nonexistent/disk")),
        ("to a file", &link),
    ] {
        let other = place.0.path().join(name);
        symlink(target, &other).unwrap();
        assert!(matches!(Simulator::start(on(&other)), Err(SimError::LinkTaken(_))), "{name}");
        assert_eq!(fs::read_link(&other).unwrap(), target);
    }

    let nowhere = place.0.path().join("no such directory/ser");
    let error = Simulator::start(on(&nowhere)).unwrap_err().to_string();
    assert!(error.contains("no such directory/ser") && error.contains("os error 2"), "{error}");
}

#[test]
fn nothing_beside_the_link_is_touched() {
    let place = Place::new();
    let (lock, precious) = (place.0.path().join("ser.lock"), place.0.path().join("precious"));
    fs::write(&precious, "a password").unwrap();
    // A lock file of a package manager, and one that somebody has planted.
    for plant in [false, true] {
        if plant {
            fs::remove_file(&lock).unwrap();
            symlink(&precious, &lock).unwrap();
        } else {
            fs::write(&lock, "version = 4").unwrap();
        }
        drop(Simulator::start(on(&place.link())).unwrap());
        let expected = if plant { "a password" } else { "version = 4" };
        assert_eq!(fs::read_to_string(&lock).unwrap(), expected);
    }
    assert_eq!(fs::read_dir(place.0.path()).unwrap().count(), 2);
}

#[test]
fn of_simulators_that_start_together_under_different_spellings_one_has_the_link() {
    let place = Place::new();
    fs::create_dir(place.0.path().join("sub")).unwrap();
    let spellings = [place.link(), place.0.path().join("sub/../ser"), place.0.path().join("./ser")];
    for _ in 0..10 {
        let started: Vec<_> = thread::scope(|scope| {
            let starting: Vec<_> = spellings
                .iter()
                .map(|link| scope.spawn(|| Simulator::start(on(link)).ok()))
                .collect();
            starting.into_iter().filter_map(|starting| starting.join().unwrap()).collect()
        });
        assert_eq!(started.len(), 1);
        assert!(matches!(Simulator::start(on(&spellings[1])), Err(SimError::LinkInUse(_))));
        Terminal::open(place.link(), 9600).ask(&Command::QueryMode);
    }
    assert!(!exists(&place.link()));
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
    // Reports of what happens without a host go nowhere.
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
    wait_for("an event", || {
        matches!(host.ask(&read), Reply::Read(reply) if reply.total == 1).then_some(())
    });
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
    assert!(
        matches!(reply, Reply::Configuration(configuration) if configuration.baud == Baud::B4800)
    );
}

#[test]
fn a_host_that_was_killed_while_it_had_the_terminal_to_itself_does_not_lock_out_the_next() {
    let place = Place::new();
    let _simulator = Simulator::start(on(&place.link())).unwrap();
    let host = Terminal::open(place.link(), 9600);
    rustix::termios::ioctl_tiocexcl(&host.0).unwrap();
    // The terminal is closed without being given back, as the kernel does for a process that is
    // killed.
    drop(host);
    let mut host = wait_for("a terminal that can be opened", || {
        let opened = fs::OpenOptions::new().read(true).write(true).open(place.link());
        opened.is_ok().then(|| Terminal::open(place.link(), 9600))
    });
    assert!(matches!(host.ask(&Command::QueryMode), Reply::Mode(_)));
    assert!(host.read_within(Duration::ZERO).is_none());
}
