//! What the ARM image writes to its log. Everything that was dropped, refused or lost is mentioned.
#![cfg(unix)]

mod image_records;

use std::fs;
use std::os::unix::fs::symlink;

use ser_client::{Endpoint, open};
use ser_trial::recorder::Recorder;

#[test]
#[ignore = "needs the emulator and the image: cargo xtask test"]
fn dropped_frames_are_logged_by_cause() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("log");
    let recorder = Recorder::start_logging(&log);
    let endpoint: Endpoint = recorder.port().parse().expect("a port");
    let mut line = open(&endpoint, 9600).expect("the line");
    line.write_all(b"\x1B014546 \x1B01G \x1BFF \x1B015858 \x1B02450045").expect("written");

    let expected = [
        "frames_checksum: 1",
        "frames_not_hex: 1",
        "frames_too_long: 1",
        "commands_unknown: 1",
        "commands_wrong_length: 1",
    ];
    image_records::wait_for(&log, &expected);
}

#[test]
#[ignore = "needs the emulator and the image: cargo xtask test"]
fn log_and_memory_are_those_that_were_opened_whatever_comes_under_their_names() {
    let folder = tempfile::tempdir().expect("a folder");
    let [log, memory, first_log, first_memory, victim] =
        ["log", "memory", "first log", "first memory", "victim"]
            .map(|name| folder.path().join(name));
    fs::write(&victim, "theirs").expect("a file");
    let recorder = Recorder::start_keeping(&memory, &log);
    for (name, first) in [(&log, &first_log), (&memory, &first_memory)] {
        fs::rename(name, first).expect("renamed");
        symlink(&victim, name).expect("a link");
    }
    let logged = fs::metadata(&first_log).expect("the log").len();
    recorder.power_cycle();
    assert_eq!(fs::read_to_string(&victim).expect("a file"), "theirs");
    assert!(
        fs::metadata(&first_log).expect("the log").len() > logged,
        "the board says that it starts"
    );
    assert_eq!(recorder.board().boots(), 2);
}
