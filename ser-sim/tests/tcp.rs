//! A simulated node on TCP: one client at a time, slow ones and half-closed ones included.
#![cfg(unix)]

mod common;

use std::io::{Read, Write};
use std::net::Shutdown;

use common::{ask, connect, frame, wait_for};
use ser_proto::{AutoReport, Command, Configure, Model, Reply};
use ser_sim::{Port, Scenario, SimOptions, Simulator, Step};

fn start() -> Simulator {
    Simulator::start(SimOptions::new(Model::Ser320, Port::Tcp { address: "127.0.0.1:0".to_owned() })).unwrap()
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
    let taps =
        Scenario::from_steps((0..2000).map(|ms| Step { at_ms: ms, input: 1, on: ms.is_multiple_of(2) }));
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
    let error = Simulator::start(SimOptions::new(Model::Ser160, Port::Tcp { address: address.clone() }))
        .unwrap_err()
        .to_string();
    assert!(error.contains(&format!("listen on {address}")), "{error}");
}
