//! The bench's end of the plugin's socket.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::os::unix::net::UnixStream;

/// How many bytes are taken at once.
const PORTION: usize = 1 << 16;

/// The stream in which the plugin says what is executed.
pub(super) struct Tracer<S = UnixStream> {
    stream: BufReader<S>,
}

impl<S: Read + Write> Tracer<S> {
    pub(super) fn new(stream: S) -> Tracer<S> {
        Tracer { stream: BufReader::with_capacity(PORTION, stream) }
    }

    /// Lets the processor go on. `tell` says whether the plugin is to tell of each instruction.
    pub(super) fn go(&mut self, tell: bool) -> io::Result<()> {
        self.stream.get_mut().write_all(if tell { b"t" } else { b"-" })
    }

    /// Takes words up to a stop, and returns its address.
    pub(super) fn read(&mut self, executed: &mut impl FnMut(u32)) -> io::Result<u32> {
        loop {
            let (words, _) = self.stream.fill_buf()?.as_chunks::<4>();
            let mut taken = 0;
            let mut stop = None;
            for &word in words {
                taken += 4;
                let word = u32::from_le_bytes(word);
                if word & 1 != 0 {
                    stop = Some(word & !1);
                    break;
                }
                executed(word);
            }
            if taken > 0 {
                self.stream.consume(taken);
            } else if let Some(address) = self.read_split(executed)? {
                return Ok(address);
            }
            if let Some(address) = stop {
                return Ok(address);
            }
        }
    }

    /// Takes a word that is not yet complete, or of which nothing is there.
    fn read_split(&mut self, executed: &mut impl FnMut(u32)) -> io::Result<Option<u32>> {
        let mut word = [0; 4];
        self.stream.read_exact(&mut word)?;
        let word = u32::from_le_bytes(word);
        if word & 1 != 0 {
            return Ok(Some(word & !1));
        }
        executed(word);
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A source that gives bytes in portions, as a socket does.
    struct Portions(Vec<Vec<u8>>);

    impl Read for Portions {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            if self.0.is_empty() {
                return Ok(0);
            }
            let portion = self.0.remove(0);
            buffer[..portion.len()].copy_from_slice(&portion);
            Ok(portion.len())
        }
    }

    impl Write for Portions {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn words_come_whole_wherever_portions_end() {
        let bytes: Vec<u8> =
            [0x100_u32, 0x102, 0x201, 0x200, 0x301].iter().flat_map(|w| w.to_le_bytes()).collect();
        for size in 1..=bytes.len() {
            let portions = bytes.chunks(size).map(<[u8]>::to_vec).collect();
            let mut tracer = Tracer::new(Portions(portions));
            let mut executed = Vec::new();
            let mut next = || tracer.read(&mut |address| executed.push(address));
            let stops = [next().unwrap(), next().unwrap()];
            assert_eq!(next().unwrap_err().kind(), io::ErrorKind::UnexpectedEof);
            assert_eq!((stops, &executed[..]), ([0x200, 0x300], &[0x100, 0x102, 0x200][..]));
        }
    }
}
