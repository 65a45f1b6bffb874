//! `genius globals`: the live inputs of every recorder.

use std::io::{self, Write};

use super::recorder_inputs;
use crate::cli::ConnectionArgs;
use crate::connection;
use crate::error::{Result, advise};

pub(super) fn run(connection: &ConnectionArgs) -> Result<()> {
    let devices = connection::open_bus(connection)?.devices()?;
    let recorders: Vec<_> =
        devices.iter().filter_map(|device| Some((device.number, recorder_inputs(device)?))).collect();
    let mut out = io::stdout().lock();
    writeln!(out, "node  inputs  on")?;
    for (node, global) in &recorders {
        let on = if global.state.is_empty() { "none".to_string() } else { global.to_string() };
        writeln!(out, "{node:>4}  {:>6}  {on}", global.model.inputs())?;
    }
    out.flush()?;
    if recorders.is_empty() {
        advise("no recorder is logged in; ser-cli genius devices lists what is");
    }
    Ok(())
}
