//! A server of `PostgreSQL` of our own, which may be stopped and killed.

use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use crate::common::wait_until;
use crate::tables::{Tables, of_database};

/// A server in a folder of its own.
pub(crate) struct Server {
    folder: tempfile::TempDir,
    programs: PathBuf,
    port: u16,
}

/// The newest server of those that Debian has installed.
fn programs() -> PathBuf {
    let versions = std::fs::read_dir("/usr/lib/postgresql").expect("PostgreSQL is installed");
    let newest = versions
        .filter_map(|version| {
            let path = version.ok()?.path();
            let number: u32 = path.file_name()?.to_str()?.parse().ok()?;
            Some((number, path.join("bin")))
        })
        .max();
    newest.expect("a version of PostgreSQL").1
}

/// A command, as another user than root: the server refuses to be run by root.
fn unprivileged(program: &Path) -> Command {
    let id = Command::new("id").arg("-u").output().expect("id");
    let mut command = match id.stdout.trim_ascii() {
        b"0" => {
            let mut command = Command::new("runuser");
            command.args(["-u", "postgres", "--"]).arg(program);
            command
        }
        _ => Command::new(program),
    };
    command.current_dir("/");
    command
}

fn done(command: &mut Command) {
    let Output { status, stdout, stderr } = command.output().expect("the program starts");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(status.success(), "{command:?}\n{}{}", text(&stdout), text(&stderr));
}

impl Server {
    pub(crate) fn start() -> Server {
        let folder = tempfile::Builder::new().prefix("ser-trial-").tempdir().expect("a folder");
        let open = std::os::unix::fs::PermissionsExt::from_mode(0o777);
        std::fs::set_permissions(folder.path(), open).expect("our own folder");
        let port = TcpListener::bind("127.0.0.1:0").and_then(|listener| listener.local_addr());
        let port = port.expect("a port").port();
        let server = Server { folder, programs: programs(), port };
        done(
            unprivileged(&server.programs.join("initdb"))
                .args(["--auth", "trust", "--username", "ser", "--no-sync", "--pgdata"])
                .arg(server.data()),
        );
        server.run();
        let mut create = server.psql("postgres");
        done(create.args(["--command", "CREATE DATABASE plant"]));
        server
    }

    fn data(&self) -> PathBuf {
        self.folder.path().join("data")
    }

    pub(crate) fn address(&self) -> String {
        format!("postgres://ser@127.0.0.1:{}/plant", self.port)
    }

    fn psql(&self, database: &str) -> Command {
        let mut command = Command::new(self.programs.join("psql"));
        command.args(["--no-psqlrc", "--quiet", "--set", "ON_ERROR_STOP=1"]);
        command.arg(format!("postgres://ser@127.0.0.1:{}/{database}", self.port));
        command
    }

    /// Starts it, if it is not running.
    pub(crate) fn run(&self) {
        if self.data().join("postmaster.pid").exists() {
            return;
        }
        let folder = self.folder.path();
        let options = format!(
            "-c listen_addresses=127.0.0.1 -c port={} -c fsync=off -k {}",
            self.port,
            folder.display()
        );
        done(
            unprivileged(&self.programs.join("pg_ctl"))
                .args(["start", "--wait", "--timeout", "120", "--options", &options, "--pgdata"])
                .arg(self.data())
                .arg("--log")
                .arg(folder.join("log")),
        );
    }

    /// Stops it: `fast` tells clients, `immediate` is as if the power had failed.
    pub(crate) fn stop(&self, mode: &str) {
        let mut stop = unprivileged(&self.programs.join("pg_ctl"));
        stop.args(["stop", "--wait", "--timeout", "120", "--mode", mode, "--pgdata"]);
        stop.arg(self.data()).stdout(Stdio::null()).stderr(Stdio::null());
        _ = stop.status();
        wait_until("the server stops", || !self.data().join("postmaster.pid").exists());
    }

    /// What is archived there at one moment; `None` while there is no archive.
    pub(crate) fn tables(&self) -> Option<Tables> {
        of_database(|query| {
            let mut psql = self.psql("plant");
            psql.args(["--no-align", "--tuples-only", "--field-separator", "\t", "--command"]);
            let output = psql.arg(query).env("PGOPTIONS", "-c search_path=ser_archive").output();
            let output = output.expect("psql runs");
            let text = String::from_utf8(output.stdout).expect("text");
            let row = |line: &str| line.split('\t').map(str::to_owned).collect();
            output.status.success().then(|| text.lines().map(row).collect())
        })
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.stop("immediate");
        // What the server has made belongs to its user.
        _ = unprivileged(Path::new("rm")).arg("-rf").arg(self.data()).output();
    }
}
