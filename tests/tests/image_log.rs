//! What the ARM image writes to its log: nothing that was dropped, refused or lost goes unmentioned.
#![cfg(unix)]

mod image_records;

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
