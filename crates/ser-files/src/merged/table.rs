//! The timeline as a table for people. Rows are written as they come, so columns have fixed widths.

use std::io::{self, Write};

use ser_evidence::site::PointId;
use ser_evidence::timeline::{ChangeId, EventId, Item, Order, Timeline};
use unicode_width::UnicodeWidthStr;

use crate::missing::missing;
use crate::report::{Clock, Styles};
use crate::{names, span};

/// Writes a row for each change and each gap. Neighbours of different recorders whose order is not
/// known are marked with `~`.
///
/// # Errors
/// If `out` does not take it.
pub fn write(out: &mut dyn Write, timeline: &Timeline<'_>, styles: Styles) -> io::Result<()> {
    write_chosen(out, timeline, styles, timeline.items(), &|_| true)
}

/// As [`write()`], with these entries and gaps only, and of the entries with these changes only.
///
/// # Errors
/// If `out` does not take it.
pub fn write_chosen(
    out: &mut dyn Write,
    timeline: &Timeline<'_>,
    styles: Styles,
    items: impl Iterator<Item = Item>,
    wants: &dyn Fn(ChangeId) -> bool,
) -> io::Result<()> {
    let mut table = Table::new(timeline, styles);
    table.header(out)?;
    for item in items {
        match item {
            Item::Entry(event) => table.entry(out, event, wants)?,
            Item::Gap(event, index) => table.gap(out, event, index)?,
            Item::ClockSet(event) => {
                table.remark(out, &names::recorder(timeline, event), "the clock was set here")?;
            }
        }
    }
    let missed = timeline.history().recorders.iter().filter(|recorder| recorder.is_not_reached);
    for history in missed {
        table.remark(out, &names::harmless(&history.recorder.name), "not reached")?;
    }
    Ok(())
}

struct Table<'t> {
    timeline: &'t Timeline<'t>,
    styles: Styles,
    clock: Clock,
    points: ser_evidence::incident::Points,
    recorder_width: usize,
    previous: Option<EventId>,
    is_timeless: bool,
}

/// As wide as `2026-11-22 11:00:00.250`.
const TIME_WIDTH: usize = 23;

/// As wide as `± 99.9 ms`.
const DOUBT_WIDTH: usize = 10;

impl<'t> Table<'t> {
    fn new(timeline: &'t Timeline<'t>, styles: Styles) -> Table<'t> {
        let names = timeline.history().recorders.iter();
        let widths = names.map(|found| names::harmless(&found.recorder.name).width());
        Table {
            timeline,
            styles,
            clock: Clock::in_zone(timeline.site().time_zone.clone()),
            points: ser_evidence::incident::Points::new(timeline),
            recorder_width: widths.max().unwrap_or(0).max("recorder".len()),
            previous: None,
            is_timeless: false,
        }
    }

    fn header(&self, out: &mut dyn Write) -> io::Result<()> {
        let (style, width) = (self.styles.title, self.recorder_width);
        writeln!(
            out,
            "{style}  {:TIME_WIDTH$} {:>DOUBT_WIDTH$}  {:width$}  {:>8}  point{style:#}",
            "time", "doubt", "recorder", "sequence"
        )
    }

    fn entry(
        &mut self,
        out: &mut dyn Write,
        event: EventId,
        wants: &dyn Fn(ChangeId) -> bool,
    ) -> io::Result<()> {
        let Some(held) = self.timeline.held(event) else { return Ok(()) };
        let key = self.timeline.time(event).map(ser_evidence::time::Moment::us);
        if key.is_none() && !std::mem::replace(&mut self.is_timeless, true) {
            let style = self.styles.alarm;
            writeln!(out, "{style}  time not known: the clock was never set{style:#}")?;
        }
        let unknown = self.previous.is_some_and(|previous| {
            previous.recorder != event.recorder
                && self.timeline.order(previous, event) == Order::Unknown
        });
        let mark = if unknown { "~" } else { " " };
        let time =
            key.map_or_else(|| held.entry.time.to_string(), |at| self.clock.date_and_time(at));
        let doubt = self.doubt(event);
        let recorder = padded(&names::recorder(self.timeline, event), self.recorder_width);
        let (alarm, faint) = (self.styles.alarm, self.styles.faint);
        let head = format!(
            "{alarm}{mark}{alarm:#} {time:TIME_WIDTH$} {faint}{doubt:>DOUBT_WIDTH$}{faint:#}  \
             {recorder}  {:>8}",
            held.sequence
        );
        if held.entry.changed.is_empty() {
            writeln!(out, "{head}  no input changed")?;
        }
        let changes = held.entry.changed.numbers();
        for input in changes.filter(|&input| wants(ChangeId { event, input })) {
            let point: Option<PointId> = self.points.of(ChangeId { event, input });
            let on = held.state_of(input);
            let name = names::point(self.timeline, point, input);
            let state = names::state(self.timeline, point, on);
            let is_abnormal = names::is_abnormal(self.timeline, point, on) == Some(true);
            let style = if is_abnormal { self.styles.abnormal } else { anstyle::Style::new() };
            writeln!(out, "{head}  {name} {style}{state}{style:#}")?;
        }
        self.previous = Some(event);
        Ok(())
    }

    fn doubt(&self, event: EventId) -> String {
        let bounds = self.timeline.moved_on(event, None);
        let width = bounds.values().next().and_then(|&(lo, hi)| Some(hi?.saturating_sub(lo?)));
        width.map_or_else(|| "?".to_owned(), |width| format!("± {}", span::doubt(width / 2)))
    }

    fn gap(&self, out: &mut dyn Write, event: EventId, index: usize) -> io::Result<()> {
        let gap = self.timeline.life(event).and_then(|life| life.gaps.get(index));
        let Some(gap) = gap else { return Ok(()) };
        let recorder = names::recorder(self.timeline, event);
        self.remark(out, &recorder, &missing(gap.lost, gap.why))
    }

    fn remark(&self, out: &mut dyn Write, recorder: &str, text: &str) -> io::Result<()> {
        let recorder = padded(recorder, self.recorder_width);
        let (style, indent) = (self.styles.alarm, 2 + TIME_WIDTH + 1 + DOUBT_WIDTH);
        writeln!(out, "{:indent$}  {style}{recorder}  {:>8}  {text}{style:#}", "", "-")
    }
}

/// As wide as a column on a terminal.
fn padded(text: &str, width: usize) -> String {
    let pad = width.saturating_sub(text.width());
    format!("{text}{:pad$}", "")
}
