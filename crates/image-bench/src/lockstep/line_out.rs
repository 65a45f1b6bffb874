//! The line behind the board's transmitter: QEMU's standard output as a pipe that holds one byte.
//!
//! The byte in the pipe is the one in the shift register. While it is there, the UART keeps the
//! next byte in its data register and is busy, as on a chip. QEMU moves that byte on when the pipe
//! is empty, which is only while the processor is held.

use std::fs::File;
use std::io::{self, Read};
use std::os::fd::OwnedFd;

use rustix::pipe::{PipeFlags, fcntl_setpipe_size, pipe_with};

use ser_sim::qemu::process::is_temporary;

/// The bench's end.
pub(super) struct LineOut {
    pipe: File,
}

impl LineOut {
    /// An idle line, and QEMU's end of it.
    pub(super) fn new() -> io::Result<(LineOut, OwnedFd)> {
        // Every write is a packet that takes a page of the pipe, and there is only one page.
        let flags = PipeFlags::DIRECT | PipeFlags::NONBLOCK | PipeFlags::CLOEXEC;
        let (ours, qemus) = pipe_with(flags)?;
        fcntl_setpipe_size(&qemus, 1)?;
        Ok((LineOut { pipe: ours.into() }, qemus))
    }

    /// Takes the byte in the shift register, if there is one.
    pub(super) fn take(&mut self) -> io::Result<Option<u8>> {
        let mut byte = [0];
        match self.pipe.read(&mut byte) {
            Ok(0) => Err(io::ErrorKind::UnexpectedEof.into()),
            Ok(_) => Ok(byte.first().copied()),
            Err(error) if is_temporary(&error) => Ok(None),
            Err(error) => Err(error),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    #[test]
    fn a_line_holds_one_byte_until_it_is_taken() {
        let (mut line, qemus) = LineOut::new().unwrap();
        let mut qemus = File::from(qemus);
        assert_eq!(line.take().unwrap(), None);
        for byte in [7, 8] {
            qemus.write_all(&[byte]).unwrap();
            assert_eq!(qemus.write(&[9]).unwrap_err().kind(), io::ErrorKind::WouldBlock);
            assert_eq!(line.take().unwrap(), Some(byte));
        }
        drop(qemus);
        assert_eq!(line.take().unwrap_err().kind(), io::ErrorKind::UnexpectedEof);
    }
}
