//! `genius globals`: the live inputs of every recorder.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use ser_client::{BusRecorders, Endpoint, GeniHost, Recognition};
use ser_console::Harmless;
use ser_evidence::site::RecorderId;
use ser_proto::genius::GlobalData;

use super::{no_recorder, silent_candidates};
use crate::connection::{self, ConnectionArgs};
use crate::error::{Result, advise, inform};
use crate::interrupt;
use crate::outage::Outage;
use crate::output::Points;
use crate::time::local_now;

/// How often the bus is looked at.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// The recorders' global data, by bus address.
type Globals = BTreeMap<u8, GlobalData>;

pub(super) fn run(connection: &ConnectionArgs, follow: bool, how: Recognition) -> Result<()> {
    let stop = if follow { Some(interrupt::catch()?) } else { None };
    let host = connection::open_bus(connection)?;
    let BusRecorders { recorders, silent } = host.recorders(how)?;
    if let Some(silent) = silent_candidates(&silent) {
        inform(&silent);
    }
    let globals: Globals = recorders.into_iter().collect();
    let names = Names::on_bus(connection);
    let mut out = io::stdout().lock();
    match stop {
        Some(stop) => {
            if globals.is_empty() {
                advise(
                    "no recorder is logged in yet; ser-cli genius devices lists the devices that \
                     are",
                );
            }
            inform("the bus is followed until Ctrl-C");
            let outage = Outage::new(connection::options(connection).timeout);
            Follow { host, how, stop, outage, names }.run(globals, &mut out)
        }
        None if globals.is_empty() => Err(no_recorder()),
        None => {
            writeln!(out, "{HEADER}")?;
            globals.iter().try_for_each(|(&node, global)| {
                writeln!(out, "{}", names.row(node, Some(global)))
            })?;
            Ok(out.flush()?)
        }
    }
}

/// Follows a bus.
struct Follow {
    host: GeniHost,
    how: Recognition,
    stop: Arc<AtomicBool>,
    outage: Outage,
    names: Names,
}

impl Follow {
    /// Shows everything once, and then each recorder that differs from what was shown before.
    fn run(&mut self, mut now: Globals, out: &mut dyn Write) -> Result<()> {
        writeln!(out, "{:<23}  {HEADER}", "time")?;
        let mut shown = Globals::new();
        loop {
            let time = local_now();
            for row in changes(&shown, &now, &self.names) {
                writeln!(out, "{time}  {row}")?;
            }
            out.flush()?;
            shown = now;
            match self.next()? {
                Some(next) => now = next,
                None => return Ok(()),
            }
        }
    }

    /// The recorders' data a moment later, or once a failure has passed; `None` at an interrupt.
    fn next(&mut self) -> Result<Option<Globals>> {
        while !self.stop.load(Ordering::Relaxed) {
            thread::sleep(LOOK_EVERY);
            match self.host.recorders(self.how) {
                Ok(found) => {
                    self.outage.end();
                    return Ok(Some(found.recorders.into_iter().collect()));
                }
                Err(error) => self.outage.bear(error.into(), Instant::now())?,
            }
        }
        Ok(None)
    }
}

fn changes(before: &Globals, now: &Globals, names: &Names) -> Vec<String> {
    let mut numbers: Vec<u8> = before.keys().chain(now.keys()).copied().collect();
    numbers.sort_unstable();
    numbers.dedup();
    let changed = numbers.into_iter().filter(|number| before.get(number) != now.get(number));
    changed.map(|number| names.row(number, now.get(&number))).collect()
}

const HEADER: &str = "node  inputs  on";

/// The names of recorders and inputs, by bus address, where the site file has them.
#[derive(Default)]
struct Names(BTreeMap<u8, (String, Points)>);

impl Names {
    fn on_bus(connection: &ConnectionArgs) -> Names {
        let (Some(chosen), Ok(Endpoint::Geni { window, .. })) =
            (&connection.chosen, connection::endpoint(connection))
        else {
            return Names::default();
        };
        let name = |id: RecorderId| {
            let recorder = chosen.site.recorders.get(id.0)?;
            Some((Harmless(&recorder.name).line(), chosen.points_of(id)))
        };
        let recorders = chosen.on_bus(&window).into_iter();
        Names(recorders.filter_map(|(node, id)| Some((node, name(id)?))).collect())
    }

    /// A recorder as a row of the table; without inputs if it has left the bus.
    fn row(&self, node: u8, global: Option<&GlobalData>) -> String {
        let name = self.0.get(&node);
        let before = name.map_or(String::new(), |(name, _)| format!("{name}: "));
        match global {
            None => format!("{node:>4}       -  {before}no longer on the bus"),
            Some(global) => {
                let on = name.map(|(_, points)| points.on(global.state));
                let on = on.unwrap_or_else(|| Points::default().on(global.state));
                format!("{node:>4}  {:>6}  {before}{on}", global.model.inputs())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use ser_proto::{Inputs, Model};

    use super::*;
    use crate::output::testing::points;

    #[test]
    fn only_what_has_changed_is_shown_again() {
        let global = |state| GlobalData { model: Model::Ser160, state: Inputs(state) };
        let before = Globals::from([(5, global(1)), (6, global(0)), (7, global(2))]);
        let now = Globals::from([(5, global(5)), (6, global(0)), (9, global(0))]);
        assert_eq!(
            changes(&before, &now, &Names::default()),
            ["   5      16  1 3", "   7       -  no longer on the bus", "   9      16  none"]
        );
        assert_eq!(changes(&now, &now, &Names::default()), Vec::<String>::new());
    }

    #[test]
    fn recorders_and_inputs_of_the_site_have_their_names() {
        let names = Names(BTreeMap::from([(5, ("U1-SER1".to_owned(), points()))]));
        let global = GlobalData { model: Model::Ser160, state: Inputs(0b1100) };
        assert_eq!(
            [names.row(5, Some(&global)), names.row(6, Some(&global)), names.row(5, None)],
            [
                "   5      16  U1-SER1: 52-1 closed CLOSED, 4",
                "   6      16  3 4",
                "   5       -  U1-SER1: no longer on the bus"
            ]
        );
    }
}
