//! `status`: what the recorder is doing.

use std::io::{self, Write};

use ser_client::{Delivery, LogPosition, Unit};
use ser_console::Harmless;
use ser_proto::{Configuration, Entry, Mode, Model};

use crate::connection::{self, ConnectionArgs, unless_unanswered};
use crate::error::{Result, advise};
use crate::output::{Points, field};
use crate::site_file::Chosen;

const EXAMPLES: &str = "\
Examples:
  ser-cli status --port /dev/ttyUSB0
  ser-cli status --port tcp://10.0.0.7:4000 --timeout 5s";

/// Ask the recorder what it is doing: recording or not, log, settings, latest event.
///
/// Original recorders answer only some of this; the rest is shown as not known.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {}

pub(crate) fn run(_args: &Args, connection: &ConnectionArgs) -> Result<()> {
    let mut unit = connection::open(connection)?;
    // Every recorder answers a read. One that does not is not there, and must not be waited for
    // again.
    let position = unit.log_position()?;
    let mode = unless_unanswered(unit.mode())?;
    let configuration = match mode {
        Some(_) => Some(unit.configuration()?),
        None => None,
    };
    let size = configuration.map(|configuration| configuration.size);
    let latest = latest_event(&mut unit, position, size)?;
    let mut out = io::stdout().lock();
    let points = connection.points();
    if let Some(chosen) = &connection.chosen {
        write_names(&mut out, chosen)?;
    }
    write(&mut out, mode, position, configuration, latest, &points)?;
    if mode.is_none() {
        advise(
            "mode and settings are not known: an original recorder does not answer the queries \
             for them",
        );
    }
    Ok(())
}

fn latest_event(
    unit: &mut Unit,
    position: LogPosition,
    size: Option<u16>,
) -> Result<Option<(u16, Entry, Model)>> {
    // Entry n is slot n - 1, and the newest is in the slot before the next one. Before slot 0 comes
    // the last slot.
    let number = match (position.next_slot, size) {
        (0, None) => return Ok(None),
        (0, Some(size)) => size,
        (next, _) => next,
    };
    let mut latest = None;
    unit.read_range(number, 1, size.unwrap_or(number), &mut |delivery| {
        if let Delivery::Event { entry_number, entry, model, .. } = delivery {
            latest = Some((entry_number, entry, model));
        }
    })?;
    Ok(latest)
}

/// The names of site and recorder.
fn write_names(out: &mut dyn Write, chosen: &Chosen) -> io::Result<()> {
    let Some(recorder) = chosen.recorder() else { return Ok(()) };
    field(out, "site", Harmless(&chosen.site.name).line())?;
    field(out, "recorder", Harmless(&recorder.name).line())
}

fn write(
    out: &mut dyn Write,
    mode: Option<Mode>,
    position: LogPosition,
    configuration: Option<Configuration>,
    latest: Option<(u16, Entry, Model)>,
    points: &Points,
) -> io::Result<()> {
    if let Some((_, _, model)) = latest {
        field(out, "inputs", model.inputs())?;
    }
    if let Some(mode) = mode {
        field(out, "mode", if mode.recording { "recording" } else { "stopped" })?;
        field(out, "version", format_args!("{}.{:02}", mode.version / 100, mode.version % 100))?;
    }
    field(out, "events", format_args!("{} since the last erase (modulo 65536)", position.total))?;
    let next = u32::from(position.next_slot) + 1;
    match configuration {
        Some(Configuration { size, .. }) => {
            field(out, "next entry", format_args!("{next} of {size}"))?;
        }
        None => field(out, "next entry", next)?,
    }
    match latest {
        Some((number, entry, _)) => {
            field(out, "latest event", format_args!("{} (entry {number})", entry.time))?;
            field(out, "inputs on", points.on(entry.state))?;
        }
        None => field(out, "latest event", "none")?,
    }
    if let Some(configuration) = configuration {
        super::config::write_line_settings(out, &configuration)?;
    }
    out.flush()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::testing::entry;

    #[test]
    fn everything_known_is_shown_and_nothing_else() {
        let mut out = Vec::new();
        let mode = Mode { recording: true, version: 105 };
        let latest = (7, entry("00.250", &[3], &[1, 3]), Model::Ser160);
        let position = LogPosition { total: 7, next_slot: 7 };
        write(
            &mut out,
            Some(mode),
            position,
            Some(Configuration::default()),
            Some(latest),
            &Points::default(),
        )
        .unwrap();
        assert_eq!(
            String::from_utf8(out).unwrap(),
            "inputs          16\n\
             mode            recording\n\
             version         1.05\n\
             events          7 since the last erase (modulo 65536)\n\
             next entry      8 of 2048\n\
             latest event    2026-11-22T10:00:00.250 (entry 7)\n\
             inputs on       1 3\n\
             line baud       9600\n\
             auto report     off\n\
             report to       0\n\
             auto print      off\n"
        );
        let mut out = Vec::new();
        write(
            &mut out,
            None,
            LogPosition { total: 0, next_slot: 0 },
            None,
            None,
            &Points::default(),
        )
        .unwrap();
        assert_eq!(
            String::from_utf8(out).unwrap(),
            "events          0 since the last erase (modulo 65536)\n\
             next entry      1\n\
             latest event    none\n"
        );
    }
}
