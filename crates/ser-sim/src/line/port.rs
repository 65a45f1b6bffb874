//! Where a host reaches the simulated node.

use std::path::PathBuf;
use std::time::Duration;

/// Where a host reaches the simulated node: it has one RS-232 port, hence one of these.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Port {
    /// A pseudo-terminal, which hosts open as they would a serial port.
    Pty {
        /// The symbolic link under which it is found; `None` makes one in a temporary directory.
        link: Option<PathBuf>,
    },
    /// None: hosts reach it in another way.
    Unconnected,
    /// A TCP port for one client at a time.
    Tcp {
        /// Address to listen on, as in `127.0.0.1:4000`; port 0 takes a free one. Whoever reaches
        /// it may do everything.
        address: String,
        /// A client that has sent nothing for so long gives way when another one comes; `None` is
        /// never.
        gives_way_after: Option<Duration>,
    },
}

impl Port {
    /// How long a TCP client may be silent by default: `ser-cli watch` says something every ten
    /// seconds.
    pub const GIVES_WAY_AFTER: Duration = Duration::from_secs(600);

    /// A TCP port with what is usual.
    #[must_use]
    pub fn tcp(address: impl Into<String>) -> Port {
        Port::Tcp { address: address.into(), gives_way_after: Some(Port::GIVES_WAY_AFTER) }
    }
}
