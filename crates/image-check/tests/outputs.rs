//! What the program prints on a full disk, for a reader that has gone, with arguments that a
//! terminal would obey, and about files that are not images.
#![cfg(unix)]

#[allow(dead_code, reason = "another test needs the rest")]
mod elf;

use std::fs::{self, File};
use std::io;
use std::process::{Command, Output};

use tempfile::TempDir;

fn image_check(words: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_image-check"));
    command.args(words);
    command
}

/// What is printed about an image for a board.
fn printed(image: &[u8], words: &[&str]) -> (Option<i32>, String, String) {
    let folder = TempDir::new().expect("a folder");
    let file = folder.path().join("image.elf");
    fs::write(&file, image).expect("a file");
    let output = image_check(words).arg(file).output().expect("the program runs");
    let stdout = String::from_utf8(output.stdout.clone()).expect("UTF-8");
    (output.status.code(), stdout, told(&output))
}

fn told(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).expect("UTF-8")
}

#[test]
fn a_full_disk_is_a_failure_and_a_reader_that_has_gone_is_none() {
    let full = File::options().write(true).open("/dev/full").expect("/dev/full");
    let output = image_check(&["--help"]).stdout(full).output().expect("the program runs");
    assert_eq!(output.status.code(), Some(1), "{}", told(&output));
    assert!(
        told(&output).contains("cannot write standard output: No space left"),
        "{}",
        told(&output)
    );

    let (reader, writer) = io::pipe().expect("a pipe");
    drop(reader);
    let output = image_check(&["--help"]).stdout(writer).output().expect("the program runs");
    assert_eq!((output.status.code(), told(&output)), (Some(0), String::new()));
}

#[test]
fn wrong_arguments_are_told_harmlessly_and_the_boards_are_named() {
    for words in [
        &["--board", "\u{9B}2J\u{202E}", "x.elf"][..],
        &["--board", "mps2-an385", "--\u{1B}[2J"],
        &["--board", "mps2-an385"],
        &["x.elf"],
    ] {
        let output = image_check(words).output().expect("the program runs");
        let told = told(&output);
        assert_eq!(output.status.code(), Some(2), "{told}");
        assert!(!told.chars().any(|letter| letter.is_control() && letter != '\n'), "{told:?}");
    }
    let output = image_check(&["--board", "x", "x.elf"]).output().expect("the program runs");
    assert!(told(&output).contains("the boards are mps2-an385, stm32f407"), "{}", told(&output));
}

#[test]
fn what_is_no_image_is_told_with_what_to_try() {
    for file in ["there-is-none\u{1B}[2J.elf", "Cargo.toml"] {
        let mut command = image_check(&["--board", "stm32f407", file]);
        let output =
            command.current_dir(env!("CARGO_MANIFEST_DIR")).output().expect("the program runs");
        let told = told(&output);
        assert_eq!((output.status.code(), &*output.stdout), (Some(1), &b""[..]), "{told}");
        assert!(told.contains("cargo xtask firmware"), "{told}");
        assert!(!told.chars().any(|letter| letter.is_control() && letter != '\n'), "{told:?}");
    }
}

#[test]
fn an_image_that_may_be_flashed_is_shown_as_a_table_and_with_its_paths() {
    let (code, stdout, stderr) = printed(&elf::image(), &["--board", "mps2-an385"]);
    assert_eq!((code, &*stderr), (Some(0), ""), "{stdout}");
    assert!(stdout.contains("stack overflow          ✓ ends in a fault\n"), "{stdout}");
    assert!(stdout.ends_with("image.elf\n"), "{stdout}");

    let (code, with_paths, _) = printed(&elf::image(), &["--board", "mps2-an385", "--stack"]);
    assert_eq!(code, Some(0));
    assert!(with_paths.contains("\n     16  Reset → work\n"), "{with_paths}");
}

#[test]
fn an_image_that_may_not_be_flashed_is_refused_with_its_reasons() {
    let (code, stdout, stderr) = printed(&elf::image(), &["--board", "stm32f407"]);
    assert_eq!(code, Some(1), "{stdout}");
    assert!(
        stdout.contains("the stack ends at 0x20000000, but there is memory below it"),
        "{stdout}"
    );
    assert!(stderr.contains("not to be flashed: stm32f407 (stack overflow, "), "{stderr}");
}
