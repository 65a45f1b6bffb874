//! What `xtask` prints on a full disk, for a reader that has gone, and with arguments that a
//! terminal would obey.
#![cfg(unix)]

use std::fs::File;
use std::io;
use std::process::{Command, Output};

fn xtask(line: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_xtask"));
    command.args(line.split_whitespace());
    command
}

#[test]
fn a_full_disk_is_a_failure_and_a_reader_that_has_gone_is_none() {
    for line in ["--help", "--version", "fuzz --help", "fuzz --list"] {
        let full = File::options().write(true).open("/dev/full").unwrap();
        let Output { status, stderr, .. } = xtask(line).stdout(full).output().unwrap();
        let told = String::from_utf8(stderr).unwrap();
        assert_eq!(status.code(), Some(1), "{line} > /dev/full: {told}");
        assert!(told.contains("cannot write standard output: No space left"), "{line}: {told}");

        let (reader, writer) = io::pipe().unwrap();
        drop(reader);
        let Output { status, stderr, .. } = xtask(line).stdout(writer).output().unwrap();
        assert_eq!(
            (status.code(), String::from_utf8(stderr).unwrap()),
            (Some(0), String::new()),
            "{line}"
        );
    }
}

#[test]
fn words_that_a_terminal_would_obey_are_shown() {
    for words in
        [&["\u{1B}[2J"][..], &["fuzz", "\u{1B}[2J"], &["firmware", "--board", "\u{9B}2J\u{202E}"]]
    {
        let Output { status, stderr, .. } = xtask("").args(words).output().unwrap();
        let told = String::from_utf8(stderr).unwrap();
        assert!(!status.success());
        assert!(!told.chars().any(|letter| letter.is_control() && letter != '\n'), "{told:?}");
    }
}
