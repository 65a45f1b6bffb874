//! Standard output that is full or that nobody reads, and text from outside on its way to a
//! terminal.
#![cfg(unix)]

mod common;

use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Read};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::symlink;
use std::process::{Command, Output, Stdio};

use common::{Running, events, ser_cli};
use tempfile::TempDir;

/// Text that a terminal obeys: it clears the screen, sets its title, and reverses text.
const HOSTILE: &str = "\u{1B}[2J\u{1B}]0;x\u{7}\r\u{9B}1m\u{202E}";

/// A simulated recorder with three events, on a pseudo-terminal and on a Genius bus.
struct Unit {
    folder: TempDir,
    _sim: Running,
}

impl Unit {
    fn start() -> Unit {
        let folder = tempfile::tempdir().expect("a folder");
        let contacts = folder.path().join("trip.csv");
        fs::write(&contacts, "ms,input,state\n0,1,1\n1,1,0\n2,2,1\n").expect("written");
        let mut command = ser_cli();
        command.args(["sim", "--node", "5", "--contacts"]).arg(contacts);
        for (option, name) in [("--pty", "unit"), ("--genius", "host")] {
            command.arg(option).arg(folder.path().join(name));
        }
        let mut sim = Running::start(command.stdout(Stdio::piped()).stderr(Stdio::null()));
        let mut first = String::new();
        BufReader::new(sim.0.stdout.take().expect("piped")).read_line(&mut first).expect("a port");
        Unit { folder, _sim: sim }
    }

    fn command(&self, line: &str) -> Command {
        let mut command = ser_cli();
        let port = match line.starts_with("genius") {
            true => format!("geni:{}?node=5", self.folder.path().join("host").display()),
            false => self.folder.path().join("unit").display().to_string(),
        };
        // Each command has its own state, so that new events are new to each.
        let state = tempfile::tempdir_in(self.folder.path()).expect("a folder").keep();
        command.env("SER_PORT", port).env("SER_STATE_DIR", state).args(["--timeout", "20s"]);
        command.args(line.split_whitespace()).stdin(Stdio::null());
        command
    }
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("UTF-8")
}

/// Every way to make it print, except those that go on until Ctrl-C.
const PRINTING: [&str; 27] = [
    "--help",
    "--version",
    "help",
    "help read",
    "read --help",
    "sim -h",
    "ports",
    "completions bash",
    "completions zsh",
    "encode erase",
    "comm-req send --to 5 erase",
    "comm-req dequeue --from 5",
    "status",
    "config",
    "config --auto-print off",
    "clock",
    "clock set",
    "last-broadcast",
    "read",
    "read --new",
    "read --format csv",
    "read --format jsonl",
    "print --from 1 --count 1",
    "genius devices",
    "genius globals",
    "genius forces --node 5 --table input-values",
    "genius broadcast erase",
];

#[test]
fn a_full_disk_is_a_failure_and_a_reader_that_has_gone_is_none() {
    let unit = Unit::start();
    let mut printing = 0;
    for line in PRINTING {
        let printed = unit.command(line).output().expect("ser-cli runs").stdout;
        if printed.is_empty() {
            continue;
        }
        printing += 1;
        let full = File::options().write(true).open("/dev/full").expect("/dev/full");
        let Output { status, stderr, .. } =
            unit.command(line).stdout(full).output().expect("ser-cli runs");
        let told = text(&stderr);
        assert_eq!(status.code(), Some(1), "{line} > /dev/full: {told}");
        assert!(told.contains("cannot write standard output: No space left"), "{line}: {told}");

        let (reader, writer) = io::pipe().expect("a pipe");
        drop(reader);
        let Output { status, stderr, .. } =
            unit.command(line).stdout(writer).output().expect("ser-cli runs");
        let told = text(&stderr);
        assert_eq!(status.code(), Some(0), "{line} | true: {told}");
        assert!(!told.contains("error") && !told.contains("panicked"), "{line}: {told}");
    }
    assert!(printing >= 20, "{printing}");
}

#[test]
fn what_goes_on_until_it_is_stopped_ends_on_a_full_disk() {
    let unit = Unit::start();
    for line in ["demo", "watch", "sim", "sim --tcp 127.0.0.1:0", "genius globals --follow"] {
        let full = File::options().write(true).open("/dev/full").expect("/dev/full");
        let mut command = unit.command(line);
        let mut running = Running::start(command.stdout(full).stderr(Stdio::piped()));
        let told = running.told();
        assert_eq!(running.wait(), Some(1), "{line}");
        let told: Vec<String> = told.iter().collect();
        assert!(
            told.iter().any(|line| line.contains("standard output: No space left")),
            "{line}: {told:?}"
        );
    }
}

#[test]
fn nothing_is_delivered_into_a_closed_output() {
    let unit = Unit::start();
    let state = unit.folder.path().join("state");
    let run = |line: &str| {
        let mut shell = Command::new("sh");
        shell.args(["-c", &format!("exec \"$0\" {line}"), env!("CARGO_BIN_EXE_ser-cli")]);
        shell.env("SER_PORT", unit.folder.path().join("unit")).env("SER_STATE_DIR", &state);
        shell.stdin(Stdio::null()).output().expect("sh runs")
    };
    for line in [
        "read",
        "read --new",
        "watch",
        "print --from 1 --count 1",
        "decode -",
        "completions bash",
        "genius dip 10100111",
        "genius decode 20 00",
    ] {
        let Output { status, stderr, .. } = run(&format!("{line} >&-"));
        assert_eq!(status.code(), Some(1), "{line}");
        assert!(text(&stderr).contains("standard output is closed"), "{line}: {}", text(&stderr));
    }
    // New events are still new.
    let new = "read --new --format jsonl";
    assert_eq!(events(&text(&run(new).stdout)).len(), 3);
    fs::remove_dir_all(&state).expect("removed");
    assert_eq!(run(&format!("{new} > /dev/null")).status.code(), Some(0));
    assert!(events(&text(&run(new).stdout)).is_empty(), "passed over");
}

/// Checks for control characters and for characters that reverse text; line ends are allowed.
fn assert_harmless(what: &str, bytes: &[u8]) {
    let shown = text(bytes);
    let obeyed = |letter: char| letter.is_control() && letter != '\n' || letter == '\u{202E}';
    assert!(!shown.chars().any(obeyed), "{what}: {shown:?}");
}

#[test]
fn names_and_arguments_do_nothing_to_a_terminal() {
    let folder = tempfile::tempdir().expect("a folder");
    let name: &OsStr = HOSTILE.as_ref();
    let file = folder.path().join(name);
    fs::write(&file, "ms,input,state\nx\n").expect("written");
    let link = folder.path().join(format!("{HOSTILE} link"));
    symlink(&file, &link).expect("a link");
    let missing = folder.path().join(format!("{HOSTILE} missing"));
    let no_text = folder.path().join(OsStr::from_bytes(&[HOSTILE.as_bytes(), b"\x9B2J"].concat()));
    let geni = format!("geni:{}?node=5", file.display());
    let words: [&[&OsStr]; 14] = [
        &["decode".as_ref(), no_text.as_ref()],
        &["decode".as_ref(), missing.as_ref()],
        &["sim".as_ref(), "--contacts".as_ref(), file.as_ref()],
        &["sim".as_ref(), "--contacts".as_ref(), missing.as_ref()],
        &["sim".as_ref(), "--pty".as_ref(), link.as_ref()],
        &["sim".as_ref(), "--image".as_ref(), missing.as_ref()],
        &["sim".as_ref(), "--node".as_ref(), "5".as_ref(), "--genius".as_ref(), file.as_ref()],
        &["status".as_ref(), "--port".as_ref(), missing.as_ref()],
        &["status".as_ref(), "--port".as_ref(), geni.as_ref()],
        &[
            "read".as_ref(),
            "--new".as_ref(),
            "--port=COM3".as_ref(),
            "--state-dir".as_ref(),
            file.as_ref(),
        ],
        &[name],
        &["status".as_ref(), name],
        &["read".as_ref(), "--format".as_ref(), name],
        &["read".as_ref(), "--help".as_ref()],
    ];
    for words in words {
        let mut command = ser_cli();
        // Help names the variable, not its value.
        command.env("SER_PORT", HOSTILE).args(words);
        let Output { status, stdout, stderr } = command.output().expect("ser-cli runs");
        let is_help = words.iter().any(|word| *word == "--help");
        assert_eq!(status.code() == Some(0), is_help, "{words:?}: {}", text(&stderr));
        assert_harmless(&format!("{words:?}"), &stdout);
        assert_harmless(&format!("{words:?}"), &stderr);
        let shown = text(&stdout) + &text(&stderr);
        assert!(
            shown.contains(r"\u{202e}") || is_help || words.contains(&"--port=COM3".as_ref()),
            "{words:?}: {shown}"
        );
    }
}

#[test]
fn a_second_line_in_a_name_passes_for_no_message_of_ours() {
    let second = "/none\nhint: run this";
    for words in [&["decode", second][..], &["read", second], &["read", "--all", "--baud", second]]
    {
        let output = ser_cli().args(words).output().expect("ser-cli runs");
        let told = text(&output.stderr);
        assert!(told.contains("/none") && !told.contains("\nhint: run this"), "{told}");
    }
}

#[test]
fn a_script_gets_the_name_of_a_port_letter_by_letter() {
    let folder = tempfile::tempdir().expect("a folder");
    let link = folder.path().join("Prüfstand \u{1B}7");
    let mut command = ser_cli();
    command.arg("sim").arg("--pty").arg(&link);
    let mut sim = Running::start(command.stdout(Stdio::piped()).stderr(Stdio::null()));
    let mut printed = vec![0; link.as_os_str().len()];
    sim.0.stdout.take().expect("piped").read_exact(&mut printed).expect("a port");
    assert_eq!(printed, link.as_os_str().as_bytes());
}
