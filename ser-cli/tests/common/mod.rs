//! A running `ser-cli`, for tests that use it as a user does.
#![allow(dead_code, reason = "every test file uses a part of it")]

#[cfg(feature = "archive")]
pub(crate) mod archived;
#[cfg(unix)]
pub(crate) mod bench;
#[cfg(unix)]
pub(crate) mod original;

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::{Duration, Instant};

use ser_sim::testing::PATIENCE;

/// The program as it was built, without the user's settings.
pub(crate) fn ser_cli() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ser-cli"));
    command
        .env_remove("SER_PORT")
        .env_remove("SER_SITE")
        .env_remove("SER_STATE_DIR")
        .env_remove("SER_ARCHIVE")
        .env("NO_COLOR", "1");
    command
}

/// A running `ser-cli`, ended with the test.
pub(crate) struct Running(pub(crate) Child);

impl Running {
    /// Starts it.
    pub(crate) fn start(command: &mut Command) -> Running {
        Running(command.spawn().expect("ser-cli runs"))
    }

    /// Sends a signal, as in `-INT`.
    pub(crate) fn signal(&self, name: &str) {
        let id = self.0.id().to_string();
        assert!(Command::new("kill").args([name, &id]).status().expect("kill runs").success());
    }

    /// Presses Ctrl-C and returns the exit code.
    pub(crate) fn interrupt(&mut self) -> Option<i32> {
        self.signal("-INT");
        self.wait()
    }

    /// Waits for the end; returns the exit code.
    pub(crate) fn wait(&mut self) -> Option<i32> {
        let mut code = None;
        wait_until("ser-cli ends", || {
            code = self.0.try_wait().expect("a child");
            code.is_some()
        });
        code.and_then(|status| status.code())
    }

    /// The lines of standard output, as they come.
    pub(crate) fn lines(&mut self) -> Receiver<String> {
        lines_of(self.0.stdout.take().expect("piped"))
    }

    /// The lines of standard error, as they come.
    pub(crate) fn told(&mut self) -> Receiver<String> {
        lines_of(self.0.stderr.take().expect("piped"))
    }
}

fn lines_of(output: impl Read + Send + 'static) -> Receiver<String> {
    let output = BufReader::new(output);
    let (sender, lines) = channel();
    thread::spawn(move || {
        output.lines().map_while(Result::ok).try_for_each(|line| sender.send(line))
    });
    lines
}

impl Drop for Running {
    /// Politely first: a simulator that is killed leaves its emulator behind.
    fn drop(&mut self) {
        for signal in ["-TERM", "-CONT"] {
            let _ = Command::new("kill")
                .args([signal, &self.0.id().to_string()])
                .stderr(Stdio::null())
                .status();
        }
        let deadline = Instant::now() + PATIENCE;
        while matches!(self.0.try_wait(), Ok(None)) && Instant::now() < deadline {
            thread::sleep(Duration::from_millis(5));
        }
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Whether a file in a state directory holds what is kept of one recorder's clock and lives.
pub(crate) fn is_kept(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    name.starts_with("port-") && name.ends_with(".jsonl")
}

/// The entries and losses among JSON lines, each from its first field of its own on.
pub(crate) fn events(jsonl: &str) -> Vec<String> {
    let own_fields = |line: &str| {
        let kinds = [("entry", "\"entry\":"), ("gap", "\"lost\":")];
        kinds.iter().find_map(|(kind, first)| {
            let rest = line.strip_prefix(&format!("{{\"record\":\"{kind}\","))?;
            Some(format!("{{{}", &rest[rest.find(first)?..]))
        })
    };
    jsonl.lines().filter_map(own_fields).collect()
}

/// Waits for a condition.
pub(crate) fn wait_until(what: &str, mut condition: impl FnMut() -> bool) {
    let deadline = Instant::now() + PATIENCE;
    while !condition() {
        assert!(Instant::now() < deadline, "waited in vain: {what}");
        thread::sleep(Duration::from_millis(5));
    }
}
