//! Which recorder of the site is meant: the one that is named, or the one at the port.

#[cfg(unix)]
use std::collections::BTreeMap;

use ser_client::{Endpoint, GeniWindow};
use ser_console::Harmless;
use ser_evidence::site::{Recorder, RecorderId, Site};
use ser_observer::ClockSetting;

use crate::connection::{self, ConnectionArgs};
use crate::error::{Failure, Result, advise, inform};
use crate::output::Points;
use crate::unit_name::UnitName;

/// A site, and the recorder of it that is meant.
#[derive(Debug)]
pub(crate) struct Chosen {
    pub(crate) site: Site,
    /// The name of the site file, harmless.
    file: String,
    recorder: Option<RecorderId>,
}

/// Reads the site file, if there is one, and finds the recorder in it. Fills in its port; if a bus
/// is wanted, that of the only bus in the file.
pub(crate) fn choose(connection: &ConnectionArgs, wants_bus: bool) -> Result<ConnectionArgs> {
    let Some(path) = &connection.site else {
        return match &connection.recorder {
            None => Ok(connection.clone()),
            Some(name) => Err(Failure::usage(format!(
                "--recorder {name} is a name in a site file, and none is given"
            ))
            .hint("name the file with --site or SER_SITE; ser-cli site new writes one")),
        };
    };
    let mut chosen =
        Chosen { site: super::load(path)?, file: Harmless(path.display()).line(), recorder: None };
    let mut connection = connection.clone();
    chosen.recorder = match connection.recorder.clone() {
        Some(name) => Some(by_name(&chosen, &name, &mut connection)?),
        None if wants_bus && connection::ports(&connection).is_empty() => {
            connection.port.extend(chosen.only_bus());
            None
        }
        None => by_port(&chosen, &mut connection),
    };
    take_baud(&mut connection, chosen.recorder());
    connection.chosen = Some(chosen.into());
    Ok(connection)
}

/// The rate of the file counts where none is on the command line.
fn take_baud(connection: &mut ConnectionArgs, recorder: Option<&Recorder>) {
    connection.baud = connection.baud.or_else(|| recorder?.baud);
}

/// The recorder that is named. Its port is taken if none is given on the command line.
fn by_name(chosen: &Chosen, name: &str, connection: &mut ConnectionArgs) -> Result<RecorderId> {
    let id = chosen.site.recorder(name).ok_or_else(|| {
        let failure = Failure::usage(format!("{} has no recorder {name}", chosen.file));
        match chosen.names().as_str() {
            "" => failure.hint("add it to the file, with a [[recorder]] of its own"),
            names => failure.hint(format!("it has {names}")),
        }
    })?;
    if connection::ports(connection).is_empty() || connection.port_is_from_environment {
        let port = chosen.site.recorders.get(id.0).and_then(|recorder| recorder.port.clone());
        let port = port.ok_or_else(|| {
            Failure::usage(format!("{name} has no port in {}", chosen.file))
                .hint("add its port to the file, or give it with --port")
        })?;
        connection.port = vec![port];
    }
    Ok(id)
}

/// The recorder at the port; without a port, the only recorder that has one.
fn by_port(chosen: &Chosen, connection: &mut ConnectionArgs) -> Option<RecorderId> {
    if connection::ports(connection).is_empty() {
        let mut with_port = chosen.with_ports();
        let (Some((id, port)), None) = (with_port.next(), with_port.next()) else { return None };
        connection.port = vec![port.to_owned()];
        return Some(id);
    }
    // A port that cannot be is told when it is opened, and a bus is no recorder.
    let port = connection::port_text(connection).ok()?;
    let endpoint: Endpoint = port.parse().ok()?;
    if matches!(endpoint, Endpoint::Geni { node: None, .. }) {
        return None;
    }
    let found = chosen.at(&UnitName::of(port, &endpoint));
    if found.is_none() {
        inform(format_args!("{} has no recorder at {port}: inputs have numbers", chosen.file));
        advise("add this port to its recorder, or name the recorder with --recorder");
    }
    found
}

impl Chosen {
    /// The recorder that is meant.
    pub(crate) fn recorder(&self) -> Option<&Recorder> {
        self.recorder.and_then(|id| self.site.recorders.get(id.0))
    }

    /// Recorders that have a port, and their ports.
    pub(crate) fn with_ports(&self) -> impl Iterator<Item = (RecorderId, &str)> {
        let ports = self.site.recorders.iter().map(|recorder| recorder.port.as_deref());
        ports.enumerate().filter_map(|(index, port)| Some((RecorderId(index), port?)))
    }

    /// How to reach one of several recorders.
    pub(crate) fn reached(
        &self,
        connection: &ConnectionArgs,
        recorder: RecorderId,
    ) -> Option<ConnectionArgs> {
        let port = self.site.recorders.get(recorder.0)?.port.as_deref()?;
        let (site, file) = (self.site.clone(), self.file.clone());
        let chosen = Chosen { site, file, recorder: Some(recorder) };
        let mut connection = connection::at_port(connection, port);
        take_baud(&mut connection, chosen.recorder());
        Some(ConnectionArgs { chosen: Some(chosen.into()), ..connection })
    }

    /// The failure of a command that needs one recorder and cannot tell which.
    pub(crate) fn which(&self) -> Failure {
        let failure =
            Failure::usage(format!("which recorder of {}? No --port is given", self.file));
        match self.names().as_str() {
            "" => failure.hint("the file has no recorders; name the port with --port"),
            names => failure
                .hint(format!("name it with --recorder: the file has {names}"))
                .hint("or name its port with --port"),
        }
    }

    fn names(&self) -> String {
        let names: Vec<&str> =
            self.site.recorders.iter().map(|recorder| recorder.name.as_str()).collect();
        names.join(", ")
    }

    /// What the recorder at this port is called.
    #[cfg(unix)]
    pub(crate) fn name_at(&self, unit: &UnitName) -> Option<String> {
        let recorder = self.site.recorders.get(self.at(unit)?.0)?;
        Some(recorder.name.clone())
    }

    /// The recorder of this name, else the only one that the name may also stand for.
    fn at(&self, unit: &UnitName) -> Option<RecorderId> {
        let name = |port: &str| Some(UnitName::of(port, &port.parse().ok()?).name);
        let named: Vec<(RecorderId, String)> =
            self.with_ports().filter_map(|(id, port)| Some((id, name(port)?))).collect();
        if let Some((id, _)) = named.iter().find(|(_, name)| *name == unit.name) {
            return Some(*id);
        }
        let mut others = named
            .iter()
            .filter(|(_, name)| unit.others.contains(name) || unit.aliases.contains(name));
        match (others.next(), others.next()) {
            (Some((id, _)), None) => Some(*id),
            _ => None,
        }
    }

    /// The names of the inputs of a recorder.
    pub(crate) fn points_of(&self, recorder: RecorderId) -> Points {
        let points = self.site.points.iter().filter(|point| point.recorder == recorder);
        points.cloned().collect()
    }

    /// The port of the bus, if all recorders on a bus are on the same one.
    fn only_bus(&self) -> Option<String> {
        let bus = |port: &str| match port.parse().ok()? {
            Endpoint::Geni { window, .. } => Some(bus_name(&window)),
            _ => None,
        };
        let mut buses = self.with_ports().filter_map(|(_, port)| bus(port));
        let first = buses.next()?;
        buses.all(|bus| bus == first).then_some(first)
    }

    /// The recorders on the bus at this window, by their bus addresses.
    #[cfg(unix)]
    pub(crate) fn on_bus(&self, window: &GeniWindow) -> BTreeMap<u8, RecorderId> {
        let this_bus = bus_name(window);
        let on_it = self.with_ports().filter_map(|(id, port)| match port.parse().ok()? {
            Endpoint::Geni { window, node: Some(node) } if bus_name(&window) == this_bus => {
                Some((node, id))
            }
            _ => None,
        });
        on_it.collect()
    }
}

/// The same name for a bus, however its window is spelled.
pub(crate) fn bus_name(window: &GeniWindow) -> String {
    let endpoint = Endpoint::Geni { window: window.clone(), node: None };
    UnitName::of(&endpoint.to_string(), &endpoint).name
}

/// What the site file says of the recorder that is meant.
impl ConnectionArgs {
    fn recorder_of_site(&self) -> Option<(&Chosen, &Recorder)> {
        let chosen = self.chosen.as_deref()?;
        Some((chosen, chosen.recorder()?))
    }

    /// The names of its inputs; none if nothing is known of them.
    pub(crate) fn points(&self) -> Points {
        let chosen = self.chosen.as_deref();
        let of_recorder = chosen.and_then(|chosen| Some(chosen.points_of(chosen.recorder?)));
        of_recorder.unwrap_or_default()
    }

    /// The size of the log of an original recorder. Others say it themselves.
    pub(crate) fn known_log_size(&self) -> Option<u16> {
        let (_, recorder) = self.recorder_of_site()?;
        recorder.log_size.filter(|_| recorder.is_original)
    }

    /// Whether the recorder cannot be asked for anything beyond the manual.
    pub(crate) fn is_original(&self) -> bool {
        self.recorder_of_site().is_some_and(|(_, recorder)| recorder.is_original)
    }

    /// What the clock is set to.
    pub(crate) fn clock_setting(&self) -> Option<ClockSetting> {
        let (chosen, recorder) = self.recorder_of_site()?;
        Some(ClockSetting::of(recorder.clock, &chosen.site))
    }

    /// What all clocks of a bus are set to at once, if the site file knows recorders on it.
    #[cfg(unix)]
    pub(crate) fn clock_setting_of_bus(&self) -> Result<Option<ClockSetting>> {
        let (Some(chosen), Endpoint::Geni { window, .. }) =
            (self.chosen.as_deref(), connection::endpoint(self)?)
        else {
            return Ok(None);
        };
        let recorders = chosen.on_bus(&window).into_values();
        let recorders = recorders.filter_map(|id| chosen.site.recorders.get(id.0));
        let mut settings: Vec<(&str, ClockSetting)> = recorders
            .map(|recorder| (&*recorder.name, ClockSetting::of(recorder.clock, &chosen.site)))
            .collect();
        let Some((first, setting)) = settings.pop() else { return Ok(None) };
        match settings.iter().find(|(_, other)| *other != setting) {
            None => Ok(Some(setting)),
            Some((second, other)) => Err(Failure::usage(format!(
                "one broadcast cannot set {second} to {other} and {first} to {setting}"
            ))
            .hint("give them the same `clock` in the site file, or set one after the other")
            .hint("ser-cli clock set --recorder NAME sets a single one")),
        }
    }
}
