//! The timeline as JSON lines: all records of all recorders, the entries in order.

use std::io::{self, Write};

use ser_evidence::history::RecorderHistory;
use ser_evidence::record::{
    ClockObservation, ClockStep, EntryRecord, Gap, LifeRecord, Place, Record,
};
use ser_evidence::timeline::{EventId, Item, Timeline};

use crate::jsonl::Writer;

/// Writes all records: first what is known of lives and clocks, then entries and gaps in the order
/// of the timeline. Read again, they give the same timeline.
///
/// # Errors
/// If `out` does not take it.
pub fn write(out: &mut dyn Write, timeline: &Timeline<'_>, program: &str) -> io::Result<()> {
    write_items(out, timeline, (&|_, _, place| Some(*place), timeline.items()), program)
}

/// As a place in the log of a recorder is written, by its index and that of the observation, if it
/// is of one; `None` to leave out what was there.
type Placed<'p> = &'p dyn Fn(usize, Option<usize>, &Place) -> Option<Place>;

/// As [`write`], with these entries and gaps only, and places so that they are found by them.
pub(crate) fn write_items(
    out: &mut dyn Write,
    timeline: &Timeline<'_>,
    (placed, items): (Placed<'_>, impl Iterator<Item = Item>),
    program: &str,
) -> io::Result<()> {
    let mut lines = Writer::new(out);
    lines.file(program)?;
    for (recorder, history) in timeline.history().recorders.iter().enumerate() {
        write_about(&mut lines, recorder, history, placed)?;
    }
    for item in items {
        match item {
            Item::Entry(event) => write_entry(&mut lines, timeline, event)?,
            Item::Gap(event, index) => {
                let (Some(history), Some(life)) = (timeline.recorder(event), timeline.life(event))
                else {
                    continue;
                };
                let Some(gap) = life.gaps.get(index) else { continue };
                lines.record(&history.recorder.name, &Record::Gap(gap.record(life.name())))?;
            }
            Item::ClockSet(_) => {}
        }
    }
    lines.flush()
}

/// What is known of a recorder, of the lives of its log, and of its clock.
fn write_about<W: Write>(
    lines: &mut Writer<W>,
    recorder: usize,
    history: &RecorderHistory,
    placed: Placed<'_>,
) -> io::Result<()> {
    let stamps = history.stamps.iter().map(|stamps| Record::Recorder(*stamps));
    let points = history.points.iter().map(|point| Record::Point(point.clone()));
    let lives = history.lives.iter().filter(|life| life.name().is_known()).map(|life| {
        Record::Life(LifeRecord {
            life: life.name(),
            is_exact: life.is_exact,
            model: history.recorder.model,
            size: history.recorder.log_size,
            erased: life.erased,
        })
    });
    let observations = history.observations.iter().enumerate().filter_map(|(index, found)| {
        let place = placed(recorder, Some(index), &found.place)?;
        Some(Record::Clock(ClockObservation { place, ..*found }))
    });
    let steps = history.steps.iter().filter_map(|found| {
        let place = placed(recorder, None, &found.place)?;
        Some(Record::Step(ClockStep { place, ..*found }))
    });
    let watched = history.watched.iter().map(|found| Record::Watched(*found));
    let suppressed = history.suppressed.iter().map(|look| Record::Suppressed(look.clone()));
    let missed = history.is_not_reached.then_some(Record::Gap(Gap::NOT_REACHED));
    let of_log = stamps.chain(points).chain(lives);
    of_log
        .chain(observations.chain(steps).chain(watched).chain(suppressed).chain(missed))
        .try_for_each(|record| lines.record(&history.recorder.name, &record))
}

/// An entry, and what contradicts it.
fn write_entry<W: Write>(
    lines: &mut Writer<W>,
    timeline: &Timeline<'_>,
    event: EventId,
) -> io::Result<()> {
    let (Some(history), Some(life)) = (timeline.recorder(event), timeline.life(event)) else {
        return Ok(());
    };
    let Some(held) = timeline.held(event) else { return Ok(()) };
    let name = &history.recorder.name;
    let record = EntryRecord {
        life: life.name(),
        sequence: (!life.is_by_number).then_some(held.sequence),
        number: held.number,
        entry: held.entry,
        known: held.known,
    };
    lines.entry(name, &record, None)?;
    // What contradicts it is evidence, too. Its number in the ring is not kept.
    for conflict in history.conflicts_at(life.name(), held.sequence) {
        let entry = conflict.other;
        let known = EntryRecord::ALL_KNOWN;
        lines.entry(name, &EntryRecord { entry, known, ..record }, None)?;
    }
    Ok(())
}
