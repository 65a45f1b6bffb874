//! The configuration: what the rows mean.

use std::io::{self, Write};

use ser_evidence::timeline::{Item, Timeline};

use super::options::Data;
use super::quality;
use super::record::Record;
use super::texts::field;
use crate::export::axis::doubt_us;
use crate::export::channels::recorder_name;
use crate::export::local::{offset_code, offset_of};
use crate::names::harmless;

/// Nothing tells whether a leap second is near.
const LEAP_SECOND_UNKNOWN: &str = "3";

pub(super) fn write(out: &mut dyn Write, record: &Record<'_>) -> io::Result<()> {
    let Record { timeline, options, channels, span, .. } = record;
    let count = channels.len();
    let mut text = Vec::new();
    let mut line = |fields: &str| {
        text.extend_from_slice(fields.as_bytes());
        text.extend_from_slice(b"\r\n");
    };
    line(&format!("{},{},2013", station(timeline), device(record)));
    line(&format!("{count},0A,{count}D"));
    for (channel, number) in channels.iter().zip(1_u64..) {
        let normal = u8::from(channel.is_normally_on);
        line(&format!("{number},{},,{},{normal}", channel.name, channel.equipment));
    }
    line(&options.line_hz.to_string());
    if options.has_rate {
        line("1");
        line(&format!("1000,{}", record.rows));
    } else {
        // Without a rate the stamps count; the line with the number of rows is there nevertheless.
        line("0");
        line(&format!("0,{}", record.rows));
    }
    line(&date(span.begins_us()));
    line(&date(span.first_us));
    line(match options.data {
        Data::Ascii => "ASCII",
        Data::Binary => "BINARY",
    });
    line(&record.unit_us.to_string());
    let local = offset_of(&timeline.site().time_zone, span.first_us);
    line(&format!("0,{}", offset_code(local)));
    line(&format!("{},{LEAP_SECOND_UNKNOWN}", quality::code(worst_doubt_us(record))));
    out.write_all(&text)
}

/// The name of the site.
pub(super) fn station(timeline: &Timeline<'_>) -> String {
    let name = field(&harmless(&timeline.site().name));
    if name.is_empty() { "not named".to_owned() } else { name }
}

/// The recorder, or how many there are.
fn device(record: &Record<'_>) -> String {
    let channels = &record.survey.channels;
    match channels.all().first() {
        Some(first) if !channels.are_of_several() => {
            field(&recorder_name(record.timeline, first.recorder))
        }
        _ => {
            let mut recorders: Vec<usize> =
                channels.all().iter().map(|channel| channel.recorder).collect();
            recorders.dedup();
            format!("{} recorders", recorders.len())
        }
    }
}

/// As `22/11/2026,09:00:00.250000`, in UTC.
fn date(utc_us: i64) -> String {
    let at = jiff::Timestamp::from_microsecond(utc_us).unwrap_or_default();
    at.strftime("%d/%m/%Y,%H:%M:%S%.6f").to_string()
}

/// How far the truth may be from where any entry is drawn.
fn worst_doubt_us(record: &Record<'_>) -> Option<u64> {
    let Record { timeline, selection, survey, .. } = record;
    let mut worst = 0;
    for item in selection.items(timeline) {
        let Item::Entry(event) = item else { continue };
        let Some(at_us) = survey.axis.at(timeline, event) else { continue };
        worst = worst.max(doubt_us(timeline, event, at_us)?);
    }
    Some(worst)
}
