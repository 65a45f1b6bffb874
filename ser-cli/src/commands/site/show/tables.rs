//! A site as tables for people.

use std::io::{self, Write};

use ser_console::Harmless;
use ser_evidence::site::{ClockRule, Edge, Point, PointId, Recorder, RecorderId, Role, Site};

use crate::output::{Grid, Palette};
use crate::site_file::{model_name, role_name};

/// Writes all tables that have rows.
pub(super) fn write(out: &mut dyn Write, site: &Site, palette: Palette) -> io::Result<()> {
    let zone = site.time_zone.iana_name().unwrap_or("UTC");
    writeln!(out, "{}, {zone}", harmless(&site.name))?;
    if let Some(us) = site.utc_doubt_us {
        writeln!(out, "this computer is within {} of UTC", milliseconds(us.into()))?;
    }
    let tables = [recorders(site), exactness(site)].into_iter().chain(points(site)).chain([
        expectations(site),
        observations(site),
        shifts(site),
    ]);
    for table in tables.filter(|table| !table.rows.is_empty()) {
        writeln!(out)?;
        table.write(out, palette)?;
    }
    Ok(())
}

fn recorders(site: &Site) -> Grid {
    let row = |recorder: &Recorder| {
        let Recorder { name, port, model, log_size, is_original, clock, .. } = recorder;
        vec![
            harmless(name),
            port.as_deref().map(harmless).unwrap_or_default(),
            model.map_or("", model_name).to_owned(),
            if *is_original { "original".to_owned() } else { String::new() },
            log_size.map(|size| size.to_string()).unwrap_or_default(),
            clock_name(*clock),
        ]
    };
    Grid {
        title: None,
        columns: vec!["recorder", "port", "model", "", "log", "clock"],
        rows: site.recorders.iter().map(row).collect(),
    }
}

/// How exact the recorders are.
fn exactness(site: &Site) -> Grid {
    let row = |recorder: &Recorder| {
        let Recorder { name, drift_ppb, delays, .. } = recorder;
        vec![
            harmless(name),
            format!("{} ppm", thousandths((*drift_ppb).into())),
            delay(delays.closing_us),
            delay(delays.opening_us),
        ]
    };
    Grid {
        title: None,
        columns: vec!["recorder", "drift", "closing is seen after", "opening is seen after"],
        rows: site.recorders.iter().map(row).collect(),
    }
}

/// A table for each recorder that has points.
fn points(site: &Site) -> Vec<Grid> {
    let of = |index: usize, recorder: &Recorder| {
        let here = site.points.iter().filter(|point| point.recorder == RecorderId(index));
        let mut here: Vec<&Point> = here.collect();
        here.sort_by_key(|point| point.input);
        Grid {
            title: Some(format!("points of {}", harmless(&recorder.name))),
            columns: vec![
                "input",
                "name",
                "role",
                "equipment",
                "on",
                "off",
                "normal",
                "group",
                "same as",
            ],
            rows: here.into_iter().map(|point| point_row(site, point)).collect(),
        }
    };
    site.recorders.iter().enumerate().map(|(index, recorder)| of(index, recorder)).collect()
}

fn point_row(site: &Site, point: &Point) -> Vec<String> {
    let group = point.group.and_then(|group| site.groups.get(group.0));
    let group = group.map(|group| match group.first_out {
        true => format!("{}, first-out", harmless(&group.name)),
        false => harmless(&group.name),
    });
    let same_as = point.same_as.map(|other| match point.inverted {
        true => format!("{}, inverted", full_name(site, other)),
        false => full_name(site, other),
    });
    let normal = point.normal.map(|on| if on { &point.on } else { &point.off });
    vec![
        format!("{:>5}", point.input),
        harmless(&point.name),
        point.role.map_or("", |role: Role| role_name(role)).to_owned(),
        point.equipment.as_deref().map(harmless).unwrap_or_default(),
        harmless(&point.on),
        harmless(&point.off),
        normal.map(|text| harmless(text)).unwrap_or_default(),
        group.unwrap_or_default(),
        same_as.unwrap_or_default(),
    ]
}

fn expectations(site: &Site) -> Grid {
    let rows = site.expectations.iter().map(|expect| {
        let (earliest, latest) = expect.within_us;
        vec![
            harmless(&expect.name),
            edge(site, expect.after),
            edge(site, expect.then),
            format!("{} to {} ms", thousandths(earliest), thousandths(latest)),
        ]
    });
    Grid { title: None, columns: vec!["expected", "after", "then", "within"], rows: rows.collect() }
}

fn observations(site: &Site) -> Grid {
    let rows = site.observations.iter().map(|seen| {
        vec![
            recorder_name(site, seen.recorder),
            utc(seen.host_time.us()),
            shown(seen.unit_time.us()),
            milliseconds(seen.doubt_us.into()),
        ]
    });
    let columns = vec!["clock of", "seen at", "showed", "within"];
    Grid { title: None, columns, rows: rows.collect() }
}

fn shifts(site: &Site) -> Grid {
    let rows = site.shifts.iter().map(|shift| {
        vec![
            recorder_name(site, shift.recorder),
            milliseconds(shift.us.into()),
            utc(shift.from.us()),
            utc(shift.to.us()),
            harmless(&shift.why),
        ]
    });
    Grid { title: None, columns: vec!["shifted", "by", "from", "to", "why"], rows: rows.collect() }
}

/// A change as the file has it, with the recorder, and with the text of the state.
fn edge(site: &Site, Edge { point, on }: Edge) -> String {
    let text = site.points.get(point.0).map(|point| if on { &point.on } else { &point.off });
    format!("{} {}", full_name(site, point), text.map(|text| harmless(text)).unwrap_or_default())
}

fn full_name(site: &Site, point: PointId) -> String {
    let Some(point) = site.points.get(point.0) else { return String::new() };
    match site.recorders.len() {
        1 => harmless(&point.name),
        _ => format!("{}/{}", recorder_name(site, point.recorder), harmless(&point.name)),
    }
}

fn recorder_name(site: &Site, recorder: RecorderId) -> String {
    site.recorders.get(recorder.0).map(|recorder| harmless(&recorder.name)).unwrap_or_default()
}

fn clock_name(clock: ClockRule) -> String {
    match clock {
        ClockRule::Utc => "UTC".to_owned(),
        ClockRule::Local => "local".to_owned(),
        ClockRule::Offset(seconds) => {
            let sign = if seconds < 0 { '-' } else { '+' };
            let minutes = seconds.unsigned_abs() / 60;
            format!("{sign}{:02}:{:02}", minutes / 60, minutes % 60)
        }
    }
}

/// From the shortest to the longest.
fn delay((shortest, longest): (u32, u32)) -> String {
    format!("{} to {} ms", thousandths(shortest.into()), thousandths(longest.into()))
}

fn milliseconds(us: i128) -> String {
    match i64::try_from(us) {
        Ok(us) => format!("{} ms", thousandths(us)),
        Err(_) => String::new(),
    }
}

/// A number in thousandths with its decimals, as few as there are.
fn thousandths(number: i64) -> String {
    let sign = if number < 0 { "-" } else { "" };
    let number = number.unsigned_abs();
    let text = format!("{sign}{}.{:03}", number / 1000, number % 1000);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn utc(us: i64) -> String {
    jiff::Timestamp::from_microsecond(us).map(|time| time.to_string()).unwrap_or_default()
}

/// What a clock showed: it has milliseconds and no zone.
fn shown(us: i64) -> String {
    let time = jiff::Timestamp::from_microsecond(us).map(|time| format!("{time:.3}"));
    time.unwrap_or_default().trim_end_matches('Z').to_owned()
}

fn harmless(text: &str) -> String {
    Harmless(text).line()
}

#[cfg(test)]
mod tests {
    use super::*;

    const NORTHFIELD: &str =
        include_str!("../../../../../crates/ser-evidence/tests/northfield.toml");

    #[test]
    fn a_site_is_shown_as_tables() {
        let site = ser_evidence::site::read(NORTHFIELD).unwrap();
        let mut out = Vec::new();
        write(&mut out, &site, Palette::plain()).unwrap();
        assert_eq!(String::from_utf8(out).unwrap(), include_str!("northfield.txt"));
    }

    #[test]
    fn numbers_have_the_decimals_that_they_need() {
        for (number, text) in [(0, "0"), (10, "0.01"), (50_500, "50.5"), (-250_000, "-250")] {
            assert_eq!(thousandths(number), text);
        }
    }
}
