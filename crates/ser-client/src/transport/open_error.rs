//! Why a line could not be opened, and what to do about it.

use std::error::Error;
use std::{fmt, io};

use super::genius_error::GeniusError;

fn file_name(path: &str) -> &str {
    path.rsplit('/').next().unwrap_or(path)
}

/// Why the line could not be opened.
#[derive(Debug)]
pub enum OpenError {
    /// There is no serial port of this name.
    NoSuchPort {
        /// What was asked for.
        path: String,
    },
    /// Another program has the serial port open.
    Busy {
        /// The port.
        path: String,
    },
    /// The user may not use the serial port.
    PermissionDenied {
        /// The port.
        path: String,
    },
    /// Something has this name, but it is not a serial port.
    NotSerial {
        /// What was asked for.
        path: String,
    },
    /// The serial port does not have this rate.
    UnsupportedBaud {
        /// The port.
        path: String,
        /// The rate in bits per second.
        baud: u32,
    },
    /// The host is there, but nothing listens at this port.
    Refused {
        /// `HOST:PORT`.
        address: String,
    },
    /// No host of this name is known.
    HostNotFound {
        /// `HOST:PORT`.
        address: String,
    },
    /// The host did not answer.
    Unreachable {
        /// `HOST:PORT`.
        address: String,
    },
    /// There is no file of this name that could be a GENI window.
    NoSuchWindow {
        /// What was asked for.
        path: String,
    },
    /// Something has this name, but it cannot be a GENI window.
    NotAWindow {
        /// What was asked for.
        path: String,
    },
    /// The device, or the file, gives no access to memory that could be a GENI window.
    NoMemory {
        /// What was asked for.
        path: String,
        /// What the system says.
        error: io::Error,
    },
    /// The user may not use the GENI window.
    WindowDenied {
        /// The file.
        path: String,
    },
    /// The file has another size than a GENI window, or ends before the window does.
    WindowSize {
        /// The file.
        path: String,
        /// Its bytes.
        len: u64,
    },
    /// Another program uses the GENI window.
    WindowInUse {
        /// The file.
        path: String,
    },
    /// The endpoint is a GENI window without a recorder's bus address.
    NoNode {
        /// The file.
        path: String,
    },
    /// The GENI board or the bus behind it cannot be used.
    Genius {
        /// The window.
        path: String,
        /// What is wrong.
        error: GeniusError,
    },
    /// Anything else.
    Other {
        /// What was asked for.
        name: String,
        /// What the system says.
        error: io::Error,
    },
}

impl OpenError {
    /// What a person can try next.
    #[must_use]
    pub fn hint(&self) -> &'static str {
        match self {
            OpenError::NoSuchPort { .. } => {
                "list the serial ports of this computer; is the adapter plugged in?"
            }
            OpenError::Busy { .. } => {
                "close the other program that uses the port (terminal, modem manager)"
            }
            OpenError::PermissionDenied { .. } if cfg!(target_os = "linux") => {
                "add yourself to the group that owns the port (sudo usermod -aG dialout $USER) \
                 and log in again"
            }
            OpenError::PermissionDenied { .. } => "ask for the right to use the port",
            OpenError::NotSerial { .. } => {
                "name a serial port, as in /dev/ttyUSB0, or tcp://HOST:PORT"
            }
            OpenError::UnsupportedBaud { .. } => {
                "recorders have 300, 600, 1200, 2400, 4800, 9600 and 19200 baud"
            }
            OpenError::Refused { .. } => {
                "is the terminal server or the simulated recorder running, on this TCP port?"
            }
            OpenError::HostNotFound { .. } => "check the spelling, or give the IP address",
            OpenError::Unreachable { .. } => {
                "check network and firewall; does the host answer a ping?"
            }
            OpenError::NoSuchWindow { .. } => {
                "check the name; is the program that makes the window (ser-cli sim --genius \
                 FILE) running?"
            }
            OpenError::NotAWindow { .. } => {
                "name the file that this host shares with its GENI board"
            }
            OpenError::NoMemory { .. } => {
                "name a device for memory, and check the offset of the window in it"
            }
            OpenError::WindowDenied { .. } => "ask for the right to read and write it",
            // Linux shows the memory of a PCI device under this file name. The hint must not lead
            // anybody to write into another kind of file.
            OpenError::WindowSize { path, .. } if file_name(path).starts_with("resource") => {
                "a GENI window has 16384 bytes: add where in this memory it begins, as in offset=0"
            }
            OpenError::WindowSize { .. } => {
                "is this the right file? A GENI window is a file of 16384 bytes"
            }
            OpenError::WindowInUse { .. } => "wait until the other program has ended, or end it",
            OpenError::NoNode { .. } => "say which recorder on the bus, as in geni:FILE?node=5",
            OpenError::Genius { error, .. } => error.hint(),
            OpenError::Other { .. } => "see what the system says above",
        }
    }
}

impl fmt::Display for OpenError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            OpenError::NoSuchPort { path } => write!(f, "there is no serial port {path}"),
            OpenError::Busy { path } => write!(f, "serial port {path} is in use"),
            OpenError::PermissionDenied { path } => write!(f, "no permission to open {path}"),
            OpenError::NotSerial { path } => write!(f, "{path} is not a serial port"),
            OpenError::UnsupportedBaud { path, baud } => {
                write!(f, "{path} does not have {baud} baud")
            }
            OpenError::Refused { address } => write!(f, "nothing listens at tcp://{address}"),
            OpenError::HostNotFound { address } => {
                write!(f, "the host of tcp://{address} is not known")
            }
            OpenError::Unreachable { address } => write!(f, "tcp://{address} does not answer"),
            OpenError::NoSuchWindow { path } => write!(f, "there is no GENI window {path}"),
            OpenError::NotAWindow { path } => write!(f, "{path} cannot be a GENI window"),
            OpenError::WindowSize { path, len } => {
                write!(f, "{path} has {len} bytes and cannot be a GENI window")
            }
            OpenError::NoMemory { path, error } => {
                write!(f, "{path} cannot be a GENI window: it gives no access to memory ({error})")
            }
            OpenError::WindowDenied { path } => {
                write!(f, "no permission to use the GENI window {path}")
            }
            OpenError::WindowInUse { path } => write!(f, "the GENI window {path} is in use"),
            OpenError::NoNode { path } => {
                write!(f, "{path} is the window to a whole bus, and no recorder on it is named")
            }
            OpenError::Genius { path, error } => write!(f, "{error} (GENI window {path})"),
            OpenError::Other { name, error } => write!(f, "cannot open {name}: {error}"),
        }
    }
}

impl Error for OpenError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            OpenError::Other { error, .. } | OpenError::NoMemory { error, .. } => Some(error),
            OpenError::Genius { error, .. } => Some(error),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nobody_is_led_to_write_into_a_foreign_file() {
        let hint =
            |path: &str| OpenError::WindowSize { path: path.to_string(), len: 40_000 }.hint();
        assert!(hint("/sys/bus/pci/devices/0000:01:00.0/resource2").contains("offset=0"));
        for path in ["big", "/home/resource0/big", ""] {
            assert!(hint(path).starts_with("is this the right file?"), "{path}");
        }
    }
}
