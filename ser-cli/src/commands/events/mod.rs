//! `events`: the events of an archive.

mod filter;
mod json;

use std::collections::HashSet;
use std::io::{self, BufWriter, Write};

use clap::ValueEnum;
use ser_evidence::incident::{Incident, Which};
use ser_evidence::record::{EntryRecord, Record};
use ser_evidence::site::Site;
use ser_evidence::time::{Moment, Utc};
use ser_evidence::timeline::{EventId, Item, Timeline};
use ser_files::{jsonl, merged};

use self::filter::{Filter, FilterArgs};
use super::report::styles;
use crate::archive::{ArchiveArgs, IncidentName, given_site};
use crate::connection::ConnectionArgs;
use crate::error::{Failure, Result, advise, inform};
use crate::gather::{self, ChoiceArgs, Gathered};
use crate::output::{PROGRAM, Palette};

const EXAMPLES: &str = "\
Examples:
  ser-cli events --archive plant.db                  the newest
  ser-cli events --archive plant.db --since 2026-11-01 --format csv
  ser-cli events --archive plant.db --around 07:45 --group protection
  ser-cli events --archive plant.db --recorder U1-SER1 --limit 20
  ser-cli events --archive plant.db --incident U1-SER1/9f3c/120

The newest event is at the end. What is missing is a row of its own, in every format.
Without a choice of time the newest 100 events are shown (--limit).
Formats: table and csv are those of merge; jsonl has the records of events and losses; json is one \
object, with names and times.";

/// How many events are shown without a choice of time.
const NEWEST: usize = 100;

/// How much of the time before the newest event is looked at first, in microseconds: a day.
const FIRST_US: i64 = 86_400_000_000;

/// How many times further back is looked next.
const FURTHER: i64 = 8;

/// No archive reaches back so far: a thousand years.
const LONGEST_US: i64 = 1000 * 366 * FIRST_US;

/// List the events of an archive.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    #[command(flatten)]
    archive: ArchiveArgs,

    #[command(flatten)]
    choice: ChoiceArgs,

    /// The incident of this name; ser-cli incident list shows the names.
    #[arg(
        long,
        value_name = "NAME",
        conflicts_with_all = ["last", "around", "since", "until"]
    )]
    incident: Option<IncidentName>,

    #[command(flatten)]
    filter: FilterArgs,

    /// At most so many events: the newest.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    limit: Option<u32>,

    /// The format of the list.
    #[arg(long, value_enum, default_value_t)]
    format: Format,

    /// End with exit code 3 if events are known to be missing in the list.
    #[arg(long)]
    fail_on_loss: bool,
}

/// The format of a list of events.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Format {
    /// For people.
    #[default]
    Table,
    /// A row per change, with the recorder, the time in UTC and names.
    Csv,
    /// One JSON object per event or loss, as in other files of ours.
    Jsonl,
    /// One JSON object with all of them, with names.
    Json,
}

pub(crate) fn run(args: &Args, connection: &ConnectionArgs) -> Result<()> {
    let place = args.archive.place()?;
    let site = given_site(connection)?;
    let limit = args.limit.and_then(|limit| usize::try_from(limit).ok());
    let named = match &args.incident {
        Some(name) => Some(time_of(args, name, site.as_ref())?),
        None => None,
    };
    let wanted = |site: &Site| -> Result<Option<Which>> {
        Ok(match named {
            Some(at) => Some(Which::Around(at, at)),
            None => args.choice.which(site)?,
        })
    };
    let chosen = |site: &Site| Ok(wanted(site)?.or(Some(Which::Last)));
    let gathered = gather::archived(place, site.clone(), &chosen)?;
    if let Some(which) = wanted(&gathered.site)? {
        return write(args, connection, &gathered, which, limit);
    }
    let limit = limit.unwrap_or(NEWEST);
    let Some(newest) = began(&gathered) else { return nothing() };
    let mut back_us = FIRST_US;
    loop {
        let which = Which::Between(Some(newest.after(-back_us)), None);
        let gathered = gather::archived(place, site.clone(), &|_| Ok(Some(which)))?;
        let timeline = Timeline::new(&gathered.site, &gathered.history);
        let filter = Filter::new(&args.filter, connection, &timeline)?;
        if back_us > LONGEST_US || items(&timeline, which, &filter).1 >= limit {
            drop(timeline);
            return write(args, connection, &gathered, which, Some(limit));
        }
        back_us = back_us.saturating_mul(FURTHER);
    }
}

fn began(gathered: &Gathered) -> Option<Moment<Utc>> {
    let timeline = Timeline::new(&gathered.site, &gathered.history);
    gather::began(&timeline, Which::Last)
}

/// When the incident of this name was.
fn time_of(args: &Args, name: &IncidentName, site: Option<&Site>) -> Result<Moment<Utc>> {
    let mut archive = args.archive.read()?;
    let entry = name.entry(&mut archive)?;
    let nameless = gather::nameless_site();
    gather::time_of(args.archive.place()?, site.unwrap_or(&nameless), &entry)
}

fn nothing() -> Result<()> {
    inform("the archive has no event with a time");
    Ok(())
}

/// What is wanted of a timeline, in its order, and how many events that are.
fn items(timeline: &Timeline<'_>, which: Which, filter: &Filter) -> (Vec<Item>, usize) {
    let Some(incident) = Incident::pick(timeline, which) else { return (Vec::new(), 0) };
    let events: HashSet<EventId> = incident.events.iter().copied().collect();
    let is_wanted = |item: &Item| match *item {
        Item::Entry(event) | Item::ClockSet(event) => {
            events.contains(&event) && filter.wants_event(timeline, event)
        }
        Item::Gap(event, index) => {
            incident.gaps.contains(&(event, index)) && filter.wants_recorder(event.recorder)
        }
    };
    let items: Vec<Item> = timeline.items().filter(is_wanted).collect();
    let count = items.iter().filter(|item| matches!(item, Item::Entry(_))).count();
    (items, count)
}

/// The last of them, with so many events.
fn newest(items: &[Item], limit: usize) -> &[Item] {
    let mut events = items.iter().enumerate().rev();
    let first = events.by_ref().filter(|(_, item)| matches!(item, Item::Entry(_))).nth(limit);
    first.map_or(items, |(index, _)| items.get(index + 1..).unwrap_or_default())
}

fn write(
    args: &Args,
    connection: &ConnectionArgs,
    gathered: &Gathered,
    which: Which,
    limit: Option<usize>,
) -> Result<()> {
    let timeline = Timeline::new(&gathered.site, &gathered.history);
    let filter = Filter::new(&args.filter, connection, &timeline)?;
    let (all, count) = items(&timeline, which, &filter);
    let shown = limit.map_or(&*all, |limit| newest(&all, limit));
    let mut out = BufWriter::with_capacity(1 << 18, io::stdout().lock());
    let wants = |change| filter.wants(change);
    let chosen = shown.iter().copied();
    match args.format {
        Format::Table => {
            let styles = styles(Palette::of_stdout());
            merged::write_chosen_table(&mut out, &timeline, styles, chosen, &wants)?;
        }
        Format::Csv => merged::write_chosen_csv(&mut out, &timeline, chosen, &wants)?,
        Format::Jsonl => write_jsonl(&mut out, &timeline, shown)?,
        Format::Json => json::write(&mut out, &timeline, shown, &filter)?,
    }
    out.flush()?;
    if let Some(limit) = limit.filter(|limit| *limit < count) {
        // How many there are is not known where only the newest were looked for.
        inform(format_args!("the newest {limit} are shown, and not those before"));
        advise("choose a time with --since and --until, or show more with --limit");
    }
    let is_missing = shown.iter().any(|item| matches!(item, Item::Gap(..)));
    match args.fail_on_loss && is_missing {
        true => Err(Failure::incomplete("the list has gaps")),
        false => Ok(()),
    }
}

fn write_jsonl(out: &mut dyn Write, timeline: &Timeline<'_>, items: &[Item]) -> io::Result<()> {
    let mut lines = jsonl::Writer::new(out);
    lines.file(PROGRAM)?;
    for item in items {
        let (Item::Entry(event) | Item::Gap(event, _) | Item::ClockSet(event)) = *item;
        let (Some(history), Some(life)) = (timeline.recorder(event), timeline.life(event)) else {
            continue;
        };
        let record = match *item {
            Item::Entry(event) => timeline.held(event).map(|held| {
                Record::Entry(EntryRecord {
                    life: life.name(),
                    sequence: (!life.is_by_number).then_some(held.sequence),
                    number: held.number,
                    entry: held.entry,
                    known: held.known,
                })
            }),
            Item::Gap(_, index) => {
                life.gaps.get(index).map(|gap| Record::Gap(gap.record(life.name())))
            }
            Item::ClockSet(_) => None,
        };
        if let Some(record) = record {
            lines.record(&history.recorder.name, &record)?;
        }
    }
    lines.flush()
}
