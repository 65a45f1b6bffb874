//! What a report says in words and as JSON.

use jiff::Timestamp;
use ser_evidence::history::{Collector, History};
use ser_evidence::incident::{Incident, Report, Which};
use ser_evidence::record::{
    Boot, ClockObservation, EntryRecord, HostReading, How, Life, Place, Record, Reference,
    Suppressed, Watched,
};
use ser_evidence::site::{self, Site};
use ser_evidence::time::{Bound, Moment, shown};
use ser_evidence::timeline::Timeline;
use ser_files::report::{Document, Styles, write_html, write_json, write_text};
use ser_proto::{Entry, Inputs, TimeStamp};
use serde_json::Value;

/// Entries and observations of recorders, as one computer read them that was booted at midnight and
/// whose clock may be a millisecond off.
struct Readings {
    site: Site,
    collector: Collector,
}

impl Readings {
    fn of(site: &str) -> Readings {
        let head = "site = \"Northfield\"\ntime_zone = \"UTC\"\n";
        let site = site::read(&format!("{head}{site}")).expect("a site");
        let mut collector = Collector::new();
        collector.begin_source();
        Readings { site, collector }
    }

    /// Inputs change in the entry with this number.
    fn entry(&mut self, recorder: &str, number: u16, time: &str, (changed, state): (u32, u32)) {
        let time = stamp(time);
        let entry = Entry { changed: Inputs(changed), state: Inputs(state), time };
        let (life, sequence) = (life(recorder), Some(number.into()));
        let known = EntryRecord::ALL_KNOWN;
        let record = EntryRecord { life, sequence, number, entry, known };
        self.collector.add(recorder, &Record::Entry(record));
    }

    /// Inputs change in the entry with this number, and nobody knows to what.
    fn moved(&mut self, recorder: &str, number: u16, time: &str, changed: u32) {
        let time = stamp(time);
        let entry = Entry { changed: Inputs(changed), state: Inputs(0), time };
        let (life, sequence) = (life(recorder), Some(number.into()));
        let record = EntryRecord { life, sequence, number, entry, known: Inputs(0) };
        self.collector.add(recorder, &Record::Entry(record));
    }

    /// The clock was set right after this entry, to within two milliseconds.
    fn set(&mut self, recorder: &str, after: u64, time: &str) {
        self.set_within(recorder, after, time, 2_000);
    }

    /// The clock was set right after this entry, and it is known within so many microseconds.
    fn set_within(&mut self, recorder: &str, after: u64, time: &str, width_us: i64) {
        let reading = reading(time);
        let us = reading.monotonic.us();
        let place = Place {
            life: life(recorder),
            after: Some(after),
            before: Some(after),
            newest: None,
            fellow: None,
        };
        self.collector.add(
            recorder,
            &Record::Clock(ClockObservation {
                how: How::Set { broadcast: None },
                shown: shown(&stamp(time)).expect("a date"),
                at: Reference::Host {
                    bound: Bound::from_us(us + 1_000 - width_us / 2, us + 1_000 + width_us / 2),
                    reading,
                },
                place,
            }),
        );
    }

    /// Nothing was missed until then.
    fn watched(&mut self, recorder: &str, through: u64, until: &str) {
        let (life, to) = (life(recorder), reading(until));
        let from = reading("2026-11-22T00:00:01.000");
        self.collector.add(recorder, &Record::Watched(Watched { life, from, to, through }));
    }

    /// At this time, so many changes of an input had been left out since its power-up at midnight.
    fn left_out(&mut self, recorder: &str, at: &str, counts: &[(u8, u32)]) {
        let to = reading(at);
        let on_for_us = u64::try_from(to.monotonic.us()).expect("after midnight");
        let left_out = counts.iter().copied().collect();
        let look = Suppressed { from: to, to, on_for_us, left_out };
        self.collector.add(recorder, &Record::Suppressed(look));
    }

    fn told(self) -> Told {
        let history = self.collector.finish(&self.site);
        Told { site: self.site, history }
    }
}

/// Asserts that these follow each other in a text.
fn in_order(text: &str, parts: &[&str]) {
    let mut rest = text;
    for part in parts {
        let Some(at) = rest.find(part) else { panic!("{part} in {rest}\n\n{text}") };
        rest = &rest[at + part.len()..];
    }
}

/// What was read, put together.
struct Told {
    site: Site,
    history: History,
}

impl Told {
    /// The report about the last incident.
    fn write(&self, write: impl Fn(&mut Vec<u8>, &Document<'_>)) -> String {
        self.write_of(Which::Last, write)
    }

    /// The report about another one.
    fn write_of(&self, which: Which, write: impl Fn(&mut Vec<u8>, &Document<'_>)) -> String {
        let timeline = Timeline::new(&self.site, &self.history);
        let incident = Incident::pick(&timeline, which).expect("an incident");
        let report = Report::new(&timeline, incident);
        let document = Document {
            timeline: &timeline,
            report: &report,
            program: "ser-files",
            site_digest: None,
            archive_heads: &[],
            not_reached: &[],
            damaged_lines: 0,
            doubtful_hours: 0,
            unfold: false,
        };
        let mut out = Vec::new();
        write(&mut out, &document);
        String::from_utf8(out).expect("text")
    }

    /// Its text in one line, blanks in a row as one.
    fn text(&self) -> String {
        self.text_of(Which::Last)
    }

    fn text_of(&self, which: Which) -> String {
        let text = self.write_of(which, |out, document| {
            write_text(out, document, Styles::default()).expect("it takes it");
        });
        text.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    fn json(&self) -> Value {
        let text = self.write(|out, document| write_json(out, document).expect("it takes it"));
        serde_json::from_str(&text).expect("JSON")
    }
}

fn life(recorder: &str) -> Life {
    Life::from_bits(recorder.bytes().fold(1, |bits, byte| bits * 31 + u64::from(byte)))
}

fn utc_us(text: &str) -> i64 {
    format!("{text}Z").parse::<Timestamp>().expect("a time").as_microsecond()
}

fn reading(text: &str) -> HostReading {
    HostReading {
        boot: Boot(7),
        monotonic: Moment::from_us(utc_us(text) - utc_us("2026-11-22T00:00:00.000")),
        utc: Moment::from_us(utc_us(text)),
        utc_doubt_us: Some(1_000),
    }
}

fn stamp(text: &str) -> TimeStamp {
    ser_evidence::time::stamp(Moment::from_us(utc_us(text))).expect("a stamp")
}

const SHARED: &str = "
[[recorder]]
name = \"U1-SER1\"
clock = \"utc\"
[[recorder]]
name = \"U1-SER2\"
clock = \"utc\"
[[point]]
recorder = \"U1-SER1\"
input = 1
name = \"Trip\"
same_as = \"U1-SER2/Trip\"
[[point]]
recorder = \"U1-SER2\"
input = 1
name = \"Trip\"
";

#[test]
fn one_contact_on_two_recorders_is_named_once_with_both() {
    let mut readings = Readings::of(SHARED);
    for recorder in ["U1-SER1", "U1-SER2"] {
        readings.entry(recorder, 1, "2026-11-22T09:00:00.000", (4, 4));
        readings.set(recorder, 1, "2026-11-22T10:00:00.000");
        readings.entry(recorder, 2, "2026-11-22T10:00:01.000", (1, 5));
        readings.entry(recorder, 3, "2026-11-22T10:00:01.500", (4, 1));
    }
    let told = readings.told();
    let text = told.text();
    assert!(text.contains("first-out Trip ON (U1-SER1 and U1-SER2), 10:00:01"), "{text}");
    assert!(text.contains("U1-SER1 Trip ON 2 first-out"), "{text}");
    assert!(text.contains("U1-SER2 Trip ON 2 first-out; the same contact on both"), "{text}");
    let json = told.json();
    assert_eq!(json["first_out"]["is_known"], true);
    let [candidate] = &json["first_out"]["candidates"].as_array().expect("a list")[..] else {
        panic!("{json:#}")
    };
    assert_eq!(candidate["recorder"], "U1-SER1");
    assert_eq!(candidate["same_movement"]["recorder"], "U1-SER2");
}

#[test]
fn a_contact_that_one_recorder_missed_is_told_with_both_recorders() {
    let mut readings = Readings::of(SHARED);
    for recorder in ["U1-SER1", "U1-SER2"] {
        readings.set(recorder, 0, "2026-11-22T10:00:00.000");
        readings.entry(recorder, 1, "2026-11-22T10:00:01.000", (4, 4));
    }
    readings.entry("U1-SER1", 2, "2026-11-22T10:00:02.000", (1, 5));
    readings.entry("U1-SER2", 2, "2026-11-22T10:00:03.000", (4, 0));
    let text = readings.told().text();
    assert!(text.contains("U1-SER1/Trip moved and U1-SER2/Trip did not"), "{text}");
}

#[test]
fn a_stretch_that_begins_on_another_scale_is_told_by_its_entries() {
    let mut readings = Readings::of(SHARED);
    // The clock was ahead by hours before it was set.
    readings.entry("U1-SER1", 1, "2026-11-22T23:00:00.000", (4, 4));
    readings.set("U1-SER1", 1, "2026-11-22T10:00:00.000");
    readings.entry("U1-SER1", 2, "2026-11-22T10:00:01.000", (1, 5));
    readings.watched("U1-SER1", 2, "2026-11-22T10:30:00.000");
    readings.set("U1-SER2", 0, "2026-11-22T10:00:00.000");
    readings.entry("U1-SER2", 1, "2026-11-22T10:00:01.000", (1, 1));
    readings.watched("U1-SER2", 1, "2026-11-22T10:30:00.000");
    let told = readings.told();
    let text = told.text();
    assert!(text.contains("entries 1 to 2, read until 2026-11-22 10:30:00.000"), "{text}");
    let whole = "2026-11-22 10:00:01.002 ± 3.3 ms to 10:30:00.000";
    assert!(text.contains(whole) && text.contains("± 1.0 ms"), "{text}");
    let recorders = told.json()["recorders"].clone();
    assert_eq!(recorders[0]["unbroken_from"]["sequence"], 1);
    assert_eq!(recorders[0]["unbroken_from"]["clock"]["utc_doubt_us"], Value::Null);
    assert!(recorders[0]["unbroken_to"]["clock"]["utc_doubt_us"].is_u64(), "{recorders:#}");
}

#[test]
fn a_recorder_without_entries_has_no_times_that_could_be_doubtful() {
    let mut readings = Readings::of(SHARED);
    readings.set("U1-SER1", 0, "2026-11-22T10:00:00.000");
    readings.entry("U1-SER1", 1, "2026-11-22T10:00:01.000", (4, 4));
    // Twice, and in a life that nobody knows.
    for time in ["2026-11-22T10:00:00.000", "2026-11-22T10:10:00.000"] {
        readings.set("U1-SER2", 7, time);
    }
    readings.watched("U1-SER2", 0, "2026-11-22T10:30:00.000");
    let told = readings.told();
    let text = told.text();
    assert!(!text.contains("as it showed them"), "{text}");
    assert!(!text.contains("cannot be placed"), "{text}");
    assert!(text.contains("no entries, so no times"), "{text}");
    assert_eq!(told.json()["recorders"][1]["clock"], Value::Null);
}

#[test]
fn the_first_row_is_at_no_distance_from_itself() {
    let mut readings = Readings::of(SHARED);
    readings.entry("U1-SER1", 1, "2026-11-22T10:00:01.000", (6, 6));
    let rows = readings.told().json()["sequence"].clone();
    let zero = serde_json::json!({ "least_us": 0, "most_us": 0 });
    assert_eq!(rows[0]["since_first"], zero);
    assert_eq!(rows[0]["since_previous"], Value::Null);
    // Another input of the same sample moved somewhere in the same millisecond.
    assert!(rows[1]["since_first"]["least_us"].as_i64() < Some(0), "{rows:#}");
    assert_eq!(rows[1]["since_previous"], rows[1]["since_first"]);
}

#[test]
fn a_row_that_is_not_listed_at_what_its_clock_showed_says_what_that_was() {
    let mut readings = Readings::of(SHARED);
    readings.entry("U1-SER1", 1, "2026-11-22T13:45:05.588", (4, 4));
    readings.entry("U1-SER1", 2, "2026-11-22T07:45:18.979", (2, 6));
    readings.entry("U1-SER1", 3, "2026-11-21T07:45:19.051", (4, 2));
    let text = readings.told().text();
    assert!(!text.contains("showed 13:45:05.588"), "that is where it is: {text}");
    assert!(text.contains("its clock showed 07:45:18.979"), "{text}");
    assert!(text.contains("its clock showed 2026-11-21 07:45:19.051"), "{text}");
    assert!(text.contains("never observed, and set: times as it showed them, or"), "{text}");
}

#[test]
fn a_row_at_what_its_clock_showed_says_nothing_of_it() {
    let mut readings = Readings::of(SHARED);
    readings.entry("U1-SER1", 1, "2026-11-22T13:45:05.588", (4, 4));
    readings.entry("U1-SER1", 2, "2026-11-22T13:45:05.979", (2, 6));
    let text = readings.told().text();
    assert!(!text.contains("its clock showed"), "{text}");
    assert!(text.contains("never observed: times as it showed them"), "{text}");
    // Nor if the clock was observed, and is known to be wrong.
    let mut readings = Readings::of(SHARED);
    readings.entry("U1-SER1", 1, "2026-11-22T13:45:05.588", (4, 4));
    readings.set("U1-SER1", 1, "2026-11-22T07:45:06.000");
    readings.entry("U1-SER1", 2, "2026-11-22T07:45:06.979", (2, 6));
    readings.watched("U1-SER1", 2, "2026-11-22T10:30:00.000");
    let text = readings.told().text();
    assert!(!text.contains("its clock showed 07:45"), "{text}");
}

#[test]
fn the_note_of_a_long_bracket_says_which_rows_are_in_doubt() {
    let mut readings = Readings::of(SHARED);
    readings.set("U1-SER1", 0, "2026-11-22T09:59:59.000");
    readings.set("U1-SER2", 0, "2026-11-22T09:59:59.000");
    // Each is in doubt with the next one, and the first is before the last for certain.
    readings.entry("U1-SER1", 1, "2026-11-22T10:00:01.000", (2, 2));
    readings.entry("U1-SER2", 1, "2026-11-22T10:00:01.002", (4, 4));
    readings.entry("U1-SER1", 2, "2026-11-22T10:00:01.004", (4, 6));
    readings.entry("U1-SER2", 2, "2026-11-22T10:00:01.006", (8, 12));
    let text = readings.told().text();
    in_order(&text, &["┌ 10:00:01.001", "│ 10:00:01.003", "│ 10:00:01.005", "└ 10:00:01.007"]);
    in_order(&text, &["└ 10:00:01.007", "order unknown of rows within ", " of each other"]);
}

#[test]
fn a_bracket_passes_over_rows_that_are_in_order_with_their_neighbours() {
    let mut readings = Readings::of(SHARED);
    readings.set_within("U1-SER1", 0, "2026-11-22T09:59:59.000", 400_000);
    readings.set("U1-SER2", 0, "2026-11-22T09:59:59.000");
    readings.entry("U1-SER1", 1, "2026-11-22T10:00:01.000", (2, 2));
    for (number, ms) in [(1, 10), (2, 60), (3, 110)] {
        let change = 1 << (number + 3);
        let time = format!("2026-11-22T10:00:01.{ms:03}");
        readings.entry("U1-SER2", number, &time, (change, change));
    }
    let text = readings.told().text();
    in_order(&text, &["┌ 10:00:01.001", "│ 10:00:01.011", "┆ 10:00:01.061", "└ 10:00:01.111"]);
}

#[test]
fn what_is_ahead_of_a_bracket_was_earlier_than_all_of_it() {
    let mut readings = Readings::of(SHARED);
    readings.set("U1-SER1", 0, "2026-11-22T09:59:59.000");
    readings.set("U1-SER2", 0, "2026-11-22T09:59:59.000");
    // The first two are in order, and the third may be before either.
    readings.entry("U1-SER1", 1, "2026-11-22T10:00:01.000", (2, 2));
    readings.entry("U1-SER1", 2, "2026-11-22T10:00:01.001", (4, 6));
    readings.entry("U1-SER2", 1, "2026-11-22T10:00:01.002", (4, 4));
    let text = readings.told().text();
    in_order(
        &text,
        &["┌ 10:00:01.001", "│ 10:00:01.002", "└ 10:00:01.003", "order unknown within"],
    );
}

#[test]
fn what_a_clock_showed_is_told_once_for_all_rows_in_a_row() {
    let mut readings = Readings::of(SHARED);
    readings.entry("U1-SER1", 1, "2026-11-22T13:45:05.588", (4, 4));
    for (number, state) in [(2, 0), (3, 4), (4, 0), (5, 4)] {
        readings.entry("U1-SER1", number, &format!("2026-11-22T07:45:1{number}.100"), (4, state));
    }
    let text = readings.told().text();
    assert_eq!(text.matches("its clock showed").count(), 1, "{text}");
    assert!(text.contains("its clock showed 07:45:12.100, and 07:45:15.100 at entry 5"), "{text}");
    assert!(text.contains("the clock was set some time between entries 1 and 2"), "{text}");
}

#[test]
fn a_setting_stands_where_it_was_in_time() {
    let mut readings = Readings::of(SHARED);
    readings.set("U1-SER2", 0, "2026-11-22T09:59:59.000");
    readings.set("U1-SER1", 0, "2026-11-22T09:59:59.000");
    readings.entry("U1-SER1", 1, "2026-11-22T10:00:01.000", (2, 2));
    readings.entry("U1-SER2", 1, "2026-11-22T10:00:02.000", (4, 4));
    readings.set("U1-SER1", 1, "2026-11-22T10:00:03.000");
    readings.entry("U1-SER2", 2, "2026-11-22T10:00:04.000", (8, 12));
    readings.entry("U1-SER1", 2, "2026-11-22T10:00:05.000", (4, 6));
    let text = readings.told().text();
    let set = "- - - U1-SER1 the clock was set at 10:00:03.000";
    in_order(&text, &["10:00:02.001", set, "10:00:04.001", "10:00:05.001"]);
}

#[test]
fn what_a_clock_recorded_before_it_was_ever_set_has_a_section_of_its_own() {
    let mut readings = Readings::of(SHARED);
    readings.entry("U1-SER1", 1, "1980-01-01T00:00:07.000", (4, 4));
    readings.set("U1-SER1", 1, "2026-11-22T09:59:59.000");
    readings.entry("U1-SER1", 2, "2026-11-22T10:00:01.000", (2, 6));
    let text = readings.told().text();
    in_order(&text, &["Sequence", "10:00:01.002", "Time not known", "1980-01-01 00:00:07.000"]);
    let sequence = text.split("Time not known").next().unwrap_or_default();
    assert!(!sequence.contains("1980"), "{text}");
    assert!(text.starts_with("Northfield 2026-11-22 10:00:01.002 to 10:00:01.002"), "{text}");
}

#[test]
fn long_lists_are_short_for_people_and_whole_for_programs() {
    let points: String = (0..20)
        .map(|input| {
            let input = input + 1;
            format!(
                "[[point]]\nrecorder = \"U1\"\ninput = {input}\nname = \"Valve {input}\"\n\
                 normal = \"off\"\n"
            )
        })
        .collect();
    let mut readings =
        Readings::of(&format!("[[recorder]]\nname = \"U1\"\nclock = \"utc\"\n{points}"));
    readings.entry("U1", 1, "2026-11-22T10:00:01.000", (0xf_ffff, 0xf_ffff));
    let told = readings.told();
    let (text, json) = (told.text(), told.json());
    assert!(text.contains("Valve 8 ON and 12 more"), "{text}");
    assert!(text.contains("Valve 8 ON (U1) and 12 more"), "{text}");
    let verdict = json["verdict"].to_string();
    assert!(verdict.contains("Valve 19 ON and Valve 20 ON"), "{verdict}");
    assert!(!verdict.contains("more"), "{verdict}");
}

#[test]
fn a_state_that_nobody_knows_is_said_to_be_not_known() {
    let mut readings = Readings::of(
        "[[recorder]]\nname = \"U1\"\n[[point]]\ninput = 2\nname = \"52a\"\nrole = \"52a\"\n\
         equipment = \"52-1\"\non = \"CLOSED\"\noff = \"OPEN\"\nnormal = \"on\"\n",
    );
    readings.set("U1", 0, "2026-11-22T10:00:00.000");
    readings.entry("U1", 1, "2026-11-22T10:00:01.000", (1, 1));
    readings.moved("U1", 2, "2026-11-22T10:00:01.020", 2);
    let told = readings.told();
    let text = told.text();
    assert!(text.contains("U1 52a state not known 2"), "{text}");
    assert!(!text.contains("opened") && !text.contains("OPEN"), "{text}");
    let json = told.json();
    let row = &json["sequence"][1];
    assert_eq!((row["on"].is_null(), row["state"].is_null()), (true, true), "{row:#}");
}

#[test]
fn a_trip_that_failed_is_wrong_and_no_bounce() {
    let mut readings = Readings::of(
        "[[recorder]]\nname = \"U1\"\n[[point]]\ninput = 1\nname = \"Trip\"\nrole = \"trip\"\n\
         equipment = \"52-1\"\n[[point]]\ninput = 2\nname = \"52a\"\nrole = \"52a\"\n\
         equipment = \"52-1\"\nnormal = \"on\"\n",
    );
    readings.set("U1", 0, "2026-11-22T10:00:00.000");
    readings.entry("U1", 1, "2026-11-22T10:00:01.000", (1, 3));
    readings.entry("U1", 2, "2026-11-22T10:00:01.030", (2, 1));
    readings.entry("U1", 3, "2026-11-22T10:00:01.034", (2, 3));
    readings.entry("U1", 4, "2026-11-22T10:00:01.036", (2, 1));
    readings.entry("U1", 5, "2026-11-22T10:00:01.050", (2, 3));
    readings.watched("U1", 5, "2026-11-22T10:01:00.000");
    let told = readings.told();
    let json = told.json();
    let said = "52-1 opened 29.9 ms after its trip (bounced once in 6 ms), and closed again after \
                20.1 ms";
    assert_eq!(json["verdict"]["operated"][0], said);
    assert_eq!(json["verdict"]["wrong"][0], "52-1 opened for 20.1 ms and closed again");
    assert!(json["operations"][0]["returned"].is_object(), "{json:#}");
}

#[test]
fn with_entries_before_the_time_asked_for_no_row_is_said_to_be_first() {
    let mut readings = Readings::of(
        "[[recorder]]\nname = \"U1\"\n[[point]]\ninput = 1\nname = \"Trip\"\nnormal = \"off\"\n",
    );
    readings.set("U1", 0, "2026-11-22T10:00:00.000");
    readings.entry("U1", 1, "2026-11-22T10:00:01.000", (1, 1));
    readings.entry("U1", 2, "2026-11-22T10:00:01.030", (2, 3));
    let since = Some(Moment::from_us(utc_us("2026-11-22T10:00:01.020")));
    let text = readings.told().text_of(Which::Between(since, None));
    let first = "first-out not known: 1 entry of the incident is before the time asked for; first of \
                 what is shown: input 2 ON (U1)";
    assert!(text.contains(first), "{text}");
    assert!(!text.contains("maybe first-out"), "{text}");
    assert!(text.contains("not returned to normal: Trip ON"), "{text}");
    assert!(!text.contains("since before the incident"), "{text}");
}

#[test]
fn a_century_that_begins_anew_is_no_clock_that_was_never_set() {
    let mut readings = Readings::of("[[recorder]]\nname = \"U1\"\nclock = \"utc\"\n");
    readings.entry("U1", 1, "2069-12-31T23:59:59.999", (1, 1));
    readings.entry("U1", 2, "1970-01-01T00:00:00.001", (2, 3));
    let text = readings.told().text();
    assert!(!text.contains("Time not known"), "{text}");
    assert!(text.contains("+2.0 ms"), "{text}");
}

/// A trip on one recorder and a breaker on another, whose clock is known within so many
/// microseconds.
fn stepped(width_us: i64) -> String {
    let mut readings = Readings::of(
        "[[recorder]]\nname = \"U1\"\nclock = \"utc\"\n[[recorder]]\nname = \"U2\"\nclock = \"utc\"\n\
         [[point]]\nrecorder = \"U1\"\ninput = 1\nname = \"trip\"\n\
         [[point]]\nrecorder = \"U2\"\ninput = 1\nname = \"52\"\n\
         [[expect]]\nname = \"52 follows\"\nafter = \"U1/trip on\"\nthen = \"U2/52 on\"\n\
         within_ms = [5, 90]\n",
    );
    readings.entry("U1", 1, "2026-11-22T10:00:00.100", (1, 1));
    readings.set("U1", 0, "2026-11-22T09:59:59.000");
    readings.entry("U2", 1, "2026-11-22T10:00:00.140", (1, 1));
    readings.set_within("U2", 0, "2026-11-22T09:59:59.000", width_us);
    readings.watched("U1", 1, "2026-11-22T10:00:02.000");
    readings.watched("U2", 1, "2026-11-22T10:00:02.000");
    readings.told().write(|out, document| write_html(out, document).expect("it takes it"))
}

#[test]
fn a_step_of_which_nobody_knows_is_not_drawn_as_one_that_failed() {
    let legends = |page: &str| {
        ["took good", "took bad", "took open", "cannot be decided", "was not in time"].map(|mark| {
            page.contains(&format!("class=\"{mark}\"")) || page.contains(&format!("{mark}</span>"))
        })
    };
    assert_eq!(legends(&stepped(2_000)), [true, false, false, false, false]);
    assert_eq!(legends(&stepped(300_000)), [false, false, true, true, false]);
}

#[test]
fn what_a_chatter_filter_left_out_is_told_with_its_input_and_is_no_gap() {
    let site = "[[recorder]]\nname = \"U1\"\nclock = \"utc\"\n[[point]]\nrecorder = \"U1\"\ninput = 3\n\
                name = \"52-1 closed\"\n";
    let mut readings = Readings::of(site);
    readings.set("U1", 0, "2026-11-22T09:00:00.000");
    readings.entry("U1", 1, "2026-11-22T10:00:00.000", (1, 1));
    readings.watched("U1", 1, "2026-11-22T10:05:00.000");
    readings.left_out("U1", "2026-11-22T09:59:00.000", &[(3, 7)]);
    readings.left_out("U1", "2026-11-22T10:05:00.000", &[(3, 1241), (4, 1)]);
    let told = readings.told();
    let text = told.text();
    in_order(
        &text,
        &[
            "left out U1: input 3 (52-1 closed), up to 1234 changes by its chatter filter, between \
             2026-11-22 09:59:00.000 and 2026-11-22 10:05:00.000 ",
            "left out U1: input 4, up to 1 change by",
        ],
    );
    let json = told.json();
    assert_eq!(json["is_incomplete"], false, "the recorder did what it was told");
    let left_out = &json["recorders"][0]["left_out"];
    assert_eq!(left_out["changes"][0], serde_json::json!({ "input": 3, "at_most": 1234 }));
    assert_eq!(
        (&left_out["is_to_end"], &left_out["changes"][1]["input"]),
        (&true.into(), &4.into())
    );
    let page = told.write(|out, document| write_html(out, document).expect("it takes it"));
    assert!(page.contains("Left out: U1: input 3 (52-1 closed), up to 1234 changes"));
}

#[test]
fn a_chatter_is_told_with_what_was_left_out_of_it() {
    let mut readings = Readings::of("[[recorder]]\nname = \"U1\"\nclock = \"utc\"\n");
    readings.set("U1", 0, "2026-11-22T09:00:00.000");
    for (number, state) in [(1, 4), (2, 0), (3, 4), (4, 0)] {
        readings.entry("U1", number, &format!("2026-11-22T10:00:00.00{number}"), (4, state));
    }
    readings.left_out("U1", "2026-11-22T10:05:00.000", &[(3, 996)]);
    let text = readings.told().text();
    in_order(&text, &["input 3 (U1) chattered (4 changes, and up to 996 more left out)"]);
}

#[test]
fn where_nobody_looked_after_an_incident_more_may_have_been_left_out() {
    let mut readings = Readings::of("[[recorder]]\nname = \"U1\"\nclock = \"utc\"\n");
    readings.set("U1", 0, "2026-11-22T09:00:00.000");
    readings.entry("U1", 1, "2026-11-22T10:00:00.000", (1, 1));
    readings.entry("U1", 2, "2026-11-22T10:00:01.000", (1, 0));
    readings.left_out("U1", "2026-11-22T10:00:00.500", &[(3, 7)]);
    let text = readings.told().text();
    in_order(&text, &["between its power-up and 2026-11-22 10:00:00.500; nobody has looked since"]);
}
