//! Contacts from files and streams, played by a recorder that keeps pace with real time.
#![cfg(unix)]

mod common;

use std::io::{self, Read, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use common::{LONG, wait_for};
use ser_proto::Model;
use ser_sim::{Contacts, Notice, Played, Port, Scenario, SimError, SimOptions, Simulator, Step};

fn options(contacts: Contacts) -> SimOptions {
    SimOptions {
        contacts,
        keep_played: true,
        ..SimOptions::new(Model::Ser160, Port::tcp("127.0.0.1:0"))
    }
}

/// A simulator whose contacts come through a pipe.
fn piped() -> (Simulator, io::PipeWriter) {
    let (reader, writer) = io::pipe().unwrap();
    let contacts = Contacts::Stream { name: "standard input".to_owned(), source: Box::new(reader) };
    (Simulator::start(options(contacts)).unwrap(), writer)
}

/// The millisecond of each move in the scenario, and the input numbers that were closed from then
/// on.
fn summary(played: &[Played]) -> Vec<(u64, String)> {
    played.iter().map(|played| (played.at_ms, played.state.to_string())).collect()
}

fn owned(moves: &[(u64, &str)]) -> Vec<(u64, String)> {
    moves.iter().map(|&(at_ms, state)| (at_ms, state.to_owned())).collect()
}

#[test]
fn scenarios_from_a_stream_play_one_after_the_other() {
    let (simulator, mut stream) = piped();
    stream.write_all(b"ms,input,state\n0,1,1\n7,2,1\n\n3,1,0\n\n").unwrap();
    let played =
        wait_for("both scenarios", || Some(simulator.played()).filter(|played| played.len() == 3));
    assert_eq!(summary(&played), owned(&[(0, "1"), (7, "1 2"), (3, "2")]));
    for played in &played {
        assert_eq!(u64::from(played.tick_after), played.start_ms + played.at_ms);
    }
    assert_eq!(played[0].start_ms, played[1].start_ms);
    assert!(played[2].start_ms > played[1].start_ms + 7);

    // A third scenario, once the others are over. The header may come again. The end of the stream
    // also ends the scenario.
    stream.write_all(b"ms,input,state\n0,2,0\n").unwrap();
    drop(stream);
    simulator.wait_played(LONG).unwrap();
    assert_eq!(summary(&simulator.played()[3..]), owned(&[(0, "")]));
}

/// A scenario without end that counts how much of it was taken. Input 1 toggles in every
/// millisecond.
struct Endless {
    lines: Arc<AtomicU64>,
    rest: Vec<u8>,
}

impl Read for Endless {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.rest.len() < buffer.len() {
            let line = self.lines.fetch_add(1, Ordering::Relaxed);
            let text = if line == 0 {
                "ms,input,state\n".to_owned()
            } else {
                format!("{line},1,{}\n", line % 2)
            };
            self.rest.extend(text.bytes());
        }
        buffer.copy_from_slice(&self.rest[..buffer.len()]);
        self.rest.drain(..buffer.len());
        Ok(buffer.len())
    }
}

#[test]
fn a_stream_that_is_faster_than_time_has_to_wait() {
    let lines = Arc::new(AtomicU64::new(0));
    let source = Box::new(Endless { lines: Arc::clone(&lines), rest: Vec::new() });
    let contacts = Contacts::Stream { name: "endless".to_owned(), source };
    let late = Arc::new(Mutex::new(Vec::new()));
    let heard = Arc::clone(&late);
    let notice = Notice(Box::new(move |text| heard.lock().unwrap().push(text.to_owned())));
    let simulator =
        Simulator::start(SimOptions { notice: Some(notice), ..options(contacts) }).unwrap();
    let played = wait_for("a thousand moves", || {
        // This covers the steps that wait for their time, and some reads of 64 KiB.
        assert!(lines.load(Ordering::Relaxed) < 300_000);
        Some(simulator.played()).filter(|played| played.len() >= 1000)
    });
    for (index, played) in (1..).zip(&played) {
        assert_eq!(played.at_ms, index);
        assert_eq!(u64::from(played.tick_after), played.start_ms + index);
    }
    assert_eq!(*late.lock().unwrap(), Vec::<String>::new());
}

#[test]
fn what_nobody_asks_for_is_not_kept() {
    let scenario = Scenario::from_steps([Step { at_ms: 0, input: 1, on: true }]);
    let options = SimOptions { keep_played: false, ..options(Contacts::Scenario(scenario)) };
    let simulator = Simulator::start(options).unwrap();
    simulator.wait_played(LONG).unwrap();
    assert_eq!(simulator.played(), []);
}

#[test]
fn lines_that_come_one_by_one_keep_their_distance() {
    let (simulator, mut stream) = piped();
    for line in ["ms,input,state\n", "0,1,1\n", "1,2,1\n", "2,3,1\n"] {
        stream.write_all(line.as_bytes()).unwrap();
    }
    drop(stream);
    simulator.wait_played(LONG).unwrap();
    assert_eq!(summary(&simulator.played()), owned(&[(0, "1"), (1, "1 2"), (2, "1 2 3")]));
}

#[test]
fn lines_that_come_too_late_move_late_and_are_reported() {
    let (reader, mut stream) = io::pipe().unwrap();
    let contacts = Contacts::Stream { name: "pipe".to_owned(), source: Box::new(reader) };
    let notices = Arc::new(Mutex::new(Vec::new()));
    let heard = Arc::clone(&notices);
    let notice = Notice(Box::new(move |text| heard.lock().unwrap().push(text.to_owned())));
    let simulator =
        Simulator::start(SimOptions { notice: Some(notice), ..options(contacts) }).unwrap();
    stream.write_all(b"ms,input,state\n0,1,1\n").unwrap();
    wait_for("the first contact", || Some(()).filter(|()| simulator.played().len() == 1));
    stream.write_all(b"0,2,1\n\n").unwrap();
    wait_for("the second contact", || Some(()).filter(|()| simulator.played().len() == 2));
    let played = simulator.played();
    assert!(played[1].tick_before > played[0].tick_before);
    let notices = notices.lock().unwrap();
    assert!(
        notices[0].starts_with("contacts came ") && notices[0].ends_with(" and moved late"),
        "{notices:?}"
    );
}

#[test]
fn a_wrong_line_on_a_stream_ends_the_simulation_with_its_number() {
    let (simulator, mut stream) = piped();
    stream.write_all(b"ms,input,state\n0,1,1\n\n# and now\n5,99,1\n").unwrap();
    let error = simulator.wait(&AtomicBool::new(false)).unwrap_err();
    assert_eq!(
        error.to_string(),
        "standard input, line 5: there is no input 99: this model has inputs 1 to 16"
    );
}

#[test]
fn a_file_is_checked_before_anything_starts() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("trip.csv");
    let missing = Contacts::from_path(&path, Model::Ser160).unwrap_err().to_string();
    assert!(missing.contains("trip.csv") && missing.contains("os error 2"), "{missing}");
    std::fs::write(&path, "ms,input,state\n0,17,1\n").unwrap();
    assert!(
        matches!(Contacts::from_path(&path, Model::Ser160), Err(SimError::Scenario(error)) if error.line == 2)
    );
    let contacts = Contacts::from_path(&path, Model::Ser320).unwrap();
    let simulator =
        Simulator::start(SimOptions { model: Model::Ser320, ..options(contacts) }).unwrap();
    simulator.wait_played(LONG).unwrap();
    assert_eq!(summary(&simulator.played()), owned(&[(0, "17")]));
    assert!(matches!(
        Contacts::from_path(Path::new("-"), Model::Ser160),
        Ok(Contacts::Stream { .. })
    ));
}

#[test]
fn a_simulation_that_is_told_to_stop_ends_without_error() {
    let stop = AtomicBool::new(true);
    let mut ready = false;
    ser_sim::run(options(Contacts::None), &stop, |port| ready = port.starts_with("tcp://"))
        .unwrap();
}
