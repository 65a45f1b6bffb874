//! A simulated recorder on a pseudo-terminal, for tests that use the command line as a user does.

use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

use ser_sim::testing::{Kind, image};
use tempfile::TempDir;

use super::{Running, ser_cli, wait_until};

/// A recorder made with `ser-cli sim`, whose contacts are moved through its standard input.
pub(crate) struct Bench {
    pub(crate) folder: TempDir,
    pub(crate) sim: Running,
}

impl Bench {
    pub(crate) fn start(kind: Kind, options: &[&str]) -> Bench {
        let folder = tempfile::tempdir().expect("a folder");
        let mut command = ser_cli();
        command
            .arg("sim")
            .arg("--pty")
            .arg(folder.path().join("unit"))
            .args(["--contacts", "-"])
            .args(options);
        if kind == Kind::Emulated {
            command.arg("--image").arg(image());
        }
        let sim = Running::start(
            command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::null()),
        );
        let bench = Bench { folder, sim };
        wait_until("the link appears", || bench.link().exists());
        bench
    }

    pub(crate) fn link(&self) -> PathBuf {
        self.folder.path().join("unit")
    }

    pub(crate) fn command(&self, arguments: &str) -> Command {
        let mut command = ser_cli();
        command
            .env("SER_PORT", self.link())
            .env("SER_STATE_DIR", self.folder.path().join("state"))
            .args(["--timeout", "20s"])
            .args(arguments.split_whitespace());
        command
    }

    pub(crate) fn run(&self, arguments: &str) -> Output {
        self.command(arguments).output().expect("ser-cli runs")
    }

    /// Standard output of a command that must succeed.
    pub(crate) fn ok(&self, arguments: &str) -> String {
        let output = self.run(arguments);
        assert_eq!(output.status.code(), Some(0), "{arguments}: {}", text(&output.stderr));
        text(&output.stdout)
    }

    /// Standard error of a command that must end with this code and print nothing on standard
    /// output.
    pub(crate) fn fails(&self, code: i32, arguments: &str) -> String {
        let output = self.run(arguments);
        assert_eq!(
            (output.status.code(), text(&output.stdout)),
            (Some(code), String::new()),
            "{arguments}"
        );
        text(&output.stderr)
    }

    /// Moves contacts and waits until that many more entries have been recorded.
    pub(crate) fn contacts(&mut self, lines: &str, entries: usize) {
        let before = self.entries();
        let input = self.sim.0.stdin.as_mut().expect("piped");
        write!(input, "ms,input,state\n{lines}\n\n").expect("the simulator reads");
        wait_until("the contacts have moved", || self.entries() == before + entries);
    }

    pub(crate) fn entries(&self) -> usize {
        let entries: std::collections::BTreeSet<_> = self
            .ok("read --format csv")
            .lines()
            .skip(1)
            .map(|line| line.split(',').next().unwrap_or_default().to_owned())
            // A loss has no entry.
            .filter(|entry| !entry.is_empty())
            .collect();
        entries.len()
    }
}

/// What a command has printed.
pub(crate) fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("UTF-8")
}
