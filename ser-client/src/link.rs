//! What lies between a session and its unit: a line, or a Genius bus.

use std::time::{Duration, Instant};

use crate::{Attempt, Diagnosis, Session, Transport, TransportError};

/// Carries a session's messages.
pub(crate) trait Link: Send {
    /// Sends what the attempt is about.
    fn send(&mut self, attempt: &Attempt<'_>) -> Result<(), TransportError>;

    /// Waits up to `timeout` and gives the session what arrived, which is so many bytes. `epoch` is the session's
    /// time zero.
    fn receive(
        &mut self,
        session: &mut Session,
        epoch: Instant,
        timeout: Duration,
    ) -> Result<usize, TransportError>;

    /// How long it takes from [`send`](Self::send) until the attempt's last byte arrives, about.
    fn delay(&self, attempt: &Attempt<'_>) -> Duration;

    /// Changes the rate, where there is one.
    fn set_baud(&mut self, bits_per_second: u32) -> Result<(), TransportError>;

    /// The rate, where there is one.
    fn bits_per_second(&self) -> Option<u32>;

    /// What the lack of an answer means here.
    fn diagnose(&self, diagnosis: Diagnosis) -> Diagnosis;

    /// The host's own number on the bus, where there is a bus.
    fn bus_address(&self) -> Option<u8>;
}

/// A serial line, or TCP: frames between bytes of text.
pub(crate) struct SerialLink(pub(crate) Box<dyn Transport>);

impl Link for SerialLink {
    fn send(&mut self, attempt: &Attempt<'_>) -> Result<(), TransportError> {
        Ok(self.0.write_all(attempt.frame())?)
    }

    fn receive(
        &mut self,
        session: &mut Session,
        epoch: Instant,
        timeout: Duration,
    ) -> Result<usize, TransportError> {
        let mut buf = [0; 1024];
        let count = self.0.read(&mut buf, timeout)?;
        session.process(epoch.elapsed(), buf.get(..count).unwrap_or_default());
        Ok(count)
    }

    fn delay(&self, attempt: &Attempt<'_>) -> Duration {
        attempt.duration()
    }

    fn set_baud(&mut self, bits_per_second: u32) -> Result<(), TransportError> {
        Ok(self.0.set_baud(bits_per_second)?)
    }

    fn bits_per_second(&self) -> Option<u32> {
        self.0.bits_per_second()
    }

    fn diagnose(&self, diagnosis: Diagnosis) -> Diagnosis {
        diagnosis
    }

    fn bus_address(&self) -> Option<u8> {
        None
    }
}
