//! `audit`: what was done to recorders from this computer.

use std::collections::BTreeSet;
use std::io::{self, Write};
use std::path::PathBuf;

use clap::ValueEnum;
use jiff::tz::TimeZone;
use ser_client::Endpoint;
use ser_console::Harmless;
use ser_evidence::record::{CommandRecord, Outcome, Record, Told};
use ser_evidence::site::Site;
use ser_evidence::time::{Moment, Utc};
use serde_json::{Value, json};

use crate::audit;
use crate::connection::ConnectionArgs;
use crate::error::{Failure, Result, inform, warn};
use crate::gather::{GivenMoment, here, parse_moment};
use crate::output::{Grid, PROGRAM, Palette, json_to, write_records};
use crate::site_file;
use crate::unit_name::UnitName;

const EXAMPLES: &str = "\
Examples:
  ser-cli audit                               everything, oldest first
  ser-cli audit --since 2026-11-22            from that midnight on
  ser-cli audit --recorder U1 --format jsonl  one recorder, as records
  ser-cli audit --format json                 for programs
  ser-cli audit --archive plant.db            what collectors did as well

Each command that changes a recorder is written down when it is known what came of it: clock set, \
config, filter set and clear, start, stop, erase, the same as broadcasts, and watch, which switches \
auto reports. Times are those of the zone of the site file, without one of this computer.

  done          the recorder has confirmed it
  sent          a broadcast: recorders carry it out and do not answer
  refused       the recorder has answered and did not take it
  not answered  it may have been carried out
  not sent      nothing has left this computer

What a collector does to recorders is in its archive, and so are commands that were sent while \
SER_ARCHIVE named one. The others are in audit.jsonl in the state directory, which only its user \
can read, and stay there: \
a file that has grown long is put aside as audit-1.jsonl and so on, and none is ever removed. Nobody \
signs them, so whoever may write there may change them.";

/// List what was done to recorders from this computer: who did what when, and what came of it.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// Only what was done from this time on.
    #[arg(long, value_name = "TIME", value_parser = parse_moment)]
    since: Option<GivenMoment>,

    /// Only what was done until this time.
    #[arg(long, value_name = "TIME", value_parser = parse_moment)]
    until: Option<GivenMoment>,

    /// What is written to standard output.
    #[arg(long, value_enum, default_value_t)]
    format: Format,

    /// Where it is written down; without it, the user's state directory (~/.local/state/ser-cli).
    #[arg(long, env = "SER_STATE_DIR", hide_env_values = true, value_name = "DIR")]
    state_dir: Option<PathBuf>,

    #[cfg(feature = "archive")]
    #[command(flatten)]
    archive: crate::archive::ArchiveArgs,
}

/// How the records are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Format {
    /// For people.
    #[default]
    Table,
    /// One JSON object per record, as they are kept.
    Jsonl,
    /// One JSON object.
    Json,
}

pub(crate) fn run(args: &Args, connection: &ConnectionArgs) -> Result<()> {
    let site = connection.site.as_deref().map(site_file::load).transpose()?;
    let zone = site.as_ref().map_or_else(here, |site| site.time_zone.clone());
    let wanted = Wanted::of(args, connection.recorder.as_deref(), site.as_ref(), &zone)?;
    let directory = args.state_dir.as_deref();
    let audit = audit::since(directory, None)?;
    audit.damaged.iter().for_each(warn);
    #[cfg(feature = "archive")]
    let records = with_archived(audit.records, &args.archive)?;
    #[cfg(not(feature = "archive"))]
    let records = audit.records;
    let told: Vec<(&Told, &CommandRecord)> = records
        .iter()
        .filter_map(|told| match &told.record {
            Record::Command(command) if wanted.takes(told, command) => Some((told, command)),
            _ => None,
        })
        .collect();
    if told.is_empty() {
        let path = audit::path(directory)?;
        inform(format_args!("nothing of that is written down in {}", path.display()));
    }
    let mut out = io::stdout().lock();
    match args.format {
        Format::Table if told.is_empty() => {}
        Format::Table => table(&told, &zone).write(&mut out, Palette::of_stdout())?,
        Format::Jsonl => {
            drop(out);
            return write_records(
                told.iter().map(|(told, _)| (told.recorder.as_str(), &told.record)),
            );
        }
        Format::Json => json_to(&mut out, &object(&told))?,
    }
    Ok(out.flush()?)
}

/// With the commands in an archive, if one is named, all in the order of their times. What a
/// collector has taken over from the state directory is in both, under the name that the site file
/// gives to the recorder.
#[cfg(feature = "archive")]
fn with_archived(
    mut records: Vec<Told>,
    archive: &crate::archive::ArchiveArgs,
) -> Result<Vec<Told>> {
    let Some(place) = archive.named() else { return Ok(records) };
    let mut archived = Vec::new();
    crate::archive::read(place)?.of_kind("command", &mut |recorder, record| {
        archived.push(Told { recorder: recorder.to_owned(), record });
        Ok(())
    })?;
    records.retain(|told| archived.iter().all(|archived| archived.record != told.record));
    records.extend(archived);
    records.sort_by_key(|told| match &told.record {
        Record::Command(command) => command.at.utc.us(),
        _ => 0,
    });
    Ok(records)
}

/// Which records are wanted.
struct Wanted {
    since: Option<Moment<Utc>>,
    until: Option<Moment<Utc>>,
    /// The names that the recorder may have, if one is wanted.
    names: Option<BTreeSet<String>>,
}

impl Wanted {
    fn of(
        args: &Args,
        recorder: Option<&str>,
        site: Option<&Site>,
        zone: &TimeZone,
    ) -> Result<Wanted> {
        let in_zone =
            |given: Option<GivenMoment>| given.map(|given| given.in_zone(zone)).transpose();
        let (since, until) = (in_zone(args.since)?, in_zone(args.until)?);
        if let (Some(since), Some(until)) = (since, until)
            && until < since
        {
            return Err(Failure::usage("--until is before --since")
                .hint("exchange the two, or leave one out: it is then open at that end"));
        }
        let names = recorder.map(|recorder| names(recorder, site));
        Ok(Wanted { since, until, names })
    }

    fn takes(&self, told: &Told, command: &CommandRecord) -> bool {
        let at = command.at.utc;
        self.since.is_none_or(|since| at >= since)
            && self.until.is_none_or(|until| at <= until)
            && self
                .names
                .as_ref()
                .is_none_or(|names| names.contains(&told.recorder) || names.contains(&command.peer))
    }
}

/// What a recorder may be called in the records: its name, its port where no site file was at hand,
/// and the bus that it is on, because a broadcast is for it as well.
fn names(recorder: &str, site: Option<&Site>) -> BTreeSet<String> {
    let mut names = BTreeSet::from([recorder.to_owned()]);
    let id = site.and_then(|site| site.recorder(recorder));
    let described = id.and_then(|id| site?.recorders.get(id.0));
    let port = described.and_then(|described| described.port.as_deref());
    let Some(port) = port.or_else(|| site.is_none().then_some(recorder)) else { return names };
    names.insert(port.to_owned());
    if let Ok(endpoint) = port.parse::<Endpoint>() {
        names.insert(UnitName::of(port, &endpoint).name);
        if let Endpoint::Geni { window, .. } = endpoint {
            names.insert(Endpoint::Geni { window, node: None }.to_string());
        }
    }
    names
}

fn table(told: &[(&Told, &CommandRecord)], zone: &TimeZone) -> Grid {
    let row = |(told, command): &(&Told, &CommandRecord)| {
        vec![
            time(command, zone),
            format!("{}@{}", Harmless(&command.user).line(), Harmless(&command.host).line()),
            Harmless(&told.recorder).line(),
            Harmless(&command.command).line(),
            outcome(command),
        ]
    };
    Grid {
        title: None,
        columns: vec!["time", "who", "recorder", "command", "outcome"],
        rows: told.iter().map(row).collect(),
    }
}

/// As `2026-11-22 10:00:00.250+01:00`.
fn time(command: &CommandRecord, zone: &TimeZone) -> String {
    match jiff::Timestamp::from_microsecond(command.at.utc.us()) {
        Ok(time) => {
            time.to_zoned_datetime(zone.clone()).strftime("%Y-%m-%d %H:%M:%S%.3f%:z").to_string()
        }
        // Beyond the years that there are.
        Err(_) => "?".to_owned(),
    }
}

fn outcome(command: &CommandRecord) -> String {
    let name = outcome_name(&command.outcome);
    match &command.outcome {
        Outcome::Done | Outcome::Sent => name.to_owned(),
        Outcome::Refused(why) | Outcome::NotSent(why) => {
            format!("{name}: {}", Harmless(why).line())
        }
        Outcome::NotAnswered(why) => {
            format!("{name}, may have been carried out: {}", Harmless(why).line())
        }
    }
}

const fn outcome_name(outcome: &Outcome) -> &'static str {
    match outcome {
        Outcome::Done => "done",
        Outcome::Sent => "sent",
        Outcome::Refused(_) => "refused",
        Outcome::NotAnswered(_) => "not answered",
        Outcome::NotSent(_) => "not sent",
    }
}

fn object(told: &[(&Told, &CommandRecord)]) -> Value {
    let command = |(told, command): &(&Told, &CommandRecord)| {
        let time = jiff::Timestamp::from_microsecond(command.at.utc.us()).ok();
        json!({
            "time": time.map(|time| format!("{time:.3}")),
            "utc_us": command.at.utc.us(),
            "utc_doubt_us": command.at.utc_doubt_us,
            "user": command.user,
            "host": command.host,
            "program": command.program,
            "recorder": told.recorder,
            "peer": command.peer,
            "command": command.command,
            "outcome": outcome_name(&command.outcome),
            "why": command.outcome.why(),
        })
    };
    json!({
        "schema": 1,
        "program": PROGRAM,
        "commands": told.iter().map(command).collect::<Vec<_>>(),
    })
}
