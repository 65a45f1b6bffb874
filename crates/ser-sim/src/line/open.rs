//! The line of a port.

use std::io;
#[cfg(unix)]
use std::os::fd::BorrowedFd;

use super::Line;
use super::port::Port;
use crate::error::SimError;

/// Makes the line of `port`, not yet known to anybody.
pub(crate) fn open(port: &Port) -> Result<Box<dyn Line>, SimError> {
    match port {
        #[cfg(unix)]
        Port::Pty { link } => Ok(Box::new(crate::line::pty::PtyLine::open(link.as_deref())?)),
        #[cfg(not(unix))]
        Port::Pty { .. } => Err(SimError::Unsupported("a pseudo-terminal")),
        Port::Unconnected => Ok(Box::new(NoLine)),
        Port::Tcp { address, gives_way_after } => {
            Ok(Box::new(crate::line::tcp::TcpLine::listen(address, *gives_way_after)?))
        }
    }
}

/// A connector without a cable.
struct NoLine;

impl Line for NoLine {
    fn read(&mut self, _buffer: &mut [u8]) -> io::Result<usize> {
        Ok(0)
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        Ok(bytes.len())
    }

    fn host_bits_per_second(&self) -> Option<u32> {
        None
    }

    fn take_host_change(&mut self) -> bool {
        false
    }

    fn publish(&mut self) -> Result<(), SimError> {
        Ok(())
    }

    fn name(&self) -> String {
        String::new()
    }

    #[cfg(unix)]
    fn descriptors(&self) -> Vec<BorrowedFd<'_>> {
        Vec::new()
    }
}
