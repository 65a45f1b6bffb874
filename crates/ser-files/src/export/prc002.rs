//! The table of events that NERC PRC-002 asks for: a row per change, in the local time of the site.

use std::io::Write;

use jiff::Timestamp;
use ser_evidence::timeline::{EventId, Item, Timeline};

use super::axis::Axis;
use super::channels::{Channels, recorder_name};
use super::counted::Counted;
use super::local::Offsets;
use super::refused::Refused;
use super::selection::Selection;
use super::survey::Survey;
use crate::digits::push_digits;
use crate::merged::{Dialect, field};
use crate::missing::RECORDS_MISSING;
use crate::missing::missing;
use crate::names;

const HEADER: &str = "Date, Time, Local Time Code, Substation, Device, State\r\n";

const DAY_MS: i64 = 86_400_000;

/// Writes a selection.
///
/// # Errors
/// If nothing has a time, or `out` does not take it.
pub fn write(
    out: &mut dyn Write,
    timeline: &Timeline<'_>,
    selection: &Selection,
    is_spreadsheet_safe: bool,
) -> Result<Counted, Refused> {
    let survey = Survey::of(timeline, selection);
    let span = survey.span.ok_or(Refused::Empty)?;
    let mut rows = Rows::new(timeline, survey.axis, &survey.channels, is_spreadsheet_safe);
    out.write_all(HEADER.as_bytes())?;
    for item in selection.items(timeline) {
        rows.text.clear();
        match item {
            Item::Entry(event) => rows.entry(event),
            Item::Gap(event, index) => rows.gap(event, index),
            Item::ClockSet(_) => {}
        }
        out.write_all(&rows.text)?;
    }
    for (recorder, history) in timeline.history().recorders.iter().enumerate() {
        if history.is_not_reached {
            rows.text.clear();
            rows.push_time(span.last_us);
            let name = recorder_name(timeline, recorder);
            let why = format!("{RECORDS_MISSING}: the recorder could not be reached");
            let fields = rows.fields(&name, &why);
            rows.text.extend_from_slice(&fields);
            out.write_all(&rows.text)?;
        }
    }
    Ok(survey.counted)
}

struct Rows<'t> {
    timeline: &'t Timeline<'t>,
    axis: Axis,
    offsets: Offsets,
    /// The day since 1970 of the row before, and its date.
    day: Option<(i64, Vec<u8>)>,
    /// By recorder and input: the last three fields when it is off, on, and not known.
    changes: Vec<Vec<[Vec<u8>; 3]>>,
    substation: String,
    is_spreadsheet_safe: bool,
    text: Vec<u8>,
}

impl<'t> Rows<'t> {
    fn new(
        timeline: &'t Timeline<'t>,
        axis: Axis,
        channels: &Channels,
        is_spreadsheet_safe: bool,
    ) -> Rows<'t> {
        let site = names::harmless(&timeline.site().name);
        let mut rows = Rows {
            timeline,
            axis,
            offsets: Offsets::of(timeline.site().time_zone.clone()),
            day: None,
            changes: Vec::new(),
            substation: field(&site, Dialect::Rfc4180, is_spreadsheet_safe),
            is_spreadsheet_safe,
            text: Vec::new(),
        };
        let recorders = 0..timeline.history().recorders.len();
        rows.changes = recorders.map(|recorder| rows.changes_of(recorder, channels)).collect();
        rows
    }

    /// By input of a recorder: the last three fields, off, on and not known. Names of points need
    /// that of their recorder where there are several.
    fn changes_of(&self, recorder: usize, channels: &Channels) -> Vec<[Vec<u8>; 3]> {
        let timeline = self.timeline;
        let mut changes = vec![<[Vec<u8>; 3]>::default(); 32];
        for channel in channels.of(recorder) {
            let name = match channels.are_of_several() {
                true => format!("{}/{}", recorder_name(timeline, recorder), channel.name(timeline)),
                false => channel.name(timeline),
            };
            let place = usize::from(channel.input).wrapping_sub(1);
            if let Some(of_input) = changes.get_mut(place) {
                *of_input = [Some(false), Some(true), None]
                    .map(|on| self.fields(&name, &names::state(timeline, channel.point, on)));
            }
        }
        changes
    }

    /// The last three fields of a row.
    fn fields(&self, device: &str, state: &str) -> Vec<u8> {
        let field = |text: &str| field(text, Dialect::Rfc4180, self.is_spreadsheet_safe);
        format!(",{},{},{}\r\n", self.substation, field(device), field(state)).into_bytes()
    }

    fn entry(&mut self, event: EventId) {
        let timeline = self.timeline;
        let (Some(held), Some(at_us)) = (timeline.held(event), self.axis.at(timeline, event))
        else {
            return;
        };
        for input in held.entry.changed.numbers() {
            self.push_time(at_us);
            let of_recorder = self.changes.get(event.recorder as usize);
            let fields = of_recorder.and_then(|inputs| {
                let of_input = inputs.get(usize::from(input).checked_sub(1)?)?;
                of_input.get(held.state_of(input).map_or(2, usize::from))
            });
            self.text.extend_from_slice(fields.map_or(b"\r\n", Vec::as_slice));
        }
    }

    /// What is missing has the time of the entry that follows, or of the one before.
    fn gap(&mut self, event: EventId, index: usize) {
        let timeline = self.timeline;
        let before = event.place.checked_sub(1).map(|place| EventId { place, ..event });
        let at_us = self.axis.at(timeline, event);
        let at_us = at_us.or_else(|| self.axis.at(timeline, before?));
        let gap = timeline.life(event).and_then(|life| life.gaps.get(index));
        let (Some(at_us), Some(gap)) = (at_us, gap) else { return };
        let what = missing(gap.lost, gap.why);
        let name = recorder_name(timeline, event.recorder as usize);
        let fields = self.fields(&name, &format!("{RECORDS_MISSING}: {what}"));
        self.push_time(at_us);
        self.text.extend_from_slice(&fields);
    }

    /// The first three fields of a row.
    fn push_time(&mut self, at_us: i64) {
        // To the nearest millisecond.
        let utc_ms = at_us.saturating_add(500).div_euclid(1000);
        let offset_s = self.offsets.at(utc_ms.saturating_mul(1000));
        let local_ms = utc_ms.saturating_add(i64::from(offset_s) * 1000);
        self.push_date(local_ms.div_euclid(DAY_MS));
        let ms = local_ms.rem_euclid(DAY_MS).unsigned_abs();
        let parts = [(3_600_000, 24, 2, b':'), (60_000, 60, 2, b':'), (1000, 60, 2, b'.')];
        for (unit, count, digits, after) in parts {
            push_digits(&mut self.text, ms / unit % count, digits);
            self.text.push(after);
        }
        push_digits(&mut self.text, ms % 1000, 3);
        self.text.push(b',');
        self.text.extend_from_slice(hours(offset_s).as_bytes());
    }

    /// The date as `11/22/2026`, and a comma.
    fn push_date(&mut self, day: i64) {
        if self.day.as_ref().is_none_or(|(known, _)| *known != day) {
            let at = Timestamp::from_millisecond(day.saturating_mul(DAY_MS)).unwrap_or_default();
            self.day = Some((day, at.strftime("%m/%d/%Y,").to_string().into_bytes()));
        }
        if let Some((_, date)) = &self.day {
            self.text.extend_from_slice(date);
        }
    }
}

/// An offset in hours, as in `-5` and `-3.5`.
fn hours(offset_s: i32) -> String {
    let quarters = (f64::from(offset_s) / 900.0).round() / 4.0;
    format!("{quarters}")
}
