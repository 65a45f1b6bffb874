//! The Genius buses of a site: each window is opened once, for all recorders on its bus.

#[cfg(unix)]
use ser_client::Endpoint;
use ser_client::Unit;

use crate::connection::{self, ConnectionArgs};
use crate::error::Result;

/// Opened buses.
#[derive(Default)]
pub(crate) struct Buses {
    #[cfg(unix)]
    by_name: std::sync::Mutex<std::collections::BTreeMap<String, Bus>>,
}

/// A bus, which one thread at a time may open. Others may open other buses meanwhile.
#[cfg(unix)]
type Bus = std::sync::Arc<std::sync::Mutex<Option<ser_client::GeniHost>>>;

impl Buses {
    /// Opens the way to a recorder.
    pub(crate) fn open(&self, connection: &ConnectionArgs) -> Result<Unit> {
        #[cfg(unix)]
        if let Endpoint::Geni { window, node: Some(node) } = connection::endpoint(connection)? {
            let bus = self.named(crate::site_file::bus_name(&window));
            let mut open = bus.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            let host = match &*open {
                Some(host) => host.clone(),
                None => open.insert(connection::open_bus(connection)?).clone(),
            };
            return Ok(connection::on_bus(&host, node, connection));
        }
        connection::open(connection)
    }

    #[cfg(unix)]
    fn named(&self, name: String) -> Bus {
        let by_name = self.by_name.lock();
        let mut by_name = by_name.unwrap_or_else(std::sync::PoisonError::into_inner);
        by_name.entry(name).or_default().clone()
    }
}
