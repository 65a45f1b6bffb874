//! The address of a recorder, as a person writes it.

use std::error::Error;
use std::fmt;
use std::path::Path;
use std::str::FromStr;

use ser_proto::genius::BusAddress;

const TCP_PREFIX: &str = "tcp://";
const GENI_PREFIX: &str = "geni:";
const NODE: &str = "node";
const OFFSET: &str = "offset";

/// The address of a recorder: `tcp://HOST:PORT`, `geni:FILE?node=N&offset=X`, or the path or name
/// of a serial port.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Endpoint {
    /// A serial port, such as `/dev/ttyUSB0` or `COM3`.
    Serial {
        /// Path or name, as the system calls it.
        path: String,
    },
    /// A terminal server, or a simulated recorder.
    Tcp {
        /// `HOST:PORT`.
        address: String,
    },
    /// A Genius bus, through the window that this host shares with its GENI board.
    Geni {
        /// The window.
        window: GeniWindow,
        /// The recorder's bus address, 0–31; `None` for the bus as a whole.
        node: Option<u8>,
    },
}

/// The window that a host shares with its GENI board: 16 KiB, in a file or in memory.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct GeniWindow {
    /// The file that is the window, or a device or file that gives access to memory.
    pub file: String,
    /// Where the window begins in the memory, in bytes. `None` for a file that holds the window and
    /// nothing else; for a device `None` means 0.
    pub offset: Option<u64>,
}

/// A file that is the window, or a device whose memory begins with it.
impl From<&str> for GeniWindow {
    fn from(file: &str) -> GeniWindow {
        GeniWindow { file: file.to_owned(), offset: None }
    }
}

impl Endpoint {
    /// Whether the line has a rate that must agree with the recorder's.
    #[must_use]
    pub const fn has_baud(&self) -> bool {
        matches!(self, Endpoint::Serial { .. })
    }
}

/// Why a text is not an endpoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EndpointError {
    /// The text is empty.
    Empty,
    /// `tcp://` is not followed by `HOST:PORT` with a port of 1–65535.
    TcpAddress,
    /// `geni:` is not followed by a file.
    GeniFile,
    /// `node=` is not followed by a number of 0–31.
    GeniNode,
    /// `offset=` is not followed by a number of bytes.
    GeniOffset,
    /// A node or an offset is given twice, or there is another key.
    GeniQuery,
    /// The scheme is unknown, as in `udp://…`.
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
        // `::1:5000` is ambiguous, so an IPv6 address needs its brackets.
        let host_is_clear = !host.is_empty() && (!host.contains(':') || host.ends_with(']'));
        match port.parse::<u16>() {
            Ok(1..) if host_is_clear => Ok(Endpoint::Tcp { address: address.to_owned() }),
            _ => Err(EndpointError::TcpAddress),
        }
    }
}

fn geni(window: &str) -> Result<Endpoint, EndpointError> {
    let (file, query) = match window.rsplit_once('?') {
        // A file may have any name, even one with `?` in it.
        Some((file, query)) if [NODE, OFFSET].iter().any(|key| is_about(query, key)) => {
            (file, query)
        }
        // A misspelled key after the name of an existing file is an error, not part of the name.
        Some((file, query)) if is_assignment(query) && exists(file) && !exists(window) => {
            return Err(EndpointError::GeniQuery);
        }
        _ => (window, ""),
    };
    if file.is_empty() {
        return Err(EndpointError::GeniFile);
    }
    let (mut node, mut offset) = (None, None);
    for part in query.split('&').filter(|part| !part.is_empty()) {
        let given_before = match part.split_once('=') {
            Some((NODE, text)) => {
                node.replace(node_number(text).ok_or(EndpointError::GeniNode)?).is_some()
            }
            Some((OFFSET, text)) => {
                offset.replace(bytes(text).ok_or(EndpointError::GeniOffset)?).is_some()
            }
            _ => true,
        };
        if given_before {
            return Err(EndpointError::GeniQuery);
        }
    }
    Ok(Endpoint::Geni { window: GeniWindow { file: file.to_owned(), offset }, node })
}

fn is_about(query: &str, key: &str) -> bool {
    query.strip_prefix(key).is_some_and(|rest| rest.starts_with('='))
}

/// Whether the text looks like `word=value`.
fn is_assignment(text: &str) -> bool {
    text.split_once('=').is_some_and(|(word, _)| {
        !word.is_empty() && word.chars().all(|letter| letter.is_ascii_alphabetic())
    })
}

fn exists(file: &str) -> bool {
    !file.is_empty() && Path::new(file).exists()
}

fn node_number(text: &str) -> Option<u8> {
    text.parse().ok().and_then(BusAddress::new).map(BusAddress::number)
}

/// A number of bytes, in decimal or in hex after `0x`.
fn bytes(text: &str) -> Option<u64> {
    match text.strip_prefix("0x") {
        Some(hex) => u64::from_str_radix(hex, 16).ok(),
        None => text.parse().ok(),
    }
}

impl fmt::Display for Endpoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Endpoint::Serial { path } => f.write_str(path),
            Endpoint::Tcp { address } => write!(f, "{TCP_PREFIX}{address}"),
            Endpoint::Geni { window: GeniWindow { file, offset }, node } => {
                write!(f, "{GENI_PREFIX}{file}")?;
                if let Some(node) = node {
                    write!(f, "?{NODE}={node}")?;
                }
                match (offset, node) {
                    (Some(offset), Some(_)) => write!(f, "&{OFFSET}={offset:#X}"),
                    (Some(offset), None) => write!(f, "?{OFFSET}={offset:#X}"),
                    (None, _) => Ok(()),
                }
            }
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
            EndpointError::GeniNode => {
                "a recorder's bus address is 0 to 31, as in \
             geni:FILE?node=5"
            }
            EndpointError::GeniOffset => {
                "an offset is a number of bytes, as in geni:/dev/mem?node=5&offset=0xD0000"
            }
            EndpointError::GeniQuery => {
                "after the file come node and offset, each once, as in \
                 geni:FILE?node=5&offset=0xD0000"
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
    fn a_geni_window_may_name_a_node_and_an_offset() {
        for (text, file, node, offset) in [
            ("geni:/dev/shm/host?node=5", "/dev/shm/host", Some(5), None),
            ("geni:host?node=0", "host", Some(0), None),
            ("geni:a?node=1?node=31", "a?node=1", Some(31), None),
            ("geni:host", "host", None, None),
            ("geni:a?b", "a?b", None, None),
            ("geni:/dev/mem?node=5&offset=0xD0000", "/dev/mem", Some(5), Some(0xD0000)),
            ("geni:resource0?offset=0x0", "resource0", None, Some(0)),
        ] {
            let endpoint: Endpoint = text.parse().unwrap();
            let window = GeniWindow { offset, ..GeniWindow::from(file) };
            assert_eq!(endpoint, Endpoint::Geni { window, node });
            assert_eq!(endpoint.to_string(), text);
            assert!(!endpoint.has_baud());
        }
        let endpoint: Endpoint = "geni:/dev/uio0?offset=4096&node=5".parse().unwrap();
        assert_eq!(endpoint.to_string(), "geni:/dev/uio0?node=5&offset=0x1000");
    }

    #[test]
    fn a_misspelled_word_after_a_file_that_is_there_is_no_part_of_its_name() {
        let here = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml");
        for query in ["nod=5", "Node=5", "nod=5&offset=0"] {
            assert_eq!(
                format!("geni:{here}?{query}").parse::<Endpoint>(),
                Err(EndpointError::GeniQuery)
            );
        }
        for name in ["none?nod=5".to_string(), format!("{here}?5"), format!("{here}?=5")] {
            let window = GeniWindow::from(&*name);
            assert_eq!(format!("geni:{name}").parse(), Ok(Endpoint::Geni { window, node: None }));
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
            ("geni:host?offset=", EndpointError::GeniOffset),
            ("geni:host?offset=-1", EndpointError::GeniOffset),
            ("geni:host?offset=0x10000000000000000", EndpointError::GeniOffset),
            ("geni:host?node=5&node=5", EndpointError::GeniQuery),
            ("geni:host?node=5&rate=1", EndpointError::GeniQuery),
            ("udp://host:1", EndpointError::UnknownScheme),
        ] {
            assert_eq!(text.parse::<Endpoint>(), Err(error), "{text:?}");
        }
    }
}
