//! Names that files bring along, where the site file has none.

use std::collections::BTreeSet;

use crate::record::PointRecord;
use crate::site::{Point, Recorder, RecorderId, Site};

/// The most recorders that a site is made to have: each is looked for by its name. In a file of more,
/// inputs keep their numbers.
const MOST_RECORDERS: usize = 2000;

/// An input that files name differently: they do not belong together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TwoNames {
    /// The recorder.
    pub recorder: String,
    /// The name that is used.
    pub used: PointRecord,
    /// The other one.
    pub other: PointRecord,
}

/// Adds points of a recorder to a site, and the recorder itself, where the site does not have them.
pub(super) fn add_to(
    site: &mut Site,
    recorder: &str,
    told: &BTreeSet<PointRecord>,
) -> Vec<TwoNames> {
    let id = match site.recorder(recorder) {
        Some(id) => id,
        None if site.recorders.len() >= MOST_RECORDERS => return Vec::new(),
        None => {
            site.recorders.push(Recorder::named(recorder));
            RecorderId(site.recorders.len() - 1)
        }
    };
    let named = site.points.iter().filter(|point| point.recorder == id);
    let named = named.fold(0, |named, point| named | bit(point.input));
    let mut two_names = Vec::new();
    let mut used: Option<&PointRecord> = None;
    // By input: what one is called twice stands together.
    for point in told.iter().filter(|point| named & bit(point.input) == 0) {
        match used.filter(|used| used.input == point.input) {
            Some(used) => two_names.push(TwoNames {
                recorder: recorder.to_owned(),
                used: used.clone(),
                other: point.clone(),
            }),
            None => {
                site.points.push(as_point(id, point));
                used = Some(point);
            }
        }
    }
    two_names
}

fn bit(input: u8) -> u32 {
    let place = u32::from(input).checked_sub(1);
    place.and_then(|place| 1_u32.checked_shl(place)).unwrap_or_default()
}

fn as_point(recorder: RecorderId, told: &PointRecord) -> Point {
    let PointRecord { input, name, on, off } = told.clone();
    Point {
        recorder,
        input,
        name,
        role: None,
        equipment: None,
        group: None,
        on,
        off,
        normal: None,
        same_as: None,
        inverted: false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::Collector;
    use crate::record::{Record, RecorderRecord};
    use crate::site::{ClockRule, Delays};

    fn told(input: u8, name: &str) -> PointRecord {
        PointRecord { input, name: name.into(), on: "Asserted".into(), off: "Deasserted".into() }
    }

    #[test]
    fn a_file_names_what_the_site_does_not() {
        let text = "site = \"N\"\ntime_zone = \"Europe/Berlin\"\n[[recorder]]\nname = \"F3\"\n\
                    [[point]]\ninput = 2\nname = \"trip coil\"\n";
        let mut site = crate::site::read(text).unwrap();
        let mut collector = Collector::new();
        for (recorder, point) in
            [("F4", told(1, "50")), ("F3", told(2, "OUT101")), ("F3", told(1, "87T"))]
        {
            collector.add(recorder, &Record::Point(point));
        }
        assert_eq!(collector.name_inputs(&mut site), []);
        let named: Vec<(usize, u8, &str)> = site
            .points
            .iter()
            .map(|point| (point.recorder.0, point.input, point.name.as_str()))
            .collect();
        assert_eq!(named, [(0, 2, "trip coil"), (0, 1, "87T"), (1, 1, "50")]);
        let history = collector.finish(&site);
        assert_eq!(history.recorders[0].points.len(), 2, "what was told is kept as it was told");
        assert_eq!(history.recorders[0].recorder.clock, ClockRule::Local);
    }

    #[test]
    fn two_files_that_disagree_are_told_whatever_their_order() {
        let points = [told(1, "87T"), told(1, "52A"), told(1, "87T")];
        for order in [[0, 1, 2], [1, 0, 2], [2, 1, 0]] {
            let mut collector = Collector::new();
            for place in order {
                collector.add("F3", &Record::Point(points[place].clone()));
            }
            let (used, other) = (points[1].clone(), points[0].clone());
            let expected = [TwoNames { recorder: "F3".to_owned(), used, other }];
            assert_eq!(collector.name_inputs(&mut Site::unknown()), expected);
        }
    }

    #[test]
    fn the_time_of_stamps_is_as_the_file_says_whatever_the_site_says() {
        let mut collector = Collector::new();
        collector.add("F3", &Record::Recorder(RecorderRecord { utc_offset_s: 3600 }));
        let history = collector.finish(&Site::unknown());
        assert_eq!(history.recorders[0].recorder.clock, ClockRule::Offset(3600));
        assert_eq!(history.recorders[0].recorder.delays, Delays::NONE, "not those of our circuits");
    }
}
