//! A running `ser-cli collect`, and what may happen to it.

use std::fs::File;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::common::{Running, ser_cli, wait_until};

/// How much faster everything is than in a plant.
const HASTEN: &str = "50";

/// How a collector is started, each time.
pub(crate) struct Order {
    pub(crate) name: String,
    pub(crate) site: PathBuf,
    pub(crate) archive: PathBuf,
    pub(crate) forward: Option<String>,
    /// Everything that it ever tells.
    pub(crate) told: PathBuf,
}

/// A collector, running or not.
pub(crate) struct Collector {
    order: Order,
    running: Option<Running>,
    /// Whether its archive fails it now.
    fails: bool,
    /// Whether its archive has failed it since it was started, so that it may have ended.
    may_end: bool,
}

impl Collector {
    pub(crate) fn new(order: Order) -> Collector {
        Collector { order, running: None, fails: false, may_end: false }
    }

    pub(crate) fn start(&mut self, is_polling: bool) {
        let told = File::options().create(true).append(true).open(&self.order.told);
        let Order { name, site, archive, forward, .. } = &self.order;
        let mut command = ser_cli();
        command.args(["collect", "--hasten", HASTEN, "--timeout", "500ms", "--retries", "1"]);
        command.args(["--name", name]).arg("--site").arg(site).arg("--archive").arg(archive);
        if let Some(address) = forward {
            command.args(["--forward", address]);
        }
        if is_polling {
            command.arg("--poll");
        }
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(told.expect("a file"));
        self.running = Some(Running::start(&mut command));
        self.may_end = self.fails;
    }

    /// Starts it if it is not running, as a service manager does.
    pub(crate) fn ensure(&mut self, is_polling: bool) {
        if self.running.is_none() {
            self.start(is_polling);
        }
    }

    /// Whether its archive fails it from now on.
    pub(crate) fn archive_fails(&mut self, fails: bool) {
        self.fails = fails;
        self.may_end |= fails;
    }

    /// Notices that it has ended by itself, which it may do only where its archive has failed it.
    pub(crate) fn look(&mut self) {
        let Some(running) = &mut self.running else { return };
        if let Some(status) = running.0.try_wait().expect("a child") {
            assert!(self.may_end, "it has ended by itself: {status}\n{}", self.told());
            self.running = None;
        }
    }

    /// Kills it without a word.
    pub(crate) fn kill(&mut self) {
        if let Some(mut running) = self.running.take() {
            _ = running.0.kill();
            _ = running.0.wait();
        }
    }

    /// Asks it to end, which it does by itself.
    pub(crate) fn end(&mut self) {
        self.look();
        let Some(mut running) = self.running.take() else { return };
        _ = Command::new("kill").arg("-TERM").arg(running.0.id().to_string()).status();
        let mut status = None;
        wait_until("the collector ends", || {
            status = running.0.try_wait().expect("a child");
            status.is_some()
        });
        // One that has hardly begun knows no signals yet.
        let is_good = status.is_some_and(|status| status.success() || status.signal() == Some(15));
        assert!(is_good || self.may_end, "{status:?}\n{}", self.told());
    }

    /// Stops it for a while, or lets it go on.
    pub(crate) fn pause(&self, is_paused: bool) {
        if let Some(running) = &self.running {
            let signal = if is_paused { "-STOP" } else { "-CONT" };
            _ = Command::new("kill").arg(signal).arg(running.0.id().to_string()).status();
        }
    }

    /// Everything that it has ever told.
    pub(crate) fn all_told(&self) -> String {
        std::fs::read_to_string(&self.order.told).unwrap_or_default()
    }

    /// The last lines of that.
    pub(crate) fn told(&self) -> String {
        let told = self.all_told();
        let lines: Vec<&str> = told.lines().collect();
        lines[lines.len().saturating_sub(40)..].join("\n")
    }

    pub(crate) fn name(&self) -> &str {
        &self.order.name
    }

    pub(crate) fn archive(&self) -> &Path {
        &self.order.archive
    }
}
