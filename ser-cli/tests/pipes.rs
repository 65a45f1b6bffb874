//! A pipe may stand wherever a file may, even if nobody writes to it or reads it: the first Ctrl-C
//! ends the wait.
#![cfg(target_os = "linux")]

mod common;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use common::{Running, ser_cli, wait_until};

/// The number of Ctrl-C, as a bit in the masks of the system.
const INTERRUPT: u64 = 1 << 1;

fn pipe(folder: &Path) -> PathBuf {
    let path = folder.join("pipe");
    assert!(Command::new("mkfifo").arg(&path).status().expect("mkfifo runs").success());
    path
}

/// Whether a program already catches Ctrl-C. Before that, Ctrl-C ends it in any case.
fn catches_interrupts(program: &Running) -> bool {
    let status = fs::read_to_string(format!("/proc/{}/status", program.0.id())).expect("a process");
    let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).expect("a mask");
    u64::from_str_radix(caught.trim(), 16).expect("a mask") & INTERRUPT != 0
}

#[test]
fn the_first_ctrl_c_ends_the_wait_for_the_other_end_of_a_pipe() {
    let folder = tempfile::tempdir().expect("a folder");
    let pipe = pipe(folder.path()).display().to_string();
    fs::write(folder.path().join("image"), "").expect("written");
    for arguments in
        ["--contacts PIPE", "--genius host --node 5 --contacts PIPE", "--image image --log PIPE"]
    {
        let mut waiting = ser_cli();
        waiting.arg("sim").args(arguments.replace("PIPE", &pipe).split_whitespace());
        waiting.current_dir(folder.path()).stdout(Stdio::null()).stderr(Stdio::null());
        let mut waiting = Running::start(&mut waiting);
        wait_until("it catches Ctrl-C", || catches_interrupts(&waiting));
        assert_eq!(waiting.interrupt(), Some(0), "{arguments}");
    }
}

#[test]
fn contacts_may_come_through_a_pipe_with_a_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let pipe = pipe(folder.path());
    let mut sim = ser_cli();
    sim.args(["sim", "--contacts"]).arg(&pipe).stdout(Stdio::piped()).stderr(Stdio::null());
    let mut sim = Running::start(&mut sim);
    let lines = sim.lines();
    fs::write(&pipe, "ms,input,state\n0,3,1\n").expect("the simulator reads");
    let port = lines.recv_timeout(ser_sim::testing::PATIENCE).expect("the simulator answers");
    wait_until("the contact has moved", || {
        let read = ser_cli().args(["-p", &port, "read", "--all", "--format", "csv"]).output();
        String::from_utf8_lossy(&read.expect("ser-cli runs").stdout).lines().count() == 2
    });
    assert_eq!(sim.interrupt(), Some(0));
}

#[test]
fn a_pipe_is_no_image() {
    let folder = tempfile::tempdir().expect("a folder");
    let pipe = pipe(folder.path());
    for command in ["sim", "demo"] {
        let output =
            ser_cli().args([command, "--image"]).arg(&pipe).output().expect("ser-cli runs");
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{told}");
        assert!(told.contains("it is not a regular file") && told.contains("hint: "), "{told}");
    }
}

/// What grows or happens may take days. Until then the line would be kept from others.
#[test]
fn who_has_no_reader_any_more_ends_without_anything_happening() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut sim = ser_cli();
    sim.args(["sim", "--tcp", "127.0.0.1:0"]).stdout(Stdio::piped()).stderr(Stdio::null());
    let mut sim = Running::start(&mut sim);
    let port = sim.lines().recv_timeout(ser_sim::testing::PATIENCE).expect("the simulator answers");
    let site = folder.path().join("plant.toml");
    fs::write(&site, format!("site = \"S\"\n[[recorder]]\nname = \"R\"\nport = \"{port}\"\n"))
        .expect("written");
    let site = site.display().to_string();
    for arguments in [
        vec!["-p", &port, "watch"],
        vec!["watch", "--site", &site],
        vec!["-p", &port, "diagnostics", "--every", "1h"],
    ] {
        let mut child = ser_cli();
        child.args(&arguments).env("SER_STATE_DIR", folder.path().join("state"));
        let mut child = Running::start(child.stdout(Stdio::piped()).stderr(Stdio::null()));
        drop(child.0.stdout.take());
        wait_until("it has ended", || child.0.try_wait().expect("a process").is_some());
    }
    assert_eq!(sim.interrupt(), Some(0));
}
