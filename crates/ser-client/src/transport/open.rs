//! Opening a line by its endpoint.

use super::Transport;
use super::endpoint::Endpoint;
use super::open_error::OpenError;
use super::serial::SerialTransport;
use super::tcp::TcpTransport;

/// Opens the line. `baud` is the rate in bits per second; a line without a rate ignores it.
///
/// # Errors
/// See [`OpenError`].
pub fn open(endpoint: &Endpoint, baud: u32) -> Result<Box<dyn Transport>, OpenError> {
    match endpoint {
        Endpoint::Serial { path } => Ok(Box::new(SerialTransport::open(path, baud)?)),
        Endpoint::Tcp { address } => Ok(Box::new(TcpTransport::connect(address)?)),
        Endpoint::Geni { window, node } => Err(no_line(&window.file, *node)),
    }
}

/// A window is not a line. [`Unit::open`](crate::Unit::open) and [`GeniHost`](crate::GeniHost) open
/// windows, on systems that have them.
fn no_line(file: &str, node: Option<u8>) -> OpenError {
    match node {
        Some(_) => OpenError::NotAWindow { path: file.to_owned() },
        None => OpenError::NoNode { path: file.to_owned() },
    }
}
