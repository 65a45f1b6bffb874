//! `PostgreSQL` holds archives as well: a server of our own, in a folder of its own, for this test.

use std::net::TcpListener;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use ser_archive::{Access, Archive, Error, Keep, Place};
use ser_evidence::record::Record;

use super::ALL;
use crate::common::{Home, LIFE, at_s, batch, entries, entry};

/// A server that stops when this is dropped.
struct Server {
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
    if id.stdout.trim_ascii() != b"0" {
        return Command::new(program);
    }
    let mut command = Command::new("runuser");
    command.args(["-u", "postgres", "--"]).arg(program);
    command
}

fn done(command: &mut Command) -> Output {
    let output = command.output().expect("the program starts");
    assert!(
        output.status.success(),
        "{command:?}\n{}{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
    output
}

impl Server {
    /// A server with the given settings; `prepare` gets its folder before it starts.
    fn start(settings: &[&str], prepare: impl Fn(&Path)) -> Server {
        let folder = tempfile::Builder::new().prefix("ser-archive-").tempdir().unwrap();
        let open = std::os::unix::fs::PermissionsExt::from_mode(0o777);
        std::fs::set_permissions(folder.path(), open).unwrap();
        let programs = programs();
        let data = folder.path().join("data");
        done(
            unprivileged(&programs.join("initdb"))
                .current_dir("/")
                .args(["--auth", "trust", "--username", "ser", "--no-sync", "--pgdata"])
                .arg(&data),
        );
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        prepare(folder.path());
        let settings: String = settings.iter().map(|setting| format!(" -c {setting}")).collect();
        let options = format!(
            "-c listen_addresses=127.0.0.1 -c port={port} -c fsync=off -k {}{settings}",
            folder.path().display()
        );
        done(
            unprivileged(&programs.join("pg_ctl"))
                .current_dir("/")
                .args(["start", "--wait", "--timeout", "120", "--options", &options, "--pgdata"])
                .arg(&data)
                .arg("--log")
                .arg(folder.path().join("log")),
        );
        Server { folder, programs, port }
    }

    fn address(&self, database: &str) -> String {
        format!("postgres://ser@127.0.0.1:{}/{database}", self.port)
    }

    /// A database of its own.
    fn home(&self, database: &str) -> Home {
        let psql = self.programs.join("psql");
        let command = move |address: &str, sql: &str| {
            let mut command = Command::new(&psql);
            command.args(["--no-psqlrc", "--quiet", "--set", "ON_ERROR_STOP=1"]);
            done(command.args(["--command", sql, address]));
        };
        command(&self.address("postgres"), &format!("CREATE DATABASE {database}"));
        let address = self.address(database);
        let of_ours = address.clone();
        let run = Box::new(move |sql: &str| {
            command(&of_ours, &format!("SET search_path = ser_archive; {sql}"));
        });
        Home::Database { address, run }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let mut stop = unprivileged(&self.programs.join("pg_ctl"));
        stop.current_dir("/").args(["stop", "--mode", "immediate", "--pgdata"]);
        _ = stop.arg(self.folder.path().join("data")).output();
        // What the server has made belongs to its user.
        _ = unprivileged(Path::new("rm")).arg("-rf").arg(self.folder.path().join("data")).output();
    }
}

/// All cases are tried, also if one fails.
#[test]
#[ignore = "needs postgres: cargo xtask test"]
fn every_case_holds_in_a_database_too() {
    let server = Server::start(&[], |_| {});
    let mut failed = Vec::new();
    for (place, (name, case)) in ALL.iter().enumerate() {
        let home = server.home(&format!("case_{place}"));
        if catch_unwind(AssertUnwindSafe(|| case(&home))).is_err() {
            failed.push(*name);
        }
    }
    assert!(failed.is_empty(), "{failed:#?}");
}

/// What a user has as default weakens no promise: what has ended is on the disk, and who waited for
/// others sees what they have written.
#[test]
#[ignore = "needs postgres: cargo xtask test"]
fn other_defaults_of_a_user_change_nothing() {
    let server = Server::start(&[], |_| {});
    let home = server.home("plant");
    home.open().append(&[batch(entries(LIFE, [1]))]).unwrap();
    home.sql(
        "ALTER ROLE ser SET synchronous_commit = off; \
         ALTER ROLE ser SET default_transaction_isolation = 'serializable'; \
         ALTER TABLE entry ADD COLUMN commits text DEFAULT current_setting('synchronous_commit')",
    );
    std::thread::scope(|scope| {
        for part in 1..=4 {
            let mut archive = home.open();
            scope.spawn(move || {
                for number in 1..=20 {
                    archive.append(&[batch(entries(LIFE, [part * 100 + number]))]).unwrap();
                }
            });
        }
    });
    home.sql("ALTER TABLE entry ADD CONSTRAINT durable CHECK (sequence = 1 OR commits = 'on')");
    assert_eq!(home.open().verify().unwrap().1, []);
}

#[test]
#[ignore = "needs postgres: cargo xtask test"]
fn a_lost_connection_is_said_and_another_one_goes_on() {
    let server = Server::start(&[], |_| {});
    let home = server.home("plant");
    let mut archive = home.open();
    archive.append(&[batch(entries(LIFE, 1..=3))]).unwrap();
    home.sql(
        "SELECT pg_terminate_backend(pid, 60000) FROM pg_stat_activity \
         WHERE application_name = 'ser-archive'",
    );
    for _ in 0..2 {
        let error = archive.append(&[batch(entries(LIFE, 4..=5))]).unwrap_err();
        assert!(matches!(error, Error::Lost { .. }), "{error:?}");
        assert!(error.may_pass());
    }
    let appended = home.open().append(&[batch(entries(LIFE, 1..=5))]).unwrap()[0];
    assert_eq!((appended.entries, appended.known), (2, 3));
}

#[test]
#[ignore = "needs postgres: cargo xtask test"]
fn within_an_async_runtime_it_is_refused() {
    let server = Server::start(&[], |_| {});
    let place: Place = server.address("postgres").parse().unwrap();
    let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
    let opened = runtime.block_on(async { Archive::open(&place, Access::Read) });
    let text = opened.err().expect("refused").to_string();
    assert!(text.contains("async"), "{text}");
}

#[test]
#[ignore = "needs postgres: cargo xtask test"]
fn what_conflicts_take_counts_as_well() {
    let server = Server::start(&[], |_| {});
    let home = server.home("plant");
    let mut archive = home.open();
    for state in 0..2000 {
        let mut other = entry(LIFE, 1);
        other.entry.state.0 = state;
        archive.append(&[batch(vec![Record::Entry(other)])]).unwrap();
    }
    // The one entry alone takes no more than this.
    let keep = Keep { since: None, bytes: Some(200_000) };
    let gone = archive.expire(keep, at_s(1)).unwrap();
    assert!((500..2000).contains(&gone.entries), "{gone:?}");
    assert_eq!(archive.verify().unwrap().1, []);
}

/// Makes an authority, and a certificate of it for this computer, which the server may read.
fn make_certificates(folder: &Path) {
    let authority = Certified::authority();
    let server = Certified::of(&authority, "localhost");
    std::fs::write(folder.join("ca.pem"), authority.certificate.pem()).unwrap();
    std::fs::write(folder.join("other.pem"), Certified::authority().certificate.pem()).unwrap();
    // Nobody but the server may read its key, and in `data` everything is the server's.
    let write = |name: &str, text: &str| {
        let file = folder.join(name);
        std::fs::write(&file, text).unwrap();
        done(unprivileged(Path::new("cp")).arg(&file).arg(folder.join("data").join(name)));
        done(unprivileged(Path::new("chmod")).arg("600").arg(folder.join("data").join(name)));
    };
    write("server.crt", &server.certificate.pem());
    write("server.key", &server.key.serialize_pem());
}

struct Certified {
    certificate: rcgen::Certificate,
    key: rcgen::KeyPair,
    parameters: rcgen::CertificateParams,
}

impl Certified {
    fn authority() -> Certified {
        let mut parameters = rcgen::CertificateParams::new(Vec::new()).unwrap();
        parameters.is_ca = rcgen::IsCa::Ca(rcgen::BasicConstraints::Unconstrained);
        let key = rcgen::KeyPair::generate().unwrap();
        let certificate = parameters.self_signed(&key).unwrap();
        Certified { certificate, key, parameters }
    }

    fn of(authority: &Certified, name: &str) -> Certified {
        let parameters = rcgen::CertificateParams::new(vec![name.to_owned()]).unwrap();
        let key = rcgen::KeyPair::generate().unwrap();
        let issuer = rcgen::Issuer::from_params(&authority.parameters, &authority.key);
        let certificate = parameters.signed_by(&key, &issuer).unwrap();
        Certified { certificate, key, parameters }
    }
}

#[test]
#[ignore = "needs postgres: cargo xtask test"]
fn only_a_server_that_is_known_is_believed() {
    let server = Server::start(&["ssl=on"], make_certificates);
    let file = |name: &str| server.folder.path().join(name).display().to_string();
    let open = |host: &str, authority: &str| {
        let (port, authority) = (server.port, file(authority));
        let address = format!(
            "postgres://ser@{host}:{port}/postgres?sslmode=verify-full&sslrootcert={authority}"
        );
        let place: Place = address.parse().unwrap();
        Archive::open(&place, Access::Write { program: "a test" })
    };
    let mut archive = open("localhost", "ca.pem").unwrap();
    archive.append(&[batch(entries(LIFE, 1..=3))]).unwrap();
    let refused = |host, authority| open(host, authority).err().expect("refused").to_string();
    let unknown = refused("localhost", "other.pem");
    assert!(unknown.contains("invalid peer certificate"), "{unknown}");
    let another = refused("127.0.0.1", "ca.pem");
    assert!(another.contains("not valid for name"), "{another}");
}
