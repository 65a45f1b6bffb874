//! The records in the ARM image's log, as text.

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use defmt_decoder::{DecodeError, Table};
use ser_sim::testing::{PATIENCE, image};

/// Waits until the log holds all of the expected records, possibly among others.
///
/// # Panics
/// When that takes too long.
pub(crate) fn wait_for(log: &Path, expected: &[&str]) {
    let image = fs::read(image()).expect("the image");
    let deadline = Instant::now() + PATIENCE;
    loop {
        let records = records(&fs::read(log).expect("the log"), &image);
        let missing: Vec<_> =
            expected.iter().filter(|text| !records.iter().any(|record| record == *text)).collect();
        if missing.is_empty() {
            return;
        }
        assert!(Instant::now() < deadline, "{missing:?} is not among {records:#?}");
        std::thread::sleep(Duration::from_millis(50));
    }
}

fn records(log: &[u8], image: &[u8]) -> Vec<String> {
    let table = Table::parse(image).expect("an ELF file").expect("an image that logs");
    let mut decoder = table.new_stream_decoder();
    decoder.received(log);
    let mut records = Vec::new();
    loop {
        match decoder.decode() {
            Ok(frame) => records.push(frame.display_message().to_string()),
            // A reset cuts short the record that is being written.
            Err(DecodeError::Malformed) => {}
            Err(DecodeError::UnexpectedEof) => return records,
        }
    }
}
