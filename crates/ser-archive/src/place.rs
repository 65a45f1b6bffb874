//! Where an archive is.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

/// Where an archive is.
#[derive(Clone, PartialEq, Eq)]
pub enum Place {
    /// In a file of `SQLite`.
    File(PathBuf),
    /// In a database of `PostgreSQL`, by its address: `postgres://user@host/database`. The schema
    /// `ser_archive` there is ours. A password comes from `PGPASSWORD`, or from the file that
    /// `PGPASSFILE` names, or from `~/.pgpass`; never from the address, which everybody sees.
    ///
    /// Such an archive must not be used within an async runtime: it waits for its server. Give it a
    /// thread of its own, as [`Writer`](crate::Writer) does.
    Postgres(String),
}

/// Why an address is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoPlace {
    /// It holds a password.
    Password,
    /// It is empty.
    Empty,
}

impl fmt::Display for NoPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            NoPlace::Password => {
                "an address with a password can be seen by everybody: put the password into \
                 ~/.pgpass, or into PGPASSWORD"
            }
            NoPlace::Empty => "neither a file nor an address",
        })
    }
}

impl std::error::Error for NoPlace {}

/// What an address of `PostgreSQL` begins with.
const SCHEMES: [&str; 2] = ["postgres://", "postgresql://"];

impl FromStr for Place {
    type Err = NoPlace;

    fn from_str(text: &str) -> Result<Place, NoPlace> {
        let Some(rest) = SCHEMES.iter().find_map(|scheme| text.strip_prefix(scheme)) else {
            return if text.is_empty() {
                Err(NoPlace::Empty)
            } else {
                Ok(Place::File(text.into()))
            };
        };
        let (path, options) = rest.split_once('?').unwrap_or((rest, ""));
        let host = path.split('/').next().unwrap_or_default();
        let user = host.rsplit_once('@').map_or("", |(user, _)| user);
        let is_secret = |option: &str| option.starts_with("password=");
        if user.contains(':') || options.split('&').any(is_secret) {
            return Err(NoPlace::Password);
        }
        Ok(Place::Postgres(text.to_owned()))
    }
}

/// As it was given; there is no password in it.
impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::File(path) => write!(f, "{}", path.display()),
            Place::Postgres(address) => f.write_str(address),
        }
    }
}

impl fmt::Debug for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Place({self})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_never_holds_a_password() {
        for address in [
            "postgres://ser:secret@db/plant",
            "postgresql://ser:@db/plant",
            "postgres://db/plant?user=ser&password=secret",
        ] {
            assert_eq!(address.parse::<Place>(), Err(NoPlace::Password), "{address}");
        }
        for address in ["postgres://ser@db:5433/plant?sslmode=verify-full", "postgresql:///plant"] {
            assert_eq!(address.parse(), Ok(Place::Postgres(address.to_owned())));
        }
        assert_eq!("plant.db".parse(), Ok(Place::File("plant.db".into())));
        assert_eq!("".parse::<Place>(), Err(NoPlace::Empty));
    }
}
