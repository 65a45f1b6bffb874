//! The connection between a session and its recorder: a line, or a Genius bus.
//!
//! A [`Link`] carries the messages of a session and tells it the time. The one for serial ports and
//! TCP is here; the one for a bus is in `genius`.

use std::sync::Arc;
use std::time::Duration;

use super::diagnosis::Diagnosis;
use super::{Attempt, Session};
use crate::transport::Transport;
use crate::transport::clock::Clock;
use crate::transport::transport_error::TransportError;

/// How much is taken from a line in one go, at most. A peer that never stops sending must not keep
/// the host from asking.
const MAX_WAITING_BYTES: usize = 64 * 1024;

/// Carries a session's messages.
pub(crate) trait Link: Send {
    /// Sends an attempt.
    fn send(&mut self, attempt: &Attempt<'_>) -> Result<(), TransportError>;

    /// Waits up to `timeout`, gives the session what arrived and returns the number of bytes.
    fn receive(
        &mut self,
        session: &mut Session,
        timeout: Duration,
    ) -> Result<usize, TransportError>;

    /// Gives the session everything that has already arrived.
    fn receive_waiting(&mut self, session: &mut Session) -> Result<(), TransportError>;

    /// The time of the sessions on this link.
    fn now(&self) -> Duration;

    /// Roughly how long it takes from [`send`](Self::send) until the attempt's last byte arrives.
    fn delay(&self, attempt: &Attempt<'_>) -> Duration;

    /// Changes the rate, if the link has one.
    fn set_baud(&mut self, bits_per_second: u32) -> Result<(), TransportError>;

    /// The rate, if the link has one.
    fn bits_per_second(&self) -> Option<u32>;

    /// Whether bytes take as long as the rate says.
    fn keeps_rate(&self) -> bool;

    /// What the lack of an answer means here.
    fn diagnose(&self, diagnosis: Diagnosis) -> Diagnosis;

    /// The host's own bus address, if the link is a bus.
    fn bus_address(&self) -> Option<u8>;
}

/// A serial line, or TCP: frames between bytes of text.
pub(crate) struct SerialLink {
    transport: Box<dyn Transport>,
    clock: Arc<dyn Clock>,
}

impl SerialLink {
    pub(crate) fn new(transport: Box<dyn Transport>, clock: Arc<dyn Clock>) -> SerialLink {
        SerialLink { transport, clock }
    }
}

impl Link for SerialLink {
    fn send(&mut self, attempt: &Attempt<'_>) -> Result<(), TransportError> {
        Ok(self.transport.write_all(attempt.frame())?)
    }

    fn receive(
        &mut self,
        session: &mut Session,
        timeout: Duration,
    ) -> Result<usize, TransportError> {
        let mut buf = [0; 1024];
        let count = self.transport.read(&mut buf, timeout)?;
        session.process(self.now(), buf.get(..count).unwrap_or_default());
        Ok(count)
    }

    fn receive_waiting(&mut self, session: &mut Session) -> Result<(), TransportError> {
        let mut taken = 0;
        while taken < MAX_WAITING_BYTES {
            match self.receive(session, Duration::ZERO)? {
                0 => break,
                count => taken += count,
            }
        }
        Ok(())
    }

    fn now(&self) -> Duration {
        self.clock.now()
    }

    fn delay(&self, attempt: &Attempt<'_>) -> Duration {
        attempt.duration()
    }

    fn set_baud(&mut self, bits_per_second: u32) -> Result<(), TransportError> {
        Ok(self.transport.set_baud(bits_per_second)?)
    }

    fn bits_per_second(&self) -> Option<u32> {
        self.transport.bits_per_second()
    }

    fn keeps_rate(&self) -> bool {
        self.transport.keeps_rate()
    }

    fn diagnose(&self, diagnosis: Diagnosis) -> Diagnosis {
        diagnosis
    }

    fn bus_address(&self) -> Option<u8> {
        None
    }
}
