//! From an address to a connection: who, where, with which password, and how encrypted.

use std::env;
use std::path::{Path, PathBuf};
use std::time::Duration;

use tokio_postgres::config::{Host, SslMode};
use tokio_postgres::{Client, Config, NoTls};

use super::tls;
use crate::error::{Error, Result};

/// How long a server may take to answer.
const PATIENCE: Duration = Duration::from_secs(10);

/// After how much silence the other side is asked whether it is still there.
const SILENCE: Duration = Duration::from_secs(30);

/// Everything that a connection needs.
pub(super) struct Login {
    config: Config,
    encryption: Encryption,
    address: String,
}

/// What is demanded of the way to the server.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Encryption {
    None,
    /// The certificate comes from this file, or from an authority that the system believes.
    Verified(Option<PathBuf>),
}

impl Login {
    /// From an address without a password.
    pub(super) fn of(address: &str) -> Result<Login> {
        let wrong =
            |what: String| Error::Database { archive: address.to_owned(), source: what.into() };
        let Options { bare, mode, authority } = Options::of(address);
        let mut config: Config = bare.parse().map_err(|error: tokio_postgres::Error| {
            wrong(format!("this is no address: {}", super::said(&error)))
        })?;
        config.connect_timeout(PATIENCE).application_name("ser-archive");
        notice_a_dead_network(&mut config);
        // Where both are said, the number is where it goes, whatever the name.
        let is_near = config.get_hosts().iter().all(is_on_this_computer)
            && config.get_hostaddrs().iter().all(std::net::IpAddr::is_loopback);
        let encryption = match mode.as_deref() {
            Some("disable") => Encryption::None,
            // Without a word, passwords and records leave the computer only to a server that is known.
            None if is_near => Encryption::None,
            None | Some("require" | "verify-ca" | "verify-full") => Encryption::Verified(authority),
            Some(other) => {
                return Err(wrong(format!(
                    "sslmode={other} is not offered: disable, or verify-full"
                )));
            }
        };
        config.ssl_mode(match encryption {
            Encryption::None => SslMode::Disable,
            Encryption::Verified(_) => SslMode::Require,
        });
        if let Some(password) = password(&config).map_err(wrong)? {
            config.password(password);
        }
        Ok(Login { config, encryption, address: address.to_owned() })
    }

    /// Connects. What the connection does meanwhile is done while somebody waits for an answer.
    pub(super) async fn connect(&self) -> Result<Client> {
        let failed = |error: &tokio_postgres::Error| super::failed(&self.address, error);
        match &self.encryption {
            Encryption::None => {
                let connected = self.config.connect(NoTls).await;
                let (client, connection) = connected.map_err(|error| failed(&error))?;
                tokio::spawn(connection);
                Ok(client)
            }
            Encryption::Verified(authority) => {
                let tls = tls::connector(authority.as_deref()).map_err(|what| Error::Database {
                    archive: self.address.clone(),
                    source: what.into(),
                })?;
                let connected = self.config.connect(tls).await;
                let (client, connection) = connected.map_err(|error| failed(&error))?;
                tokio::spawn(connection);
                Ok(client)
            }
        }
    }
}

/// Lets the system ask whether the other side is still there, also while a statement takes long, and
/// give up when nothing of what was sent arrives.
fn notice_a_dead_network(config: &mut Config) {
    config
        .keepalives(true)
        .keepalives_idle(SILENCE)
        .keepalives_interval(SILENCE / 3)
        .keepalives_retries(3)
        .tcp_user_timeout(2 * SILENCE);
}

fn is_on_this_computer(host: &Host) -> bool {
    match host {
        Host::Tcp(name) => {
            name == "localhost"
                || name.parse().is_ok_and(|address: std::net::IpAddr| address.is_loopback())
        }
        #[cfg(unix)]
        Host::Unix(_) => true,
    }
}

/// What an address says of encryption, and the address without that.
struct Options {
    bare: String,
    mode: Option<String>,
    authority: Option<PathBuf>,
}

impl Options {
    fn of(address: &str) -> Options {
        let (bare, options) = address.split_once('?').unwrap_or((address, ""));
        let mut found = Options { bare: bare.to_owned(), mode: None, authority: None };
        let mut others = Vec::new();
        for option in options.split('&').filter(|option| !option.is_empty()) {
            match option.split_once('=') {
                Some(("sslmode", mode)) => found.mode = Some(mode.to_owned()),
                Some(("sslrootcert", path)) => found.authority = Some(path.into()),
                _ => others.push(option),
            }
        }
        if !others.is_empty() {
            found.bare = format!("{bare}?{}", others.join("&"));
        }
        found
    }
}

/// The password from the environment, or from the file of passwords.
fn password(config: &Config) -> std::result::Result<Option<String>, String> {
    if let Ok(password) = env::var("PGPASSWORD") {
        return Ok(Some(password));
    }
    let named = env::var_os("PGPASSFILE").map(PathBuf::from);
    let usual = || env::var_os("HOME").map(|home| Path::new(&home).join(".pgpass"));
    let Some(path) = named.or_else(usual) else { return Ok(None) };
    let Ok(text) = std::fs::read_to_string(&path) else { return Ok(None) };
    if !is_private(&path) {
        return Err(format!(
            "{} can be read by others, so its passwords are not used: chmod 600",
            path.display()
        ));
    }
    let host = match config.get_hosts().first() {
        Some(Host::Tcp(name)) => name.clone(),
        _ => "localhost".to_owned(),
    };
    let port = config.get_ports().first().copied().unwrap_or(5432).to_string();
    let database = config.get_dbname().or(config.get_user()).unwrap_or_default();
    let user = config.get_user().unwrap_or_default();
    Ok(password_in(&text, [&host, &port, database, user]))
}

/// Whether nobody else can read a file.
fn is_private(path: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        std::fs::metadata(path).is_ok_and(|about| about.mode() & 0o077 == 0)
    }
    #[cfg(not(unix))]
    {
        path.exists()
    }
}

/// The password of the first line for this host, port, database and user. A star stands for any, and
/// a backslash takes its meaning from a colon.
fn password_in(text: &str, wanted: [&str; 4]) -> Option<String> {
    text.lines().filter(|line| !line.starts_with('#')).find_map(|line| {
        let fields = fields(line);
        let (password, of_whom) = fields.split_last()?;
        let fits = of_whom.len() == wanted.len()
            && of_whom.iter().zip(wanted).all(|(field, wanted)| field == "*" || field == wanted);
        fits.then(|| password.clone())
    })
}

/// The five fields of a line.
fn fields(line: &str) -> Vec<String> {
    let mut fields = vec![String::new()];
    let mut letters = line.chars();
    while let Some(letter) = letters.next() {
        let is_last = fields.len() == 5;
        match (letter, fields.last_mut()) {
            (':', _) if !is_last => fields.push(String::new()),
            ('\\', Some(field)) => field.extend(letters.next()),
            (letter, Some(field)) => field.push(letter),
            (_, None) => {}
        }
    }
    fields
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_line_that_fits_has_the_password() {
        let text = "# comment\ndb:5432:other:ser:wrong\ndb:*:plant:ser:a\\:b:c\n*:*:*:*:last\n";
        let of = |host, database| password_in(text, [host, "5432", database, "ser"]);
        assert_eq!(of("db", "plant").as_deref(), Some("a:b:c"));
        assert_eq!(of("db", "third").as_deref(), Some("last"));
        assert_eq!(password_in("db:5432:plant:ser\n", ["db", "5432", "plant", "ser"]), None);
    }

    #[test]
    fn nothing_leaves_the_computer_in_the_open_unless_somebody_says_so() {
        let encryption = |address: &str| Login::of(address).map(|login| login.encryption).ok();
        assert_eq!(encryption("postgres://ser@localhost/plant"), Some(Encryption::None));
        assert_eq!(encryption("postgres://ser@127.0.0.1/plant"), Some(Encryption::None));
        let elsewhere = "postgres://ser@localhost/plant?hostaddr=192.0.2.7";
        assert_eq!(encryption(elsewhere), Some(Encryption::Verified(None)));
        let here = "postgres://ser@localhost/plant?hostaddr=127.0.0.2";
        assert_eq!(encryption(here), Some(Encryption::None));
        let far = "postgres://ser@db.example/plant";
        assert_eq!(encryption(far), Some(Encryption::Verified(None)));
        assert_eq!(encryption(&format!("{far}?sslmode=disable")), Some(Encryption::None));
        let with = encryption(&format!("{far}?sslmode=verify-full&sslrootcert=/etc/ca.pem"));
        assert_eq!(with, Some(Encryption::Verified(Some("/etc/ca.pem".into()))));
        assert_eq!(encryption(&format!("{far}?sslmode=prefer")), None);
        let named = Login::of(&format!("{far}?sslmode=require&application_name=x"));
        assert_eq!(named.unwrap().config.get_application_name(), Some("ser-archive"));
    }

    #[test]
    fn a_dead_network_is_noticed_in_minutes() {
        let login = Login::of("postgres://ser@db.example/plant?keepalives=0").unwrap();
        let config = login.config;
        assert!(config.get_keepalives());
        assert_eq!(config.get_keepalives_idle(), Duration::from_secs(30));
        assert_eq!(config.get_keepalives_interval(), Some(Duration::from_secs(10)));
        assert_eq!(config.get_keepalives_retries(), Some(3));
        assert_eq!(config.get_tcp_user_timeout(), Some(&Duration::from_secs(60)));
    }
}
