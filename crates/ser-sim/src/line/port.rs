//! Where a host reaches the simulated recorder.

use std::path::PathBuf;
use std::time::Duration;

/// Where a host reaches the simulated recorder. The recorder has one RS-232 port, hence one of
/// these.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Port {
    /// A pseudo-terminal, which hosts open as they would a serial port.
    Pty {
        /// The symbolic link that leads to it; `None` makes one in a temporary directory.
        link: Option<PathBuf>,
    },
    /// No line. Hosts reach the recorder in another way.
    Unconnected,
    /// A TCP port for one client at a time.
    Tcp {
        /// Address to listen on, as in `127.0.0.1:4000`; port 0 takes a free one. Anyone who can
        /// connect may do everything.
        address: String,
        /// How long a client may be silent before it gives way to another one; `None` is for ever.
        gives_way_after: Option<Duration>,
    },
}

impl Port {
    /// How long a TCP client may be silent by default. `ser-cli watch` sends something every ten
    /// seconds.
    pub const GIVES_WAY_AFTER: Duration = Duration::from_secs(600);

    /// A TCP port with the default settings.
    #[must_use]
    pub fn tcp(address: impl Into<String>) -> Port {
        Port::Tcp { address: address.into(), gives_way_after: Some(Port::GIVES_WAY_AFTER) }
    }
}
