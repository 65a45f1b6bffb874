//! What the ARM image writes to its log: nothing that was dropped, refused or lost goes unmentioned.
#![cfg(unix)]

use std::fs;
use std::time::{Duration, Instant};

use defmt_decoder::Table;
use ser_client::{Endpoint, open};
use ser_tests::recorder::{PATIENCE, Recorder, image};

/// The records in a log, as text.
fn records(log: &[u8], image: &[u8]) -> Vec<String> {
    let table = Table::parse(image).expect("an ELF file").expect("an image that logs");
    let mut decoder = table.new_stream_decoder();
    decoder.received(log);
    std::iter::from_fn(|| decoder.decode().ok().map(|frame| frame.display_message().to_string())).collect()
}

#[test]
#[ignore = "needs the emulator and the image: cargo xtask test"]
fn dropped_frames_are_logged_by_cause() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("log");
    let recorder = Recorder::start_logging(&log);
    let endpoint: Endpoint = recorder.port().parse().expect("a port");
    let mut line = open(&endpoint, 9600).expect("the line");
    line.write_all(b"\x1B014546 \x1B01G \x1BFF \x1B015858 \x1B02450045").expect("written");

    let image = fs::read(image()).expect("the image");
    let expected = [
        "frames_checksum: 1",
        "frames_not_hex: 1",
        "frames_too_long: 1",
        "commands_unknown: 1",
        "commands_wrong_length: 1",
    ];
    let deadline = Instant::now() + PATIENCE;
    loop {
        let records = records(&fs::read(&log).expect("the log"), &image);
        let missing: Vec<_> =
            expected.iter().filter(|text| !records.iter().any(|record| record == *text)).collect();
        if missing.is_empty() {
            break;
        }
        assert!(Instant::now() < deadline, "{missing:?} is not among {records:?}");
        std::thread::sleep(Duration::from_millis(50));
    }
}
