//! Ways to recorders. Each window to a Genius bus is opened once, for all recorders on it.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use ser_client::{Endpoint, LineRate, RequestError, TransportError, Unit};
use ser_evidence::site::Recorder;

use crate::trouble::Trouble;

/// Opened buses.
#[derive(Default)]
pub(crate) struct Ports {
    #[cfg(unix)]
    buses: std::sync::Mutex<Vec<(ser_client::GeniWindow, Bus)>>,
}

/// A bus, which one thread at a time may open. Others may open other buses meanwhile.
#[cfg(unix)]
type Bus = Arc<std::sync::Mutex<Option<ser_client::GeniHost>>>;

impl Ports {
    /// Opens the way to a recorder. Nothing is sent yet.
    pub(crate) fn open(
        &self,
        recorder: &Recorder,
        options: ser_client::Options,
        stop: &Arc<AtomicBool>,
    ) -> Result<Unit, Trouble> {
        let port = recorder.port.as_deref().unwrap_or_default();
        let endpoint: Endpoint = port.parse().map_err(Trouble::NoPort)?;
        #[cfg(unix)]
        if let Endpoint::Geni { window, node: Some(node) } = &endpoint {
            let bus = self.bus(window);
            let mut open = bus.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            let host = match &*open {
                Some(host) => host.clone(),
                None => {
                    let patience = options.timeout;
                    let host = ser_client::GeniHost::open_unless(window.clone(), patience, stop);
                    open.insert(host.map_err(Trouble::Port)?).clone()
                }
            };
            return Ok(host.unit(*node, options));
        }
        let baud = recorder.baud.unwrap_or_default().bits_per_second();
        let mut unit = Unit::open_unless(&endpoint, baud, options, stop).map_err(Trouble::Port)?;
        // A terminal server does not report its port's rate, so the site file may state it.
        if let (false, Some(baud)) = (endpoint.has_baud(), recorder.baud) {
            unit.set_line_rate(LineRate::BitsPerSecond(baud.bits_per_second()));
        }
        Ok(unit)
    }

    /// Forgets the window to a bus that does not come back by itself. It is opened again when
    /// nobody has it any more.
    pub(crate) fn after(&self, trouble: &Trouble, recorder: &Recorder) {
        #[cfg(unix)]
        if let Trouble::Recorder(RequestError::Transport(TransportError::Genius(error))) = trouble
            && !error.may_pass()
            && let Some(port) = &recorder.port
            && let Ok(Endpoint::Geni { window, .. }) = port.parse()
        {
            let bus = self.bus(&window);
            *bus.lock().unwrap_or_else(std::sync::PoisonError::into_inner) = None;
        }
    }

    #[cfg(unix)]
    fn bus(&self, window: &ser_client::GeniWindow) -> Bus {
        let mut buses = self.buses.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        match buses.iter().find(|(known, _)| known == window) {
            Some((_, bus)) => Arc::clone(bus),
            None => {
                let bus = Bus::default();
                buses.push((window.clone(), Arc::clone(&bus)));
                bus
            }
        }
    }
}
