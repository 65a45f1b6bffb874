//! `watch`: events as they happen.

mod site;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use ser_client::{Delivery, LogFollower, LogWatcher, Lost, ReportSwitch, Unit};
use ser_observer::{
    LogIdentity,
    clock_look::{self, NowAndThen},
};
use ser_proto::{AutoReport, Configuration, Configure};

use crate::closed_stdout;
use crate::connection::{self, ConnectionArgs, HEARTBEAT};
use crate::delivery::Outlet;
use crate::error::{Failure, Result, inform};
use crate::interrupt;
use crate::keeper::{Keeper, StateArgs};
use crate::kept::KeptRecords;
use crate::log_identity;
use crate::original::Originals;
use crate::outage::Outage;
use crate::output::Format;
use crate::suppressed::LeftOut;
use crate::values;
use crate::witness::Witness;

const EXAMPLES: &str = "\
Examples:
  ser-cli watch                        until Ctrl-C
  ser-cli watch --format jsonl >> log  run after run, no event twice
  ser-cli watch --poll --interval 5s   leaves the recorder's settings alone
  ser-cli watch --log-size 2048        an original recorder
  ser-cli watch --site north.toml      all recorders of a site, with names

Undelivered events come first (as with read --new), then every event as it happens. The command \
makes the recorder report automatically (auto report on RS-232), and restores the setting at the \
end, also after Ctrl-C or an error. Recorders that report to the Genius bus continue to, and are \
asked every second instead; so are original recorders. The log itself is also checked now and \
then, so that a report lost on the line delays its event and does not lose it.
While events come faster than the line can carry reports and readings together, the recorder is \
told not to report and is read without a pause. Events that are overwritten nevertheless are \
counted in the output, at their place. What chatter filters leave out is told on standard error \
once a minute.
With --site and no port, several recorders are asked every second and shown in one list, in the \
order of what is known of their clocks; their settings are left alone. A ~ is in front of a row \
that is not known to have come after the one before. What is read late may even be earlier for \
sure, and such a row says so. A recorder that does not answer is asked again later, and delays no \
other. If the site has one recorder with a port, it is watched as with --port.
On a Genius bus the command waits for a board or a recorder that fails, for a minute or as long \
as --timeout says.";

/// How often a recorder that does not report automatically is asked.
const POLL_EVERY: Duration = Duration::from_secs(1);

/// How often the log of a recorder that does report is checked.
const CHECK_EVERY: Duration = Duration::from_secs(10);

/// Show events as they happen.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// The format of the events, as for read.
    #[arg(long, value_enum, default_value_t)]
    format: Format,

    /// End with exit code 3 if events are known to be missing in what was delivered.
    #[arg(long)]
    fail_on_loss: bool,

    /// Keep asking the recorder instead of making it report.
    #[arg(long)]
    poll: bool,

    /// How often to ask; if not given, 1s when polling, and 10s in addition to reports.
    #[arg(long, value_name = "TIME", value_parser = values::duration)]
    interval: Option<Duration>,

    /// How many entries the recorder's log holds; needed for original recorders, which do not say.
    #[arg(long, value_name = "N", value_parser = values::entries())]
    log_size: Option<u16>,

    #[command(flatten)]
    state: StateArgs,
}

pub(crate) fn run(args: &Args, connection: &ConnectionArgs) -> Result<()> {
    if let (Some(chosen), true) = (&connection.chosen, connection::ports(connection).is_empty()) {
        return site::run(args, connection, chosen);
    }
    let mut keeper = Keeper::load(&args.state, connection)?;
    let stop = interrupt::catch()?;
    let mut unit = connection::open(connection)?;
    let originals = Originals::of(&args.state, connection)?;
    let met = log_identity::meet(&mut unit, &mut keeper, &originals)?;
    let log_size = args.log_size.or_else(|| connection.known_log_size());
    let plan = plan(args, log_size, &mut unit, keeper.size())?;
    let follower = match LogFollower::new(keeper.cursor(), plan.size) {
        follower if met.is_another => follower.of_another_log(),
        follower => follower,
    };
    let watcher = match plan.reports {
        Some(Reports { switch, found }) => {
            if !switch.is_on {
                inform("the recorder reports automatically until Ctrl-C");
            }
            // Set before the first attempt: the recorder may have carried out a command that it did
            // not answer.
            interrupt::leaves_behind(Some(not_put_back(&found)));
            LogWatcher::reporting(follower, plan.interval, switch)
        }
        None => LogWatcher::polling(follower, plan.interval, args.interval.is_none()),
    };
    let recorder = connection::recorder_name(connection)?;
    let mut outlet = Outlet::endless(args.format, &recorder, keeper.life()?, keeper.before());
    outlet.name_points(connection.points());
    let outage = Outage::new(connection::options(connection).timeout);
    let kept = KeptRecords::of(&args.state, connection)?;
    let witness = Witness::begin(Some(kept), keeper.place(), unit.report_delay());
    // Who says how large the log is has an original recorder, which is not asked.
    let left_out = match log_size {
        Some(_) => None,
        None => {
            let kept = KeptRecords::of(&args.state, connection)?;
            Some(LeftOut::new(Some(kept), connection.points()))
        }
    };
    let clock = met.log.map(|log| NowAndThen::new(log.life));
    let (log, is_named) = (met.log, met.is_another || met.log.is_none());
    let mut watch = Watch {
        unit,
        watcher,
        outlet,
        keeper,
        witness,
        clock,
        log,
        left_out,
        is_named,
        stop,
        outage,
    };
    let result = watch.run();
    if matches!(result, Err(Failure::Interrupted)) {
        log_identity::remember(&mut watch.unit, &mut watch.keeper, watch.log)?;
        watch.look_at_clock()?;
    }
    let looked = watch.look_at_left_out_at_the_end(&result);
    let vouched = looked.and(watch.witness.vouch(&mut watch.outlet));
    let saved = vouched.and(watch.outlet.finish()).and_then(|()| watch.keeper.save());
    watch.witness.keep();
    let found = plan.reports.map(|reports| reports.found).filter(|_| watch.watcher.has_switched());
    let restored = found.map_or(Ok(()), |found| restore(&mut watch.unit, found));
    interrupt::leaves_behind(None);
    match (result, restored) {
        (Err(Failure::Interrupted | Failure::OutputClosed) | Ok(()), restored) => {
            saved.and(restored)?;
            if args.fail_on_loss { watch.outlet.require_complete() } else { Ok(()) }
        }
        // The first failure is reported; usually the second has the same cause.
        (Err(failure), Err(_)) => Err(found.iter().map(not_put_back).fold(failure, Failure::hint)),
        (Err(failure), Ok(())) => Err(failure),
    }
}

/// The text for a setting that was found and could not be put back.
const fn not_put_back(found: &Configuration) -> &'static str {
    match found.auto_report {
        AutoReport::Off => {
            "the recorder may still report automatically; ser-cli config --auto-report off \
             undoes that"
        }
        AutoReport::Rs232 => {
            "the recorder may have stopped reporting; ser-cli config --auto-report rs232 undoes \
             that"
        }
        AutoReport::Genius => {
            "the recorder may have stopped reporting; ser-cli config --auto-report genius undoes \
             that"
        }
    }
}

/// How the recorder is going to be watched.
struct Plan {
    size: u16,
    /// Auto reports, if they come to this computer or may be made to.
    reports: Option<Reports>,
    interval: Duration,
}

/// Auto reports to this computer.
#[derive(Clone, Copy)]
struct Reports {
    switch: ReportSwitch,
    /// The settings to put back.
    found: Configuration,
}

fn plan(
    args: &Args,
    log_size: Option<u16>,
    unit: &mut Unit,
    remembered: Option<u16>,
) -> Result<Plan> {
    let polling =
        |size| Plan { size, reports: None, interval: args.interval.unwrap_or(POLL_EVERY) };
    if let (true, Some(size)) = (args.poll, log_size) {
        return Ok(polling(size));
    }
    let Some(found) = connection::settings(unit)? else {
        let size = log_size.or(remembered).ok_or_else(connection::log_size_unknown)?;
        inform(
            "the recorder does not report its settings (original recorders never do): it is asked \
             for events",
        );
        return Ok(polling(size));
    };
    let size = log_size.unwrap_or(found.size);
    let switch = |is_on| {
        let off = Configure { auto_report: AutoReport::Off, ..keep_size_and_rate(found) };
        ReportSwitch { on: reporting_here(unit, found), off, is_on }
    };
    let reporting = |is_on| Plan {
        size,
        reports: Some(Reports { switch: switch(is_on), found }),
        interval: args.interval.unwrap_or(CHECK_EVERY),
    };
    match found.auto_report {
        _ if args.poll => Ok(polling(size)),
        auto_report if unit.bus_address().is_some() => match auto_report {
            AutoReport::Genius if unit.bus_address() == Some(found.report_address) => {
                Ok(reporting(true))
            }
            AutoReport::Off => Ok(reporting(false)),
            AutoReport::Genius | AutoReport::Rs232 => {
                inform("the recorder reports elsewhere and continues to: it is asked for events");
                Ok(polling(size))
            }
        },
        AutoReport::Rs232 => Ok(reporting(true)),
        AutoReport::Off => Ok(reporting(false)),
        AutoReport::Genius => {
            inform(
                "the recorder reports to the Genius bus and continues to: it is asked for events",
            );
            Ok(polling(size))
        }
    }
}

/// The settings with auto reports to this computer, over the connection in use.
fn reporting_here(unit: &Unit, found: Configuration) -> Configure {
    let keep = keep_size_and_rate(found);
    match unit.bus_address() {
        Some(report_address) => {
            Configure { auto_report: AutoReport::Genius, report_address, ..keep }
        }
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
        .map_err(|error| Failure::from(error).hint(not_put_back(&found)))
}

/// Whether this says that another log has begun.
fn begins_anew(delivery: &Delivery) -> bool {
    matches!(delivery, Delivery::Lost { lost: Lost::LogRestarted, .. })
}

struct Watch {
    unit: Unit,
    watcher: LogWatcher,
    outlet: Outlet,
    keeper: Keeper,
    witness: Witness,
    /// The questions about the clock, if the recorder can be asked.
    clock: Option<NowAndThen>,
    /// What the recorder says of the log.
    log: Option<LogIdentity>,
    /// Whether the next life of the log can be named as it begins.
    is_named: bool,
    /// What is left out of the log, if the recorder may be asked.
    left_out: Option<LeftOut>,
    stop: Arc<AtomicBool>,
    outage: Outage,
}

impl Watch {
    /// Runs until an interrupt, or a failure that does not pass.
    fn run(&mut self) -> Result<()> {
        loop {
            match self.step() {
                Ok(()) => self.outage.end(),
                Err(failure) => {
                    self.outage.bear(failure, Instant::now())?;
                    // If that works, all is well.
                    self.watcher.read_next();
                    thread::sleep(HEARTBEAT);
                }
            }
            self.check_interrupt()?;
            self.keeper.save_if_due()?;
        }
    }

    fn step(&mut self) -> Result<()> {
        let Watch { unit, watcher, outlet, keeper, witness, clock, left_out, stop, .. } = self;
        let is_named = &mut self.is_named;
        let (mut is_idle, mut is_unnamed) = (true, false);
        let result = watcher.step(unit, HEARTBEAT, &mut |step| -> Result<()> {
            is_idle &= step.deliveries.is_empty();
            if step.deliveries.iter().any(begins_anew) {
                is_unnamed = !*is_named;
                if is_unnamed {
                    return Err(Failure::Interrupted);
                }
                *is_named = false;
            }
            outlet.take(step.deliveries, 0, &mut |life| keeper.name(life, step.size))?;
            keeper.delivered(step.cursor, step.size, outlet.life())?;
            if stop.load(Ordering::Relaxed) { Err(Failure::Interrupted) } else { Ok(()) }
        });
        if is_unnamed {
            // Before anything of the new log is passed on, the recorder says which it is. Then it
            // is read again.
            let name =
                if self.log.is_some() { log_identity::begun_anew(unit)? } else { (None, None) };
            (self.log, self.is_named) = (name.0, true);
            outlet.name_next_life(name.1);
            watcher.read_next();
            return Ok(());
        }
        result?;
        witness.read(outlet, watcher.cursor(), watcher.log_size(), watcher.complete_at())?;
        if let (Some(clock), Some(cursor), true) = (clock, watcher.cursor(), is_idle)
            && let Some(observation) = clock.step(unit, (outlet.life(), cursor))?
        {
            witness.asked(outlet, observation)?;
            witness.keep();
        }
        if let Some(look) = left_out.as_mut().and_then(|left_out| left_out.look_if_due(unit)) {
            outlet.evidence(&look)?;
        }
        let has_vouched = witness.vouch_if_due(outlet)?;
        // A file gets its header even when there is nothing to deliver.
        outlet.flush()?;
        if has_vouched {
            witness.keep();
        }
        Ok(())
    }

    /// Asks for the clock once more. What was watched is whole without it, so no failure of the
    /// recorder is one here.
    fn look_at_clock(&mut self) -> Result<()> {
        let Watch { unit, watcher, outlet, witness, clock, log, .. } = self;
        let (Some(_), Some(cursor)) = (clock, watcher.cursor()) else { return Ok(()) };
        let Ok(Some(looks)) = clock_look::take(unit) else { return Ok(()) };
        let place = looks.place(outlet.life(), cursor, log.map(|log| log.life));
        match place.and_then(|place| looks.observation(place)) {
            Some(observation) => witness.asked(outlet, observation),
            None => Ok(()),
        }
    }

    /// Looks once more, unless the recorder has failed or nobody takes what it says.
    fn look_at_left_out_at_the_end(&mut self, result: &Result<()>) -> Result<()> {
        if !matches!(result, Ok(()) | Err(Failure::Interrupted)) {
            return Ok(());
        }
        let look = self.left_out.as_mut().and_then(|left_out| left_out.look(&mut self.unit));
        look.map_or(Ok(()), |look| self.outlet.evidence(&look))
    }

    fn check_interrupt(&self) -> Result<()> {
        match () {
            () if self.stop.load(Ordering::Relaxed) => Err(Failure::Interrupted),
            () if closed_stdout::reader_is_gone() => Err(Failure::OutputClosed),
            () => Ok(()),
        }
    }
}
