//! `watch`: events as they happen.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use ser_client::{LogFollower, Unit, Unsolicited};
use ser_proto::{AutoReport, Configuration, Configure};

use crate::cli::ConnectionArgs;
use crate::connection::{self, HEARTBEAT};
use crate::delivery::Outlet;
use crate::error::{Failure, Result, inform};
use crate::interrupt;
use crate::keeper::{Keeper, StateArgs};
use crate::outage::Outage;
use crate::output::Format;
use crate::values;

const EXAMPLES: &str = "\
Examples:
  ser-cli watch                        until Ctrl-C
  ser-cli watch --format jsonl >> log  run after run, no event twice
  ser-cli watch --poll --interval 5s   leaves the unit's settings alone
  ser-cli watch --log-size 2048        an original unit

First comes what has not been delivered yet (as read --new), then every event as it happens. The unit is told to \
report by itself (auto report on RS-232); on the way out, also after Ctrl-C or an error, it gets back the setting \
it had. Units that report to the Genius bus keep doing so and are asked every second instead, and so are original \
units. Every now and then the log itself is looked at, so that a report lost on the line is an event late, not lost.
On a Genius bus a board or a unit that fails is waited for, a minute or as long as --timeout says.";

/// How often the unit is asked when it does not report by itself.
const POLL_EVERY: Duration = Duration::from_secs(1);

/// How often the log is looked at when the unit does report.
const CHECK_EVERY: Duration = Duration::from_secs(10);

/// Show events as they happen.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// How the events are written: as by read.
    #[arg(long, value_enum, default_value_t)]
    format: Format,

    /// End with exit code 3 if events are known to be missing in what was delivered.
    #[arg(long)]
    fail_on_loss: bool,

    /// Ask the unit again and again instead of letting it report.
    #[arg(long)]
    poll: bool,

    /// How often to ask; 1s when polling, and 10s in addition to reports, if not given.
    #[arg(long, value_name = "TIME", value_parser = values::duration)]
    interval: Option<Duration>,

    /// How many entries the unit's log holds; needed for original units, which do not tell.
    #[arg(long, value_name = "N", value_parser = values::entries())]
    log_size: Option<u16>,

    #[command(flatten)]
    state: StateArgs,
}

pub(crate) fn run(args: &Args, connection: &ConnectionArgs) -> Result<()> {
    let keeper = Keeper::load(&args.state, connection)?;
    let stop = interrupt::catch()?;
    let mut unit = connection::open(connection)?;
    let plan = plan(args, &mut unit, keeper.size())?;
    // From the first try on: the unit may have carried out what it did not answer.
    let switched = match plan.restore {
        Some(found) => {
            inform("the unit reports by itself until Ctrl-C");
            interrupt::leaves_behind(Some(STILL_REPORTING));
            unit.configure(reporting_here(&unit, found)).map(drop)
        }
        None => Ok(()),
    };
    let follower = LogFollower::new(keeper.cursor(), plan.size);
    let outlet = Outlet::endless(args.format, keeper.life()?);
    let outage = Outage::new(connection::options(connection).timeout);
    let mut watch = Watch { unit, follower, outlet, keeper, stop, interval: plan.interval, outage };
    let result = switched.map_err(Failure::from).and_then(|()| watch.run());
    let saved = watch.keeper.save();
    let restored = plan.restore.map_or(Ok(()), |found| restore(&mut watch.unit, found));
    interrupt::leaves_behind(None);
    match (result, restored) {
        (Err(Failure::Interrupted | Failure::OutputClosed) | Ok(()), restored) => {
            saved.and(restored)?;
            if args.fail_on_loss { watch.outlet.require_complete() } else { Ok(()) }
        }
        // The first failure is the one to tell; most often the second has the same cause.
        (Err(failure), Err(_)) => Err(failure.hint(STILL_REPORTING)),
        (Err(failure), Ok(())) => Err(failure),
    }
}

const STILL_REPORTING: &str =
    "the unit may still report by itself; ser-cli config --auto-report off puts that back";

/// How the unit is going to be watched.
struct Plan {
    size: u16,
    /// The settings to put back, if any are changed.
    restore: Option<Configuration>,
    interval: Duration,
}

fn plan(args: &Args, unit: &mut Unit, remembered: Option<u16>) -> Result<Plan> {
    let polling = |size| Plan { size, restore: None, interval: args.interval.unwrap_or(POLL_EVERY) };
    if let (true, Some(size)) = (args.poll, args.log_size) {
        return Ok(polling(size));
    }
    let Some(found) = connection::settings(unit)? else {
        let size = args.log_size.or(remembered).ok_or_else(connection::log_size_unknown)?;
        inform("the unit does not tell its settings, as original units do not: it is asked for events");
        return Ok(polling(size));
    };
    let size = args.log_size.unwrap_or(found.size);
    let reporting = |restore| Plan { size, restore, interval: args.interval.unwrap_or(CHECK_EVERY) };
    match found.auto_report {
        _ if args.poll => Ok(polling(size)),
        auto_report if unit.bus_address().is_some() => match auto_report {
            AutoReport::Genius if unit.bus_address() == Some(found.report_address) => Ok(reporting(None)),
            AutoReport::Off => Ok(reporting(Some(found))),
            AutoReport::Genius | AutoReport::Rs232 => {
                inform("the unit reports elsewhere and goes on doing so: it is asked for events");
                Ok(polling(size))
            }
        },
        AutoReport::Rs232 => Ok(reporting(None)),
        AutoReport::Off => Ok(reporting(Some(found))),
        AutoReport::Genius => {
            inform("the unit reports to the Genius bus and goes on doing so: it is asked for events");
            Ok(polling(size))
        }
    }
}

/// The settings with auto reports to this computer, by the way by which it is connected.
fn reporting_here(unit: &Unit, found: Configuration) -> Configure {
    let keep = keep_size_and_rate(found);
    match unit.bus_address() {
        Some(report_address) => Configure { auto_report: AutoReport::Genius, report_address, ..keep },
        None => Configure { auto_report: AutoReport::Rs232, ..keep },
    }
}

/// The settings as a command that touches neither the log nor the rate.
fn keep_size_and_rate(settings: Configuration) -> Configure {
    Configure { size: None, baud: None, ..settings.into() }
}

fn restore(unit: &mut Unit, found: Configuration) -> Result<()> {
    unit.configure(keep_size_and_rate(found))
        .map(drop)
        .map_err(|error| Failure::from(error).hint(STILL_REPORTING))
}

struct Watch {
    unit: Unit,
    follower: LogFollower,
    outlet: Outlet,
    keeper: Keeper,
    stop: Arc<AtomicBool>,
    interval: Duration,
    outage: Outage,
}

impl Watch {
    /// Goes on until an interrupt, or a failure that does not pass.
    fn run(&mut self) -> Result<()> {
        self.read_new()?;
        self.outlet.finish()?;
        loop {
            if let Err(failure) = self.look() {
                self.outage.bear(failure, Instant::now())?;
                self.come_back()?;
            }
            self.keeper.save_if_due()?;
        }
    }

    fn look(&mut self) -> Result<()> {
        self.wait()?;
        self.read_new()
    }

    /// Tries until the log can be read again, with all that has happened meanwhile.
    fn come_back(&mut self) -> Result<()> {
        while let Err(failure) = self.read_new() {
            self.outage.bear(failure, Instant::now())?;
            self.check_interrupt()?;
            thread::sleep(HEARTBEAT);
        }
        self.outage.end();
        Ok(())
    }

    /// Waits for a report, or for the time to look at the log. Which it was makes no difference: only a reading shows
    /// whether it is still the same log, and one takes the place of all reports that are waiting.
    fn wait(&mut self) -> Result<()> {
        let until = Instant::now() + self.interval;
        loop {
            self.check_interrupt()?;
            let left = until.saturating_duration_since(Instant::now());
            match self.unit.wait_event(left.min(HEARTBEAT))? {
                Some(Unsolicited::Report(_)) => return Ok(()),
                // What the unit prints says nothing that the log does not.
                Some(Unsolicited::Line(_)) => {}
                None if left.is_zero() => return Ok(()),
                None => self.keeper.save_if_due()?,
            }
        }
    }

    fn read_new(&mut self) -> Result<()> {
        let Watch { unit, follower, outlet, keeper, stop, .. } = self;
        follower.read_new(unit, &mut |step| -> Result<()> {
            outlet.take(step.deliveries, 0)?;
            keeper.delivered(step.cursor, step.size, outlet.life())?;
            if stop.load(Ordering::Relaxed) { Err(Failure::Interrupted) } else { Ok(()) }
        })?;
        Ok(())
    }

    fn check_interrupt(&self) -> Result<()> {
        if self.stop.load(Ordering::Relaxed) { Err(Failure::Interrupted) } else { Ok(()) }
    }
}
