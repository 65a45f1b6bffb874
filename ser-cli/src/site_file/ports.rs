//! Ports in a site file are what `--port` would take, and lead to different recorders.

use std::collections::BTreeMap;

use ser_client::Endpoint;
use ser_console::Harmless;
use ser_evidence::site::{Diagnostic, PortPlace, Reading, Related, Span};

use crate::unit_name::UnitName;

const BAD_PORT: &str = "bad-port";

/// Adds what is wrong with ports to what is known to be wrong.
pub(super) fn look(reading: &mut Reading) {
    let mut found = Vec::new();
    let mut units: BTreeMap<String, (&str, Span)> = BTreeMap::new();
    for PortPlace { port, span, .. } in &reading.ports {
        match port.parse::<Endpoint>() {
            Err(error) => {
                let bad = super::error(BAD_PORT, span.clone(), error.to_string());
                found.push(with_help(
                    bad,
                    "write it as for --port: a serial port, tcp://HOST:PORT, or geni:FILE?node=N",
                ));
            }
            Ok(Endpoint::Geni { node: None, .. }) => {
                let phrase = "this is a Genius bus and no recorder".to_owned();
                let bad = super::error(BAD_PORT, span.clone(), phrase);
                found
                    .push(with_help(bad, "add the recorder's bus address, as in geni:FILE?node=5"));
            }
            Ok(endpoint) => {
                let name = UnitName::of(port, &endpoint).name;
                match units.get(&name) {
                    // The same text twice is told without looking at this computer.
                    Some((first, place)) if first != port => {
                        found.push(same_unit(span.clone(), &name, place.clone()));
                    }
                    Some(_) => {}
                    None => drop(units.insert(name, (port, span.clone()))),
                }
            }
        }
    }
    if !found.is_empty() {
        reading.site = None;
        reading.diagnostics.extend(found);
        reading.diagnostics.sort_by_key(|found| found.span.start);
    }
}

fn with_help(mut diagnostic: Diagnostic, help: &str) -> Diagnostic {
    diagnostic.helps.push(help.to_owned());
    diagnostic
}

fn same_unit(span: Span, name: &str, first: Span) -> Diagnostic {
    let phrase = "two recorders at the same port, spelled differently".to_owned();
    let mut twice = super::error("duplicate-port", span, phrase);
    twice.related.push(Related { span: first, label: "first used here".to_owned() });
    with_help(twice, &format!("both lead to {}", Harmless(name).line()))
}
