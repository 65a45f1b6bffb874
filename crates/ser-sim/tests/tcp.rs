//! A simulated recorder on TCP: one client at a time, slow and half-closed ones included.
#![cfg(unix)]

mod common;

use std::io::{Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use common::{ask, connect, frame, wait_for};
use ser_proto::{AutoReport, Command, Configure, Model, Reply};
use ser_sim::{Notice, Port, Scenario, SimOptions, Simulator, Step};

fn options(address: &str) -> SimOptions {
    SimOptions { keep_played: true, ..SimOptions::new(Model::Ser320, Port::tcp(address)) }
}

fn start() -> Simulator {
    Simulator::start(options("127.0.0.1:0")).unwrap()
}

#[test]
fn a_client_is_answered() {
    let simulator = start();
    assert!(simulator.port().starts_with("tcp://127.0.0.1:"));
    let mut client = connect(simulator.port());
    assert!(matches!(ask(&mut client, &Command::QueryMode), Some(Reply::Mode(_))));
    simulator.stop().unwrap();
    assert_eq!(client.read(&mut [0; 16]).unwrap(), 0);
}

#[test]
fn a_second_client_is_closed_and_the_first_goes_on() {
    let simulator = start();
    let mut first = connect(simulator.port());
    assert!(ask(&mut first, &Command::QueryMode).is_some());
    let mut second = connect(simulator.port());
    assert_eq!(ask(&mut second, &Command::QueryMode), None);
    assert!(ask(&mut first, &Command::QueryMode).is_some());
}

/// A simulator whose silent clients give way after that time, and what it tells its user.
fn start_with_patience(gives_way_after: Option<Duration>) -> (Simulator, Receiver<String>) {
    let (notices, heard) = channel();
    let mut options = options("");
    options.port = Port::Tcp { address: "127.0.0.1:0".to_owned(), gives_way_after };
    options.notice = Some(Notice(Box::new(move |text| drop(notices.send(text.to_owned())))));
    (Simulator::start(options).unwrap(), heard)
}

#[test]
fn a_silent_client_gives_way_to_the_next_and_only_then() {
    const PATIENCE: Duration = Duration::from_millis(200);
    let (simulator, notices) = start_with_patience(Some(PATIENCE));
    let mut silent = connect(simulator.port());
    let asked = Instant::now();
    assert!(ask(&mut silent, &Command::QueryMode).is_some());
    let mut second = connect_until_answered(simulator.port());
    assert!(asked.elapsed() >= PATIENCE);
    assert_eq!(ask(&mut silent, &Command::QueryMode), None);
    assert!(ask(&mut second, &Command::QueryMode).is_some());
    let [silent, second] = [&silent, &second].map(|client| client.local_addr().unwrap());
    let heard =
        wait_for("the notice", || notices.try_iter().find(|notice| notice.contains("gives way")));
    assert!(
        heard.starts_with(&silent.to_string()) && heard.ends_with(&second.to_string()),
        "{heard}"
    );
}

/// Tries until the place is free.
fn connect_until_answered(port: &str) -> TcpStream {
    wait_for("a place", || {
        let mut client = connect(port);
        ask(&mut client, &Command::QueryMode).is_some().then_some(client)
    })
}

#[test]
fn a_client_that_nobody_waits_for_may_be_silent_as_long_as_it_likes() {
    let (simulator, _notices) = start_with_patience(Some(Duration::ZERO));
    let mut silent = connect(simulator.port());
    assert!(ask(&mut silent, &Command::QueryMode).is_some());
    let tap = Scenario::from_steps([Step { at_ms: 100, input: 1, on: true }]);
    simulator.play(tap).unwrap();
    simulator.wait_played(common::LONG).unwrap();
    assert!(ask(&mut silent, &Command::QueryMode).is_some());
}

#[test]
fn the_user_hears_once_who_has_the_line() {
    let (simulator, notices) = start_with_patience(None);
    let mut first = connect(simulator.port());
    assert!(ask(&mut first, &Command::QueryMode).is_some());
    for _ in 0..3 {
        assert_eq!(ask(&mut connect(simulator.port()), &Command::QueryMode), None);
    }
    assert!(ask(&mut first, &Command::QueryMode).is_some());
    let address = first.local_addr().unwrap();
    simulator.stop().unwrap();
    let notices: Vec<String> = notices.iter().collect();
    assert!(
        matches!(&notices[..], [one] if one.ends_with(&format!("{address} has the line"))),
        "{notices:?}"
    );
}

#[test]
fn a_client_that_goes_makes_room_at_once() {
    let simulator = start();
    for _ in 0..200 {
        let mut client = connect(simulator.port());
        client.write_all(&frame(&Command::QueryConfiguration)).unwrap();
        drop(client);
        let mut client = connect(simulator.port());
        assert!(matches!(ask(&mut client, &Command::QueryMode), Some(Reply::Mode(_))));
    }
}

#[test]
fn a_client_that_has_said_its_last_word_still_gets_its_answer() {
    let simulator = start();
    let mut client = connect(simulator.port());
    client.write_all(&frame(&Command::QueryMode)).unwrap();
    client.shutdown(Shutdown::Write).unwrap();
    let mut answer = String::new();
    client.read_to_string(&mut answer).unwrap();
    assert!(answer.starts_with("\x1B034D01"), "{answer:?}");
}

#[test]
fn a_client_that_does_not_read_does_not_stop_the_recorder() {
    let simulator = start();
    let mut client = connect(simulator.port());
    let configure = Configure {
        size: None,
        baud: None,
        auto_report: AutoReport::Off,
        report_address: 0,
        auto_print: true,
    };
    ask(&mut client, &Command::Configure(configure)).unwrap();
    let taps = Scenario::from_steps((0..2000).map(|ms| Step {
        at_ms: ms,
        input: 1,
        on: ms.is_multiple_of(2),
    }));
    simulator.play(taps).unwrap();
    let print = frame(&Command::Print { start: 1, count: 2048 });
    client.set_nonblocking(true).unwrap();
    // Far more output than any socket buffer takes.
    for _ in 0..200 {
        let _ = client.write(&print);
    }
    simulator.wait_played(common::LONG).unwrap();
    drop(client);
    let total = wait_for("the log of the recorder", || {
        let mut client = connect(simulator.port());
        match ask(&mut client, &Command::Read { start: 1, count: 0 }) {
            Some(Reply::Read(reply)) => Some(reply.total),
            _ => None,
        }
    });
    assert_eq!(total, 2000);
}

#[test]
fn an_address_in_use_is_named() {
    let simulator = start();
    let address = simulator.port().strip_prefix("tcp://").unwrap().to_owned();
    let error = Simulator::start(options(&address)).unwrap_err().to_string();
    assert!(error.contains(&format!("listen on {address}")), "{error}");
}
