//! Lists incidents.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Write};

use ser_console::Harmless;
use ser_evidence::incident::{FirstOut, Incident, Report, Which};
use ser_evidence::record::{Life, NoteRecord};
use ser_evidence::site::Site;
use ser_evidence::time::{Moment, Utc};
use ser_evidence::timeline::{ChangeId, Timeline};
use serde_json::{Value, json};

use super::known::Notes;
use super::{Format, ListArgs};
use crate::archive::{NamedEntry, given_site, utc_text};
use crate::connection::ConnectionArgs;
use crate::error::{Failure, Result, inform};
use crate::gather;
use crate::output::{Grid, PROGRAM, Palette, json_to};

/// How long before the newest event incidents are listed, in microseconds: 30 days.
const DAYS_US: i64 = 30 * 86_400_000_000;

/// The version of the object.
const SCHEMA: u32 = 1;

/// An incident, as it is listed.
struct Listed {
    name: String,
    begins: Option<Moment<Utc>>,
    lasts_us: i64,
    events: usize,
    first_out: Vec<String>,
    is_first_known: bool,
    recorders: BTreeSet<String>,
    is_complete: bool,
    notes: Vec<NoteRecord>,
}

impl Listed {
    fn is_closed(&self) -> bool {
        self.notes.last().is_some_and(|note| note.closes)
    }
}

pub(super) fn run(args: &ListArgs, connection: &ConnectionArgs) -> Result<()> {
    let place = args.archive.place()?;
    let site = given_site(connection)?;
    let gathered = gather::archived(place, site.clone(), &|_| Ok(Some(Which::Last)))?;
    let newest = {
        let timeline = Timeline::new(&gathered.site, &gathered.history);
        gather::began(&timeline, Which::Last)
    };
    let Some(newest) = newest else {
        inform("the archive has no event with a time");
        return write(args, &gathered.site, &[]);
    };
    let span = span(args, &gathered.site, newest)?;
    let which = Which::Between(span.0, span.1);
    let gathered = gather::archived(place, site, &|_| Ok(Some(which)))?;
    let mut archive = args.archive.read()?;
    let notes = Notes::of(&mut archive)?;
    let mut lives = BTreeMap::new();
    for history in &gathered.history.recorders {
        let name = &history.recorder.name;
        lives.insert(name.clone(), archive.lives(name)?);
    }
    let timeline = Timeline::new(&gathered.site, &gathered.history);
    let mut listed = incidents(&timeline, span, &lives, &notes);
    listed.retain(|incident| !(args.open && incident.is_closed()));
    write(args, &gathered.site, &listed)
}

type Span = (Option<Moment<Utc>>, Option<Moment<Utc>>);

/// From when to when incidents are listed.
fn span(args: &ListArgs, site: &Site, newest: Moment<Utc>) -> Result<Span> {
    let since = args.since.map(|since| since.in_zone(&site.time_zone)).transpose()?;
    let until = args.until.map(|until| until.span_in_zone(&site.time_zone)).transpose()?;
    let until = until.map(|(_, last)| last);
    if let (Some(since), Some(until)) = (since, until)
        && until < since
    {
        return Err(Failure::usage("--until is before --since").hint("exchange the two"));
    }
    Ok(match (since, until) {
        (None, None) => (Some(newest.after(-DAYS_US)), None),
        (None, Some(until)) => (Some(until.after(-DAYS_US)), Some(until)),
        (since, until) => (since, until),
    })
}

/// The incidents that began in a time. Of those that began outside of it not all was read.
fn incidents(
    timeline: &Timeline<'_>,
    (since, until): Span,
    lives: &BTreeMap<String, Vec<Life>>,
    notes: &Notes,
) -> Vec<Listed> {
    let mut listed = Vec::new();
    for incident in Incident::all(timeline) {
        let begins = incident.events.first().and_then(|&first| timeline.sort_key(first));
        let Some(begins) = begins.map(Moment::from_us) else { continue };
        let is_in =
            since.is_none_or(|since| since <= begins) && until.is_none_or(|until| begins <= until);
        if is_in {
            listed.extend(list(timeline, incident.completed(timeline), lives, notes));
        }
    }
    listed
}

fn list(
    timeline: &Timeline<'_>,
    incident: Incident,
    lives: &BTreeMap<String, Vec<Life>>,
    notes: &Notes,
) -> Option<Listed> {
    let named = |event| NamedEntry::of(timeline, event);
    let first = named(*incident.events.first()?)?;
    let name = first.name(lives.get(&first.recorder).map_or(&[], Vec::as_slice));
    let times = || incident.events.iter().filter_map(|&event| timeline.time(event));
    let (begins, ends) = (times().min(), times().max());
    let notes = notes.on(incident.events.iter().filter_map(|&event| named(event)));
    let notes = notes.into_iter().cloned().collect();
    let recorders = incident
        .events
        .iter()
        .filter_map(|&event| timeline.recorder(event).map(|history| history.recorder.name.clone()));
    let recorders = recorders.collect();
    let events = incident.events.len();
    let report = Report::new(timeline, incident);
    Some(Listed {
        name,
        begins,
        lasts_us: begins.zip(ends).map_or(0, |(begins, ends)| ends.since(begins)),
        events,
        first_out: first_out(timeline, &report.first_out),
        is_first_known: report.first_out.known().is_some(),
        recorders,
        is_complete: !report.is_incomplete(),
        notes,
    })
}

/// What may have moved first.
fn first_out(timeline: &Timeline<'_>, first: &FirstOut) -> Vec<String> {
    let points = ser_evidence::incident::Points::new(timeline);
    let text = |&change: &ChangeId| {
        let point = points.of(change).and_then(|point| timeline.site().points.get(point.0));
        let on = timeline.held(change.event).and_then(|held| held.state_of(change.input));
        let name = point.map_or_else(
            || format!("input {}", change.input),
            |point| Harmless(&point.name).line(),
        );
        let state = match (point, on) {
            (Some(point), Some(true)) => Harmless(&point.on).line(),
            (Some(point), Some(false)) => Harmless(&point.off).line(),
            (None, Some(true)) => "ON".to_owned(),
            (None, Some(false)) => "OFF".to_owned(),
            (_, None) => "changed".to_owned(),
        };
        format!("{name} {state}")
    };
    first.changes.iter().map(text).collect()
}

fn write(args: &ListArgs, site: &Site, listed: &[Listed]) -> Result<()> {
    let mut out = io::BufWriter::new(io::stdout().lock());
    match args.format {
        Format::Table => write_table(&mut out, site, listed)?,
        Format::Json => json_to(&mut out, &as_json(listed))?,
    }
    out.flush()?;
    Ok(())
}

fn write_table(out: &mut dyn Write, site: &Site, listed: &[Listed]) -> io::Result<()> {
    if listed.is_empty() {
        inform("there is no incident in this time");
        return Ok(());
    }
    let row = |incident: &Listed| {
        let first = match (&incident.first_out[..], incident.is_first_known) {
            ([only], true) => only.clone(),
            ([], _) => "not known".to_owned(),
            ([first], false) => format!("{first}?"),
            ([first, rest @ ..], _) => format!("{first}? (or {} more)", rest.len()),
        };
        vec![
            incident.name.clone(),
            incident.begins.map(|at| utc_text(site, at)).unwrap_or_default(),
            incident.events.to_string(),
            first,
            incident
                .recorders
                .iter()
                .map(|name| Harmless(name).line())
                .collect::<Vec<_>>()
                .join(", "),
            if incident.is_complete { "complete" } else { "incomplete" }.to_owned(),
            if incident.is_closed() { "closed" } else { "open" }.to_owned(),
        ]
    };
    let grid = Grid {
        title: None,
        columns: vec!["incident", "began", "events", "first", "recorders", "data", "state"],
        rows: listed.iter().map(row).collect(),
    };
    grid.write(out, Palette::of_stdout())?;
    for incident in listed.iter().filter(|incident| !incident.notes.is_empty()) {
        writeln!(out, "\n{}", incident.name)?;
        for note in &incident.notes {
            let at = utc_text(site, note.at.utc);
            let who = Harmless(format!("{}@{}", note.user, note.host)).line();
            let what = Harmless(&note.text).line();
            match (note.closes, what.is_empty()) {
                (true, true) => writeln!(out, "  {at} {who}: closed")?,
                (true, false) => writeln!(out, "  {at} {who}: closed: {what}")?,
                (false, _) => writeln!(out, "  {at} {who}: {what}")?,
            }
        }
    }
    Ok(())
}

fn as_json(listed: &[Listed]) -> Value {
    let time = |at: Moment<Utc>| {
        let at = jiff::Timestamp::from_microsecond(at.us()).ok()?;
        Some(at.strftime("%Y-%m-%dT%H:%M:%S.%6fZ").to_string())
    };
    let note = |note: &NoteRecord| {
        json!({
            "at": time(note.at.utc),
            "user": note.user,
            "host_name": note.host,
            "text": note.text,
            "closes": note.closes,
        })
    };
    let incident = |incident: &Listed| {
        json!({
            "incident": incident.name,
            "began": incident.begins.and_then(time),
            "lasted_us": incident.lasts_us,
            "events": incident.events,
            "first_out": incident.first_out,
            "is_first_known": incident.is_first_known,
            "recorders": incident.recorders,
            "is_complete": incident.is_complete,
            "is_closed": incident.is_closed(),
            "notes": incident.notes.iter().map(note).collect::<Vec<_>>(),
        })
    };
    let incidents: Vec<Value> = listed.iter().map(incident).collect();
    json!({ "schema": SCHEMA, "program": PROGRAM, "incidents": incidents })
}
