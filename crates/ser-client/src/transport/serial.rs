//! A serial port: RS-232 itself, a USB adapter, or a pseudo-terminal.
//!
//! The port is opened exclusively where the system can do that, with 8 data bits, no parity, one
//! stop bit and no flow control. Bytes that arrived earlier stay in the buffer, because they may be
//! lines that the recorder printed.

use std::io::{self, ErrorKind, Read, Write};
use std::path::Path;
use std::time::Duration;

use serialport::{DataBits, FlowControl, Parity, SerialPort, StopBits};

use super::open_error::OpenError;
use super::ports::ports;
use super::{Transport, bytes_read};

/// Far longer than the kernel needs to take one frame at 300 baud, so only a stuck port exceeds it.
const WRITE_TIMEOUT: Duration = Duration::from_secs(30);

/// An open serial port.
pub struct SerialTransport {
    port: Box<dyn SerialPort>,
    bits_per_second: u32,
    keeps_rate: bool,
}

impl SerialTransport {
    /// Opens the port `path` at `baud` bits per second.
    ///
    /// # Errors
    /// See [`OpenError`].
    pub fn open(path: &str, baud: u32) -> Result<SerialTransport, OpenError> {
        // Some systems hang up when the rate is set to 0.
        if baud == 0 {
            return Err(OpenError::UnsupportedBaud { path: path.to_owned(), baud });
        }
        let port = serialport::new(path, baud)
            .data_bits(DataBits::Eight)
            .parity(Parity::None)
            .stop_bits(StopBits::One)
            .flow_control(FlowControl::None)
            .exclusive(true)
            .open()
            .map_err(|error| why_not_opened(path, baud, &error))?;
        Ok(SerialTransport { port, bits_per_second: baud, keeps_rate: keeps_rate(Path::new(path)) })
    }
}

fn why_not_opened(path: &str, baud: u32, error: &serialport::Error) -> OpenError {
    use serialport::ErrorKind as Kind;
    let owned = || path.to_owned();
    match error.kind() {
        Kind::Io(ErrorKind::PermissionDenied) => OpenError::PermissionDenied { path: owned() },
        Kind::NoDevice if exists(path) => OpenError::Busy { path: owned() },
        Kind::Io(ErrorKind::NotFound) | Kind::NoDevice => OpenError::NoSuchPort { path: owned() },
        _ if is_no_terminal(path, error) => OpenError::NotSerial { path: owned() },
        Kind::InvalidInput => OpenError::UnsupportedBaud { path: owned(), baud },
        kind => {
            let kind = if let Kind::Io(kind) = kind { kind } else { ErrorKind::Other };
            OpenError::Other {
                name: owned(),
                error: io::Error::new(kind, error.description.clone()),
            }
        }
    }
}

/// Whether bytes take as long as the rate says. Behind a pseudo-terminal there may be anything, and a
/// modem that is none (`ttyACM`) sends at the rate of USB.
fn keeps_rate(path: &Path) -> bool {
    let device = std::fs::canonicalize(path).unwrap_or(path.to_owned());
    let is_modem =
        device.file_name().is_some_and(|name| name.to_string_lossy().starts_with("ttyACM"));
    !is_modem && !device.starts_with("/dev/pts")
}

fn exists(path: &str) -> bool {
    Path::new(path).exists() || ports().iter().any(|port| port.path.eq_ignore_ascii_case(path))
}

#[cfg(unix)]
fn is_no_terminal(path: &str, error: &serialport::Error) -> bool {
    use std::os::unix::fs::FileTypeExt;
    // The text is all that serialport keeps of ENOTTY. The file type does not suffice, because
    // /dev/null is a character device, too.
    let not_a_terminal =
        error.description.contains("typewriter") || error.description.contains("terminal");
    not_a_terminal || std::fs::metadata(path).is_ok_and(|found| !found.file_type().is_char_device())
}

#[cfg(not(unix))]
fn is_no_terminal(path: &str, _: &serialport::Error) -> bool {
    Path::new(path).is_file()
}

/// Gives the many errors of an unplugged serial port one kind.
fn unplugged(error: io::Error) -> io::Error {
    match error.kind() {
        // The kernel's EIO, ENXIO and ENODEV have no kind of their own and arrive as `Other`.
        ErrorKind::BrokenPipe
        | ErrorKind::NotFound
        | ErrorKind::UnexpectedEof
        | ErrorKind::Other => io::Error::new(ErrorKind::NotConnected, error),
        _ => error,
    }
}

impl Transport for SerialTransport {
    fn read(&mut self, buf: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.port.set_timeout(timeout)?;
        // A port that reports bytes but has none was hung up.
        let read = self.port.read(buf);
        bytes_read(read, buf.len(), ErrorKind::NotConnected).map_err(unplugged)
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.port.set_timeout(WRITE_TIMEOUT)?;
        self.port.write_all(bytes).map_err(unplugged)
    }

    fn set_baud(&mut self, bits_per_second: u32) -> io::Result<()> {
        self.port.set_baud_rate(bits_per_second)?;
        self.bits_per_second = bits_per_second;
        Ok(())
    }

    fn bits_per_second(&self) -> Option<u32> {
        Some(self.bits_per_second)
    }

    fn keeps_rate(&self) -> bool {
        self.keeps_rate
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pseudo_terminal_and_a_modem_that_is_none_keep_no_rate() {
        for (path, keeps) in [
            ("/dev/ttyUSB0", true),
            ("/dev/ttyS0", true),
            ("COM3", true),
            ("/dev/pts/7", false),
            ("/dev/ttyACM0", false),
        ] {
            assert_eq!(keeps_rate(Path::new(path)), keeps, "{path}");
        }
    }
}
