//! What the simulation prints, on a full disk and for a reader that has gone.
#![cfg(unix)]

use std::fs::File;
use std::io;
use std::process::{Command, Output, Stdio};

fn simulate(line: &str, stdout: impl Into<Stdio>) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_simulate"));
    command.args(line.split_whitespace()).stdout(stdout).output().expect("the simulation runs")
}

#[test]
fn a_full_disk_is_a_failure_and_a_reader_that_has_gone_is_none() {
    for line in ["--help", "--hours 0.001"] {
        let full = File::options().write(true).open("/dev/full").expect("/dev/full");
        let Output { status, stderr, .. } = simulate(line, full);
        let told = String::from_utf8(stderr).expect("UTF-8");
        assert_eq!(status.code(), Some(1), "{line} > /dev/full: {told}");
        assert!(told.contains("cannot write standard output: No space left"), "{line}: {told}");

        let (reader, writer) = io::pipe().expect("a pipe");
        drop(reader);
        let Output { status, stderr, .. } = simulate(line, writer);
        let told = String::from_utf8(stderr).expect("UTF-8");
        assert_eq!((status.code(), told), (Some(0), String::new()), "{line}");
    }
}
