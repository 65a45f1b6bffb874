//! The link to one recorder on the bus: a session's messages in datagrams.

use std::time::Duration;

use geni_board::ReceivedDatagram;

use super::host::GeniHost;
use crate::session::diagnosis::Diagnosis;
use crate::session::link::Link;
use crate::session::{Attempt, Session};
use crate::transport::transport_error::TransportError;

/// The link to one recorder on the bus.
pub(crate) struct GeniusLink {
    pub(crate) host: GeniHost,
    pub(crate) node: u8,
}

impl GeniusLink {
    /// Gives the session its messages and returns the number of bytes.
    fn hand_over(&self, received: &[ReceivedDatagram], session: &mut Session) -> usize {
        for datagram in received {
            session.process_body(self.now(), &datagram.data);
        }
        received.iter().map(|datagram| datagram.data.len()).sum()
    }
}

impl Link for GeniusLink {
    fn send(&mut self, attempt: &Attempt<'_>) -> Result<(), TransportError> {
        Ok(self.host.send(self.node, attempt.command())?)
    }

    fn receive(
        &mut self,
        session: &mut Session,
        timeout: Duration,
    ) -> Result<usize, TransportError> {
        let received = self.host.receive(self.node, timeout)?;
        Ok(self.hand_over(&received, session))
    }

    fn receive_waiting(&mut self, session: &mut Session) -> Result<(), TransportError> {
        let received = self.host.take_waiting(self.node)?;
        self.hand_over(&received, session);
        Ok(())
    }

    fn now(&self) -> Duration {
        self.host.now()
    }

    fn delay(&self, _attempt: &Attempt<'_>) -> Duration {
        self.host.delay()
    }

    /// The bus has a rate, but a host cannot change it.
    fn set_baud(&mut self, _bits_per_second: u32) -> Result<(), TransportError> {
        Ok(())
    }

    fn bits_per_second(&self) -> Option<u32> {
        None
    }

    fn keeps_rate(&self) -> bool {
        false
    }

    fn diagnose(&self, diagnosis: Diagnosis) -> Diagnosis {
        match diagnosis {
            Diagnosis::Silent if self.host.is_undelivered() => {
                Diagnosis::Unacknowledged { node: self.node }
            }
            Diagnosis::Silent => Diagnosis::SilentOnBus { node: self.node },
            other => other,
        }
    }

    fn bus_address(&self) -> Option<u8> {
        Some(self.host.number())
    }
}
