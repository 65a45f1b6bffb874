//! Where a unit is reached, as a person writes it.

use std::error::Error;
use std::fmt;
use std::str::FromStr;

const TCP_PREFIX: &str = "tcp://";

/// Where a unit is reached: `tcp://HOST:PORT`, or the path or name of a serial port.
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

impl fmt::Display for Endpoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Endpoint::Serial { path } => f.write_str(path),
            Endpoint::Tcp { address } => write!(f, "{TCP_PREFIX}{address}"),
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
            ("udp://host:1", EndpointError::UnknownScheme),
        ] {
            assert_eq!(text.parse::<Endpoint>(), Err(error), "{text:?}");
        }
    }
}
