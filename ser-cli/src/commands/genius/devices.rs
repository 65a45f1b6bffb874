//! `genius devices`: the devices on the bus.

use std::collections::BTreeMap;
use std::fmt;
use std::io::{self, Write};

use ser_client::{BlockKind, BusDevice, GeniHost, Recognition};
use ser_proto::genius::GlobalData;

use crate::connection::{self, ConnectionArgs};
use crate::error::{Result, advise, inform, warn};

pub(super) fn run(connection: &ConnectionArgs, how: Recognition) -> Result<()> {
    let host = connection::open_bus(connection)?;
    let recorders: BTreeMap<u8, GlobalData> = host.recorders(how)?.recorders.into_iter().collect();
    let devices = host.devices()?;
    let mut out = io::stdout().lock();
    writeln!(out, "node  model  in  out  reference  kind")?;
    for device in &devices {
        writeln!(out, "{}", Row { device, recorder: recorders.get(&device.number) })?;
    }
    out.flush()?;
    tell_about_board(&host);
    Ok(())
}

fn tell_about_board(host: &GeniHost) {
    let status = host.status();
    let scan = status.and_then(|status| status.scan_ms);
    let scan = scan.map_or(String::new(), |ms| format!("; a bus scan takes {ms} ms"));
    let errors = status.map_or(0, |status| status.bus_errors);
    inform(format_args!(
        "this host is {}{scan}; bus errors since its board started: {errors}",
        host.number()
    ));
    if status.is_some_and(|status| status.excessive_errors) {
        warn("ten bus errors or more within the last 10 s");
        advise(
            "check the bus cable, its shield and its terminators, and that all devices have the \
             same bus rate",
        );
    }
}

/// No reference address is assigned.
const NO_REFERENCE: u16 = 0xFFFF;

/// A device as a row of the table.
struct Row<'a> {
    device: &'a BusDevice,
    /// Its global data, if it is a recorder.
    recorder: Option<&'a GlobalData>,
}

impl fmt::Display for Row<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let BusDevice { number, device, .. } = self.device;
        let reference = match device.reference {
            NO_REFERENCE => "none".to_string(),
            reference => reference.to_string(),
        };
        let (model, inputs, outputs) = (device.model, device.input_len, device.output_len);
        write!(f, "{number:>4}  {model:>5}  {inputs:>2}  {outputs:>3}  {reference:>9}  ")?;
        match (self.recorder, device.kind) {
            (Some(global), _) => write!(f, "recorder, {} inputs", global.model.inputs()),
            (None, BlockKind::Unknown) => f.write_str("not told"),
            (None, BlockKind::Inputs) => f.write_str("inputs"),
            (None, BlockKind::Outputs) => f.write_str("outputs"),
            (None, BlockKind::Combination) => f.write_str("inputs and outputs"),
        }
    }
}
