//! Opening a connection to a recorder, by any kind of endpoint.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::Unit;
#[cfg(unix)]
use crate::genius::{host::GeniHost, link::GeniusLink};
use crate::session::options::Options;
#[cfg(unix)]
use crate::session::{Session, Timing};
use crate::transport::endpoint::Endpoint;
#[cfg(unix)]
use crate::transport::line_rate::LineRate;
use crate::transport::open::open;
use crate::transport::open_error::OpenError;

impl Unit {
    /// Opens the connection to a recorder. `baud` is the rate of a serial port in bits per second.
    ///
    /// # Errors
    /// See [`OpenError`].
    pub fn open(endpoint: &Endpoint, baud: u32, options: Options) -> Result<Unit, OpenError> {
        Unit::open_unless(endpoint, baud, options, &Arc::default())
    }

    /// The same, but gives up when `stop` is set while it waits for a board on a bus.
    ///
    /// # Errors
    /// See [`OpenError`].
    #[cfg_attr(not(unix), expect(unused_variables, reason = "there are no windows to boards"))]
    pub fn open_unless(
        endpoint: &Endpoint,
        baud: u32,
        options: Options,
        stop: &Arc<AtomicBool>,
    ) -> Result<Unit, OpenError> {
        match endpoint {
            #[cfg(unix)]
            Endpoint::Geni { window, node: Some(node) } => {
                let host = GeniHost::open_with_node(window.clone(), options.timeout, stop, *node)?;
                Ok(host.unit(*node, options))
            }
            line => Ok(Unit::new(open(line, baud)?, options)),
        }
    }
}

#[cfg(unix)]
impl GeniHost {
    /// A recorder on the bus.
    #[must_use]
    pub fn unit(&self, node: u8, options: Options) -> Unit {
        let Options { timeout, retries } = options;
        let timing = Timing { timeout, retries, line_rate: LineRate::Instant };
        // A bus has many talkers, so two requests at once would fill no silence.
        let session = Session::new(timing).one_at_a_time();
        let link = Box::new(GeniusLink { host: self.clone(), node });
        Unit::over(link, session)
    }
}
