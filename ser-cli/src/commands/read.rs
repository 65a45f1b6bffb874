//! `read`: events from the recorder's log.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use ser_client::{Cursor, Delivery, LogFollower, RangeReader, RequestError, Unit};
use ser_observer::{LogIdentity, clock_look, nothing_after};
use ser_proto::{Code, Command, MAX_SIZE, Reply};

use crate::connection::{self, ConnectionArgs};
use crate::delivery::Outlet;
use crate::error::{Failure, Result, advise, inform, warn};
use crate::interrupt;
use crate::keeper::{Keeper, StateArgs};
use crate::kept::{KeptRecords, Since};
use crate::log_identity::{self, Met};
use crate::original::Originals;
use crate::output::{Format, Life};
use crate::suppressed::LeftOut;
use crate::values;
use crate::witness::Witness;

const EXAMPLES: &str = "\
Examples:
  ser-cli read                              everything, oldest first
  ser-cli read --format csv > events.csv    for a spreadsheet
  ser-cli read --new --format jsonl >> log  what has not been delivered yet
  ser-cli read --from 2040 --count 9        entries by their numbers
  ser-cli read --log-size 2048              an original recorder
  ser-cli read --site north.toml            with names in place of numbers

Formats:
  table   entry, time, time since previous and first event, changes
  csv     a row per change: entry,time,input,state,sequence,life,note
  jsonl   an object per record; an event (record \"entry\"): entry, time, changed, state (inputs
          on), sequence, life, note; a loss (record \"gap\"): lost, count, after, why, inputs,
          life; and what else is known: when the clock was set from here, what it shows where the
          recorder can be asked, for which time nothing is missing

A sequence number counts the events of a log since it was erased. The life names that log; \
it is 0 where nothing is remembered (without --new). A file that is continued (>>) gets no \
second header.

Losses are reported in the output at their place, in every format, and on standard error: how \
many events were overwritten, that the log began anew, which inputs changed while nothing was \
recorded. The exit code is then 0. With --fail-on-loss it is 3, also for a ring that had wrapped \
before it was first read.

Of a recorder with our firmware, standard error also tells how many changes of an input its chatter \
filter has left out (with --new: since the last time), and JSON lines have it as a record \
\"suppressed\". That is no loss: the recorder was told to leave them out (ser-cli filter).";

/// Read events.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// Everything the recorder has, oldest first. This is the default.
    #[arg(long, conflicts_with_all = ["new", "from", "count"])]
    all: bool,

    /// Events not yet delivered by read --new or watch from this port; remembered from run to run.
    #[arg(long, conflicts_with_all = ["from", "count"])]
    new: bool,

    /// Number of the first entry, as the recorder numbers them: by place in memory, not by age.
    #[arg(long, value_name = "N", requires = "count", value_parser = values::entries())]
    from: Option<u16>,

    /// How many entries; only existing ones are read.
    #[arg(long, value_name = "N", requires = "from", value_parser = values::entries())]
    count: Option<u16>,

    /// The format of the events.
    #[arg(long, value_enum, default_value_t)]
    format: Format,

    /// End with exit code 3 if events are known to be missing in what was delivered.
    #[arg(long)]
    fail_on_loss: bool,

    /// How many entries the recorder's log holds; then the recorder is not asked (original
    /// recorders do not answer).
    #[arg(long, value_name = "N", value_parser = values::entries())]
    log_size: Option<u16>,

    #[command(flatten)]
    state: StateArgs,
}

pub(crate) fn run(args: &Args, connection: &ConnectionArgs) -> Result<()> {
    let mut keeper = match args.new {
        true => Some(Keeper::load(&args.state, connection)?),
        false => None,
    };
    let stop = interrupt::catch()?;
    let mut unit = connection::open(connection)?;
    let originals = Originals::of(&args.state, connection)?;
    let met = match &mut keeper {
        Some(keeper) => log_identity::meet(&mut unit, keeper, &originals)?,
        None => Met::default(),
    };
    let life = keeper.as_ref().map_or(Ok(Life::UNKNOWN), Keeper::life)?;
    let before = keeper.as_ref().map(Keeper::before).unwrap_or_default();
    let recorder = connection::recorder_name(connection)?;
    let mut outlet = Outlet::new(args.format, &recorder, life, before);
    outlet.name_points(connection.points());
    let log_size = args.log_size.or_else(|| connection.known_log_size());
    let check_complete = |outlet: &Outlet| match args.fail_on_loss {
        true => outlet.require_complete(),
        false => Ok(()),
    };
    if let (Some(from), Some(count)) = (args.from, args.count) {
        read_range(&mut unit, &mut outlet, (from, count), log_size, &stop)?;
        return check_complete(&outlet);
    }
    let remembered = keeper.as_ref().and_then(Keeper::size);
    let kept = KeptRecords::of(&args.state, connection)?;
    if outlet.holds_evidence() {
        let since = if args.new { Since::LastReading } else { Since::Ever };
        kept.settings(since).iter().try_for_each(|record| outlet.evidence(record))?;
    }
    let kept = args.new.then_some(kept);
    let place = keeper.as_ref().and_then(Keeper::place);
    let mut witness = Witness::begin(kept, place, Duration::ZERO);
    let size = connection::log_size(&mut unit, log_size, remembered)?;
    let cursor = keeper.as_ref().and_then(Keeper::cursor);
    let follower = match LogFollower::new(cursor, size) {
        follower if met.is_another => follower.of_another_log(),
        follower => follower,
    };
    let result =
        read_by_cursor(&mut unit, &mut outlet, keeper.as_mut(), &mut witness, follower, &stop);
    let result = result.and_then(|(delivered, cursor)| {
        if let Some(keeper) = &mut keeper {
            log_identity::remember(&mut unit, keeper, met.log)?;
        }
        look_at_clock(&mut unit, &mut outlet, &mut witness, &originals, (cursor, met.log))?;
        left_out(args, connection, &mut unit, &mut outlet, &originals)?;
        Ok(delivered)
    });
    // Events that reached standard output are remembered even if the recorder fell silent in
    // between, or after Ctrl-C.
    let saved = keeper.as_mut().map_or(Ok(()), Keeper::save);
    let delivered = outlet.finish().and(result)?;
    saved?;
    witness.keep();
    if delivered == 0 && !outlet.has_gaps() {
        inform(if args.new { "nothing new" } else { "the log is empty" });
    }
    check_complete(&outlet)
}

fn read_by_cursor(
    unit: &mut Unit,
    outlet: &mut Outlet,
    mut keeper: Option<&mut Keeper>,
    witness: &mut Witness,
    mut follower: LogFollower,
    stop: &AtomicBool,
) -> Result<(u32, Option<Cursor>)> {
    let summary = follower.read_new(unit, &mut |step| -> Result<()> {
        let mut remember =
            |life| keeper.as_mut().map_or(Ok(()), |keeper| keeper.name(life, step.size));
        outlet.take(step.deliveries, step.pending, &mut remember)?;
        if let Some(keeper) = &mut keeper {
            keeper.delivered(step.cursor, step.size, outlet.life())?;
        }
        check_interrupt(stop)
    })?;
    let cursor = follower.cursor();
    let looked_at = match cursor.filter(|_| witness.is_wanted(outlet)) {
        Some(cursor) => nothing_after(unit, cursor)?,
        None => None,
    };
    witness.read(outlet, cursor, follower.size(), looked_at.max(follower.complete_at()))?;
    witness.vouch(outlet)?;
    Ok((summary.delivered, cursor))
}

/// Asks what the recorder's clock shows, right after a reading. The reading is whole without it, so
/// no failure is one here.
fn look_at_clock(
    unit: &mut Unit,
    outlet: &mut Outlet,
    witness: &mut Witness,
    originals: &Originals,
    (cursor, log): (Option<Cursor>, Option<LogIdentity>),
) -> Result<()> {
    let Some(cursor) = cursor.filter(|_| witness.is_wanted(outlet)) else { return Ok(()) };
    if !matches!(originals.identity(unit), Ok(Some(_))) {
        return Ok(());
    }
    let Ok(Some(looks)) = clock_look::take(unit) else { return Ok(()) };
    let place = looks.place(outlet.life(), cursor, log.map(|log| log.life));
    match place.and_then(|place| looks.observation(place)) {
        Some(observation) => witness.asked(outlet, observation),
        None => Ok(()),
    }
}

/// Looks how many changes chatter filters have left out. Who says how large the log is has an
/// original recorder, which is not asked.
fn left_out(
    args: &Args,
    connection: &ConnectionArgs,
    unit: &mut Unit,
    outlet: &mut Outlet,
    originals: &Originals,
) -> Result<()> {
    if args.log_size.is_some() || connection.is_original() {
        return Ok(());
    }
    if !matches!(originals.identity(unit), Ok(Some(_))) {
        return Ok(());
    }
    let kept = match args.new {
        true => Some(KeptRecords::of(&args.state, connection)?),
        false => None,
    };
    let look = LeftOut::new(kept, connection.points()).look(unit);
    look.map_or(Ok(()), |look| outlet.evidence(&look))
}

/// Reads entries by number. Needs neither cursor nor size: the recorder answers with the existing
/// entries.
fn read_range(
    unit: &mut Unit,
    outlet: &mut Outlet,
    (from, count): (u16, u16),
    log_size: Option<u16>,
    stop: &AtomicBool,
) -> Result<()> {
    let mut reader = RangeReader::new(from, count, log_size.unwrap_or(MAX_SIZE));
    while let ControlFlow::Continue(deliveries) = next_of_range(unit, &mut reader)? {
        let pending = u32::from(count - reader.delivered());
        let is_seam = |delivery: &Delivery| match *delivery {
            Delivery::Event { entry_number, .. } => reader.is_seam(entry_number),
            Delivery::Lost { .. } => false,
        };
        // By number, the oldest entry comes after the newest.
        let (newest, oldest) =
            deliveries.split_at(deliveries.iter().position(is_seam).unwrap_or(0));
        outlet.take(newest, pending, &mut |_| Ok(()))?;
        if deliveries.first().is_some_and(is_seam) || !newest.is_empty() {
            outlet.begin_anew();
        }
        outlet.take(oldest, pending, &mut |_| Ok(()))?;
        check_interrupt(stop)?;
    }
    outlet.finish()?;
    if reader.is_mixed() {
        outlet.miss();
        warn(
            "events were recorded meanwhile and may have overwritten entries of this range: old \
             and new are mixed",
        );
        advise("repeat the command, or stop recording first (ser-cli stop)");
    }
    match reader.delivered() {
        0 => {
            inform(format_args!("entry {from} does not exist yet"));
            advise("ser-cli status shows how far the log is filled");
        }
        found if found < count => inform(format_args!("{found} of {count} entries exist")),
        _ => {}
    }
    Ok(())
}

/// An unfinished reading is a failure: `read … && erase` must not go on.
fn check_interrupt(stop: &AtomicBool) -> Result<()> {
    match stop.load(Ordering::Relaxed) {
        false => Ok(()),
        true => Err(Failure::new("interrupted before everything was read")
            .hint("repeat the command; read --new continues where it stopped")),
    }
}

fn next_of_range(
    unit: &mut Unit,
    reader: &mut RangeReader,
) -> Result<ControlFlow<(), Vec<Delivery>>> {
    let Some(request) = reader.request() else { return Ok(ControlFlow::Break(())) };
    let Reply::Read(reply) = unit.request(&Command::from(request))? else {
        return Err(RequestError::UnexpectedReply { command: Code::Read }.into());
    };
    let mut deliveries = Vec::new();
    reader.take(&reply, &mut |delivery| deliveries.push(delivery));
    Ok(ControlFlow::Continue(deliveries))
}
