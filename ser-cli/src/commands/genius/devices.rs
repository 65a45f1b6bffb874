//! `genius devices`: who is on the bus.

use std::fmt;
use std::io::{self, Write};

use ser_client::{BlockKind, BusDevice};

use super::recorder_inputs;
use crate::cli::ConnectionArgs;
use crate::connection;
use crate::error::{Result, inform};

pub(super) fn run(connection: &ConnectionArgs) -> Result<()> {
    let host = connection::open_bus(connection)?;
    let devices = host.devices()?;
    let mut out = io::stdout().lock();
    writeln!(out, "node  model  in  out  reference  kind")?;
    for device in &devices {
        writeln!(out, "{}", Row(device))?;
    }
    out.flush()?;
    let scan =
        host.scan_time().map_or(String::new(), |scan| format!("; a bus scan takes {} ms", scan.as_millis()));
    inform(format_args!("this host is {}{scan}", host.number()));
    Ok(())
}

/// No reference address is assigned.
const NO_REFERENCE: u16 = 0xFFFF;

/// A device as a row of the table.
struct Row<'a>(&'a BusDevice);

impl fmt::Display for Row<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let BusDevice { number, device, .. } = self.0;
        let reference = match device.reference {
            NO_REFERENCE => "none".to_string(),
            reference => reference.to_string(),
        };
        let (model, inputs, outputs) = (device.model, device.input_len, device.output_len);
        write!(f, "{number:>4}  {model:>5}  {inputs:>2}  {outputs:>3}  {reference:>9}  ")?;
        match (recorder_inputs(self.0), device.kind) {
            (Some(global), _) => write!(f, "recorder, {} inputs", global.model.inputs()),
            (None, BlockKind::Unknown) => f.write_str("not told"),
            (None, BlockKind::Inputs) => f.write_str("inputs"),
            (None, BlockKind::Outputs) => f.write_str("outputs"),
            (None, BlockKind::Combination) => f.write_str("inputs and outputs"),
        }
    }
}
