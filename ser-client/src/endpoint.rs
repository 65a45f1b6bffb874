//! Where a unit is reached, as a person writes it.

use std::error::Error;
use std::fmt;
use std::str::FromStr;

use ser_proto::genius::Device;

const TCP_PREFIX: &str = "tcp://";
const GENI_PREFIX: &str = "geni:";
const NODE_QUERY: &str = "?node=";

/// Where a unit is reached: `tcp://HOST:PORT`, `geni:FILE?node=N`, or the path or name of a serial port.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Endpoint {
    /// A serial port, such as `/dev/ttyUSB0` or `COM3`.
    Serial {
        /// Path or name, as the system calls it.
        path: String,
    },
    /// A terminal server, or a simulated unit.
    Tcp {
        /// `HOST:PORT`.
        address: String,
    },
    /// A Genius bus, through the window that this host shares with its GENI board.
    Geni {
        /// The file that is the window.
        file: String,
        /// The unit's number on the bus, 0-31; `None` for the bus as a whole.
        node: Option<u8>,
    },
}

impl Endpoint {
    /// Whether the line has a rate that must agree with the unit's.
    #[must_use]
    pub const fn has_baud(&self) -> bool {
        matches!(self, Endpoint::Serial { .. })
    }
}

/// Why a text is no endpoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EndpointError {
    /// There is nothing.
    Empty,
    /// `tcp://` is not followed by `HOST:PORT` with a port of 1–65535.
    TcpAddress,
    /// `geni:` is not followed by a file.
    GeniFile,
    /// What follows `?node=` is no number of 0–31.
    GeniNode,
    /// Something like `udp://…`.
    UnknownScheme,
}

impl FromStr for Endpoint {
    type Err = EndpointError;

    fn from_str(text: &str) -> Result<Endpoint, EndpointError> {
        let text = text.trim();
        if text.is_empty() {
            return Err(EndpointError::Empty);
        }
        if let Some(window) = text.strip_prefix(GENI_PREFIX) {
            return geni(window);
        }
        let Some(address) = text.strip_prefix(TCP_PREFIX) else {
            return if text.contains("://") {
                Err(EndpointError::UnknownScheme)
            } else {
                Ok(Endpoint::Serial { path: text.to_owned() })
            };
        };
        let (host, port) = address.rsplit_once(':').ok_or(EndpointError::TcpAddress)?;
        // `::1:5000` could mean anything, so an IPv6 address wants its brackets.
        let host_is_clear = !host.is_empty() && (!host.contains(':') || host.ends_with(']'));
        match port.parse::<u16>() {
            Ok(1..) if host_is_clear => Ok(Endpoint::Tcp { address: address.to_owned() }),
            _ => Err(EndpointError::TcpAddress),
        }
    }
}

fn geni(window: &str) -> Result<Endpoint, EndpointError> {
    let (file, node) = match window.rsplit_once(NODE_QUERY) {
        Some((file, number)) => (file, Some(number)),
        None => (window, None),
    };
    if file.is_empty() {
        return Err(EndpointError::GeniFile);
    }
    let number = |text: &str| text.parse().ok().and_then(Device::new).map(Device::number);
    let node = node.map(|text| number(text).ok_or(EndpointError::GeniNode)).transpose()?;
    Ok(Endpoint::Geni { file: file.to_owned(), node })
}

impl fmt::Display for Endpoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Endpoint::Serial { path } => f.write_str(path),
            Endpoint::Tcp { address } => write!(f, "{TCP_PREFIX}{address}"),
            Endpoint::Geni { file, node: Some(node) } => write!(f, "{GENI_PREFIX}{file}{NODE_QUERY}{node}"),
            Endpoint::Geni { file, node: None } => write!(f, "{GENI_PREFIX}{file}"),
        }
    }
}

impl fmt::Display for EndpointError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            EndpointError::Empty => "no port is given",
            EndpointError::TcpAddress => {
                "tcp:// needs HOST:PORT, as in tcp://localhost:5300 or tcp://[::1]:5300"
            }
            EndpointError::GeniFile => {
                "geni: needs the window of a GENI board, as in geni:/dev/shm/host?node=5"
            }
            EndpointError::GeniNode => "a unit's number on the bus is 0 to 31, as in geni:FILE?node=5",
            EndpointError::UnknownScheme => {
                "a port is tcp://HOST:PORT or the name of a serial port, as in /dev/ttyUSB0"
            }
        })
    }
}

impl Error for EndpointError {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_is_a_tcp_address_or_a_device() {
        for text in ["tcp://localhost:5300", "tcp://[::1]:1", "tcp://10.0.0.7:65535"] {
            let endpoint: Endpoint = text.parse().unwrap();
            assert_eq!(endpoint, Endpoint::Tcp { address: text[6..].to_owned() });
            assert_eq!(endpoint.to_string(), text);
            assert!(!endpoint.has_baud());
        }
        for text in ["/dev/ttyUSB0", "COM3", "/tmp/ser pty"] {
            let endpoint: Endpoint = text.parse().unwrap();
            assert_eq!(endpoint, Endpoint::Serial { path: text.to_owned() });
            assert_eq!(endpoint.to_string(), text);
            assert!(endpoint.has_baud());
        }
    }

    #[test]
    fn a_geni_window_may_name_a_node() {
        for (text, file, node) in [
            ("geni:/dev/shm/host?node=5", "/dev/shm/host", Some(5)),
            ("geni:host?node=0", "host", Some(0)),
            ("geni:a?node=1?node=31", "a?node=1", Some(31)),
            ("geni:host", "host", None),
        ] {
            let endpoint: Endpoint = text.parse().unwrap();
            assert_eq!(endpoint, Endpoint::Geni { file: file.to_owned(), node });
            assert_eq!(endpoint.to_string(), text);
            assert!(!endpoint.has_baud());
        }
    }

    #[test]
    fn what_cannot_be_a_port_says_why() {
        for (text, error) in [
            ("", EndpointError::Empty),
            ("  ", EndpointError::Empty),
            ("tcp://", EndpointError::TcpAddress),
            ("tcp://host", EndpointError::TcpAddress),
            ("tcp://:5300", EndpointError::TcpAddress),
            ("tcp://host:0", EndpointError::TcpAddress),
            ("tcp://host:65536", EndpointError::TcpAddress),
            ("tcp://::1:5300", EndpointError::TcpAddress),
            ("geni:", EndpointError::GeniFile),
            ("geni:?node=5", EndpointError::GeniFile),
            ("geni:host?node=", EndpointError::GeniNode),
            ("geni:host?node=32", EndpointError::GeniNode),
            ("geni:host?node=x", EndpointError::GeniNode),
            ("udp://host:1", EndpointError::UnknownScheme),
        ] {
            assert_eq!(text.parse::<Endpoint>(), Err(error), "{text:?}");
        }
    }
}
