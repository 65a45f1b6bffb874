//! What an archive has, and what is missing in it.

use std::io::{self, Write};

use ser_archive::{Check, Hole, RecorderCheck};
use ser_console::Harmless;
use ser_evidence::record::{Gap, Lost, Watched, Why};
use ser_files::missing_text;
use serde_json::{Value, json};

use super::{Format, LookArgs, SCHEMA};
use crate::archive::utc_text;
use crate::error::{Failure, Result};
use crate::gather;
use crate::output::{PROGRAM, field, json_to};

/// Gaps of a recorder that are told one by one; of more the newest are.
const TOLD: usize = 20;

pub(super) fn run(look: &LookArgs) -> Result<()> {
    let check = look.archive.read()?.check()?;
    let mut out = io::stdout().lock();
    match look.format {
        Format::Text => write_text(&mut out, &check)?,
        Format::Json => json_to(&mut out, &as_json(&check))?,
    }
    if !check.is_sound() {
        return Err(Failure::incomplete(
            "entries are missing that nobody has told of, or contradict each other",
        ));
    }
    match check.recorders.iter().any(|found| found.told.iter().any(is_loss)) {
        true => Err(Failure::incomplete("entries are missing")),
        false => Ok(()),
    }
}

/// What the archive has let go is no loss: somebody wanted that.
fn is_loss(gap: &Gap) -> bool {
    gap.why != Why::Expired && gap.lost != Lost::Exactly(0)
}

fn write_text(out: &mut dyn Write, check: &Check) -> io::Result<()> {
    if check.recorders.is_empty() {
        return writeln!(out, "nothing was archived yet");
    }
    for (index, found) in check.recorders.iter().enumerate() {
        if index > 0 {
            writeln!(out)?;
        }
        writeln!(out, "{}", Harmless(&found.recorder).line())?;
        write_recorder(out, found)?;
    }
    Ok(())
}

fn write_recorder(out: &mut dyn Write, found: &RecorderCheck) -> io::Result<()> {
    field(out, "entries", found.entries)?;
    field(out, "lives", found.lives)?;
    if let Some((from, to)) = watched(&found.watched) {
        let site = gather::nameless_site();
        let [from, to] = [from, to].map(|at| utc_text(&site, at));
        field(out, "watched", format_args!("{from} to {to}, in {} spans", found.watched.len()))?;
    }
    if found.conflicts + found.expired_conflicts > 0 {
        let gone = found.expired_conflicts;
        field(out, "contradicting", format_args!("{} ({gone} more let go)", found.conflicts))?;
    }
    for Hole { life, after, missing, told } in &found.holes {
        let text = format!("{missing} after {after} of life {life}, of which {told} were told");
        field(out, "hole", text)?;
    }
    let hidden = found.told.len().saturating_sub(TOLD);
    if hidden > 0 {
        field(out, "missing", format_args!("{hidden} earlier gaps (--format json has all)"))?;
    }
    for gap in found.told.iter().skip(hidden) {
        let after = gap.after.map(|after| format!(" after {after} of life {}", gap.life));
        let text = missing_text(gap.lost, gap.why);
        field(out, "missing", format_args!("{text}{}", after.unwrap_or_default()))?;
    }
    if found.holes.is_empty() && !found.told.iter().any(is_loss) {
        field(out, "missing", "nothing")?;
    }
    Ok(())
}

type Utc = ser_evidence::time::Moment<ser_evidence::time::Utc>;

/// From when to when the recorder was watched, with or without breaks.
fn watched(spans: &[Watched]) -> Option<(Utc, Utc)> {
    let from = spans.iter().map(|span| span.from.utc).min()?;
    Some((from, spans.iter().map(|span| span.to.utc).max()?))
}

fn as_json(check: &Check) -> Value {
    let hole = |hole: &Hole| {
        json!({
            "life": hole.life.to_string(),
            "after": hole.after,
            "missing": hole.missing,
            "told": hole.told,
        })
    };
    let gap = |gap: &Gap| {
        json!({
            "life": gap.life.to_string(),
            "after": gap.after,
            "what": missing_text(gap.lost, gap.why),
            "is_loss": is_loss(gap),
        })
    };
    let watched = |span: &Watched| {
        json!({
            "life": span.life.to_string(),
            "from_us": span.from.utc.us(),
            "to_us": span.to.utc.us(),
            "through": span.through,
        })
    };
    let recorder = |found: &RecorderCheck| {
        json!({
            "recorder": found.recorder,
            "lives": found.lives,
            "entries": found.entries,
            "conflicts": found.conflicts,
            "expired_conflicts": found.expired_conflicts,
            "holes": found.holes.iter().map(hole).collect::<Vec<_>>(),
            "told": found.told.iter().map(gap).collect::<Vec<_>>(),
            "watched": found.watched.iter().map(watched).collect::<Vec<_>>(),
        })
    };
    let recorders: Vec<Value> = check.recorders.iter().map(recorder).collect();
    json!({
        "schema": SCHEMA,
        "program": PROGRAM,
        "is_sound": check.is_sound(),
        "recorders": recorders,
    })
}
