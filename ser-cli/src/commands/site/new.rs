//! `site new`: a site file to begin with.

use std::fs::File;
use std::io::{self, Write};
use std::path::Path;

use ser_client::{Endpoint, Unit};
use ser_proto::Model;

use super::template::{self, Known};
use crate::connection::{self, ConnectionArgs};
use crate::error::{Failure, Result, advise, inform};
use crate::unit_name::UnitName;

pub(super) fn run(output: Option<&Path>, connection: &ConnectionArgs) -> Result<()> {
    // Before anybody is asked, which may take a while.
    check_ports(connection)?;
    let file = output.map(create).transpose()?;
    let recorders: Vec<Known> = connection::ports(connection)
        .into_iter()
        .map(|port| ask(&connection::at_port(connection, port), port))
        .collect::<Result<_>>()?;
    let text = template::text(&zone(), &recorders);
    let (Some(mut file), Some(path)) = (file, output) else {
        let mut out = io::stdout().lock();
        out.write_all(text.as_bytes())?;
        return Ok(out.flush()?);
    };
    let written = file.write_all(text.as_bytes()).and_then(|()| file.sync_all());
    written.map_err(|error| Failure::writing(path.display(), &error))?;
    inform(format_args!("{} is written", path.display()));
    advise(format_args!(
        "give its recorders and points their names, then ser-cli site check {}",
        path.display()
    ));
    Ok(())
}

/// Two spellings of one port would become two recorders, and the site file would not be valid.
fn check_ports(connection: &ConnectionArgs) -> Result<()> {
    let mut known: Vec<(String, &str)> = Vec::new();
    for port in connection::ports(connection) {
        let name = connection::unit_name(&connection::at_port(connection, port))?.name;
        if let Some((_, first)) = known.iter().find(|(known, _)| *known == name) {
            return Err(Failure::usage(match *first == port {
                true => format!("--port {port} is given twice"),
                false => format!("--port {first} and --port {port} are the same port"),
            })
            .hint("give each recorder once"));
        }
        known.push((name, port));
    }
    Ok(())
}

fn create(path: &Path) -> Result<File> {
    File::create_new(path).map_err(|error| match error.kind() {
        io::ErrorKind::AlreadyExists => {
            Failure::new(format!("{} exists, and is not overwritten", path.display()))
                .hint("give another name with -o, or remove the file first")
        }
        _ => Failure::writing(path.display(), &error),
    })
}

/// The time zone of this computer, if it has a name.
fn zone() -> String {
    let zone = jiff::tz::TimeZone::try_system().ok();
    let name = zone.as_ref().and_then(jiff::tz::TimeZone::iana_name);
    let is_known = |name: &&str| jiff::tz::TimeZone::get(name).is_ok();
    match name.filter(is_known) {
        None | Some("Etc/UTC") => "UTC".to_owned(),
        Some(name) => name.to_owned(),
    }
}

/// What a recorder says of itself. One that cannot be reached is known by its port only.
fn ask(connection: &ConnectionArgs, port: &str) -> Result<Known> {
    // A port that cannot be is a mistake on the command line.
    let endpoint: Endpoint = connection::endpoint(connection)?;
    // A lasting name, where the port has one.
    let port = match endpoint {
        Endpoint::Serial { .. } => UnitName::of(port, &endpoint).name,
        _ => port.to_owned(),
    };
    let unknown = |port| Known { port, ..Known::default() };
    let answers = connection::open(connection).and_then(|mut unit| {
        let position = unit.log_position()?;
        let configuration = connection::unless_unanswered(unit.configuration())?;
        let size = configuration.map(|configuration| configuration.size);
        let model = model(&mut unit, position.next_slot, size)?;
        Ok(Known { model, size, has_answered: true, ..unknown(port.clone()) })
    });
    Ok(answers.unwrap_or_else(|failure| {
        failure.warn();
        advise(format_args!("{port} is in the file with its port only"));
        unknown(port)
    }))
}

/// The model, which an entry shows; not known of an empty log.
fn model(unit: &mut Unit, next_slot: u16, size: Option<u16>) -> Result<Option<Model>> {
    let newest = match next_slot {
        0 => size.unwrap_or(1),
        next => next,
    };
    let mut model = None;
    unit.read_range(newest, 1, size.unwrap_or(newest), &mut |delivery| {
        if let ser_client::Delivery::Event { model: found, .. } = delivery {
            model = Some(found);
        }
    })?;
    Ok(model)
}
