//! Recorders.

use std::collections::BTreeMap;

use crate::site::checks::{duplicate_name, duplicate_port};
use crate::site::diagnostic::{Findings, Span};
use crate::site::file::{RecorderTable, SiteTable};
use crate::site::model::Recorder;

/// Tells names and ports that occur twice.
pub(super) fn look(table: &SiteTable, findings: &mut Findings) {
    let (mut names, mut ports) = (BTreeMap::<&str, Span>::new(), BTreeMap::<&str, Span>::new());
    for RecorderTable { name, port, .. } in &table.recorders {
        if let Some(name) = name {
            match names.get(name.get_ref().as_str()) {
                Some(first) => {
                    let twice = (name.span(), name.get_ref().as_str());
                    duplicate_name::found(findings, twice, "recorders", first.clone());
                }
                None => drop(names.insert(name.get_ref(), name.span())),
            }
        }
        if let Some(port) = port {
            match ports.get(port.get_ref().as_str()) {
                Some(first) => {
                    duplicate_port::found(findings, (port.span(), port.get_ref()), first.clone());
                }
                None => drop(ports.insert(port.get_ref(), port.span())),
            }
        }
    }
}

/// All recorders of a file without errors.
pub(super) fn recorders(table: &SiteTable) -> Vec<Recorder> {
    let resolved = |table: &RecorderTable| {
        let default = Recorder::named(table.name.as_ref()?.get_ref());
        Some(Recorder {
            port: table.port.as_ref().map(|port| port.get_ref().clone()),
            baud: table.baud,
            model: table.model.as_ref().map(|model| *model.get_ref()),
            log_size: table.log_size,
            is_original: table.is_original.unwrap_or(default.is_original),
            clock: table.clock.unwrap_or(default.clock),
            drift_ppb: table.drift_ppb.unwrap_or(default.drift_ppb),
            wander_ppb: table.wander_ppb.unwrap_or(default.wander_ppb),
            delays: table.delays,
            ..default
        })
    };
    table.recorders.iter().filter_map(resolved).collect()
}
