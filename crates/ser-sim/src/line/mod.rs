//! The far end of the recorder's serial line, where a host plugs in.

mod open;
pub(crate) mod port;
#[cfg(unix)]
mod pty;
mod tcp;
pub(crate) mod wire;

use std::io;
#[cfg(unix)]
use std::os::fd::BorrowedFd;

use ser_proto::Baud;

use crate::error::SimError;

pub(crate) use open::open;

/// A medium that carries the bytes of a line. Nothing here waits.
pub(crate) trait Line: Send {
    /// What a host has sent; 0 when there is nothing at present.
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize>;

    /// Takes bytes for the host and returns how many. Without a host all bytes are taken and lost,
    /// as on a wire.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize>;

    /// The rate to which the host's end is set. `None` without a host, or if its end has no such
    /// setting.
    fn host_bits_per_second(&self) -> Option<u32>;

    /// Whether another host has come since this was last asked. Bytes meant for the previous host
    /// are not for the new one.
    fn take_host_change(&mut self) -> bool;

    /// Makes the line known, now that the node answers.
    fn publish(&mut self) -> Result<(), SimError>;

    /// The name by which a host reaches this line.
    fn name(&self) -> String;

    /// Sentences for the user about hosts that came and went since this was last asked.
    fn take_notices(&mut self) -> Vec<String> {
        Vec::new()
    }

    /// Descriptors that become readable when [`read`](Self::read) has something to do. The host's
    /// own descriptor comes first.
    #[cfg(unix)]
    fn descriptors(&self) -> Vec<BorrowedFd<'_>>;
}

/// Whether a host set to `host` bit/s can understand a node at `node`.
pub(crate) fn rates_agree(host: Option<u32>, node: Baud) -> bool {
    host.is_none_or(|bits_per_second| bits_per_second == node.bits_per_second())
}

/// Makes bytes what a receiver at another rate would see: nothing that could be part of a frame or
/// a text.
///
/// Real garbage depends on both rates and on the gaps between bytes. What matters here is that the
/// result is always the same and never passes for sense, so every byte has its highest bit set.
pub(crate) fn garble(bytes: &mut [u8]) {
    for byte in bytes {
        *byte = (byte.rotate_left(3) ^ 0x5A) | 0x80;
    }
}

#[cfg(test)]
mod tests {
    use ser_proto::{Command, FrameDecoder, FrameEncoder};

    use super::*;

    #[test]
    fn garbled_bytes_are_neither_frame_nor_ascii() {
        let mut bytes: Vec<u8> =
            (0..=255).chain(FrameEncoder::new(Command::Erase.to_body())).collect();
        garble(&mut bytes);
        let mut decoder = FrameDecoder::<168>::new();
        for byte in bytes {
            assert!(!byte.is_ascii());
            assert_eq!(decoder.push(byte), Some(ser_proto::Decoded::Text(byte)));
        }
    }

    #[test]
    fn a_medium_without_rates_always_agrees() {
        assert!(rates_agree(None, Baud::B300));
        assert!(rates_agree(Some(9600), Baud::B9600));
        assert!(!rates_agree(Some(19_200), Baud::B9600));
    }
}
