//! QEMU's test interface: memory and registers, read and written as a probe would. (QEMU, "`QTest`
//! Device Emulation Testing Framework", protocol.)

use std::io::{self, BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;

/// UART0's state register, and its bits for a byte that waits for the shift register and for one
/// that waits to be taken.
const UART_STATE: u32 = 0x4000_4004;
const TRANSMIT_FULL: u64 = 1 << 0;
const RECEIVE_FULL: u64 = 1 << 1;

/// The socket of the test interface.
pub(super) struct Probe {
    stream: BufReader<UnixStream>,
}

impl Probe {
    pub(super) fn new(stream: UnixStream) -> Probe {
        Probe { stream: BufReader::new(stream) }
    }

    /// Whether the UART has a byte that has not been taken. Reading the state changes nothing.
    pub(super) fn uart_is_full(&mut self) -> io::Result<bool> {
        Ok(self.uart_state()? & RECEIVE_FULL != 0)
    }

    /// Whether the UART has a byte that waits for the shift register.
    pub(super) fn uart_is_sending(&mut self) -> io::Result<bool> {
        Ok(self.uart_state()? & TRANSMIT_FULL != 0)
    }

    fn uart_state(&mut self) -> io::Result<u64> {
        value(&self.ask(&format!("readl {UART_STATE:#x}"))?)
    }

    /// Writes to memory.
    pub(super) fn write_halfword(&mut self, address: u32, halfword: u16) -> io::Result<()> {
        self.ask(&format!("writew {address:#x} {halfword:#x}")).map(drop)
    }

    fn ask(&mut self, question: &str) -> io::Result<String> {
        self.stream.get_mut().write_all(format!("{question}\n").as_bytes())?;
        let mut answer = String::new();
        if self.stream.read_line(&mut answer)? == 0 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        if answer.starts_with("OK") { Ok(answer) } else { Err(io::Error::other(answer)) }
    }
}

/// The number in an answer such as `OK 0x0000000000000002`.
fn value(answer: &str) -> io::Result<u64> {
    let digits = answer.trim().strip_prefix("OK 0x");
    let value = digits.and_then(|digits| u64::from_str_radix(digits, 16).ok());
    value.ok_or_else(|| io::Error::other(format!("no number: {answer}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_and_nothing_else_is() {
        assert_eq!(value("OK 0x0000000000000002\n").unwrap(), 2);
        assert!(value("OK\n").is_err() && value("ERR 0x2\n").is_err());
    }
}
