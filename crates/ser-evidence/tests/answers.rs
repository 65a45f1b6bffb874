//! What a report says about incidents that people know.

mod common;

use common::{Log, history, monotonic_us, seen, site};
use ser_evidence::clock::Finding;
use ser_evidence::incident::{Doubt, Incident, Report, Verdict, Which};
use ser_evidence::record::{How, Lost, Why};
use ser_evidence::time::Moment;
use ser_evidence::timeline::{ChangeId, ContactTrouble, EventId, Order, Timeline};

const TWO_RECORDERS: &str = "
[[recorder]]
name = \"U1\"
clock = \"utc\"
[[recorder]]
name = \"U2\"
clock = \"utc\"
";

const HOW: How = How::Set { broadcast: None };

/// The changes of a report as `U1/3 on`.
fn rows(timeline: &Timeline<'_>, report: &Report) -> Vec<String> {
    let name = |change: ChangeId| timeline.recorder(change.event).unwrap().recorder.name.clone();
    let on = |on| match on {
        Some(true) => "on",
        Some(false) => "off",
        None => "?",
    };
    let text = |row: &ser_evidence::incident::Row| {
        format!("{}/{} {}", name(row.change), row.change.input, on(row.on))
    };
    report.rows.iter().map(text).collect()
}

fn report(timeline: &Timeline<'_>, which: Which) -> Report {
    Report::new(timeline, Incident::pick(timeline, which).expect("an incident"))
}

#[test]
fn two_recorders_on_one_broadcast_are_ordered_to_two_milliseconds_by_a_host_that_is_wrong() {
    let site = site(TWO_RECORDERS);
    let (mut u1, mut u2) = (Log::of("U1", 1), Log::of("U2", 2));
    // The broadcast took up to 80 ms, and the host says that it may be 50 ms off.
    let at = monotonic_us("2026-11-22T09:59:00.000");
    let bound = (at, at + 80_000);
    let how = How::Set { broadcast: Some(7) };
    u1.observed(how, "2026-11-22T10:00:00.000", bound, Some(50_000));
    u2.observed(how, "2026-11-22T10:00:00.000", bound, Some(50_000));
    u1.changes("2026-11-22T10:00:05.000", &[1]);
    u2.changes("2026-11-22T10:00:05.004", &[1]);
    u2.changes("2026-11-22T10:00:05.010", &[2]);
    u1.changes("2026-11-22T10:00:05.011", &[2]);
    let history = history(&site, &[&u2, &u1]);
    let timeline = Timeline::new(&site, &history);
    let events: Vec<_> = timeline.entries().collect();
    assert_eq!(timeline.order(events[0], events[1]), Order::Before, "4 ms apart");
    assert_eq!(timeline.order(events[2], events[3]), Order::Unknown, "1 ms apart");
    let delta = timeline
        .delta(ChangeId { event: events[0], input: 1 }, ChangeId { event: events[1], input: 1 });
    // A millisecond of phase, one of the samples, and the drift and the delays of both.
    assert!(delta.doubt_us().unwrap() < 2_600, "{delta:?}");
    let utc = timeline.moved_utc(events[0], Some(1)).width_us().unwrap();
    assert!(utc > 180_000, "UTC is as doubtful as the host and the way: {utc}");
}

#[test]
fn the_time_between_two_entries_of_a_clock_that_nobody_knows_is_exact_to_a_millisecond() {
    let site = site(TWO_RECORDERS);
    let mut u1 = Log::of("U1", 1);
    u1.changes("1970-01-01T00:12:05.000", &[1]).changes("1970-01-01T00:12:05.041", &[2]);
    let history = history(&site, &[&u1]);
    let timeline = Timeline::new(&site, &history);
    let events: Vec<_> = timeline.entries().collect();
    let change = |place: usize, input| ChangeId { event: events[place], input };
    let delta = timeline.delta(change(0, 1), change(1, 2));
    assert_eq!(delta.middle_us(), Some(41_000));
    // And the drift and the spread of the delays.
    assert!(delta.doubt_us().unwrap() <= 1_060, "{delta:?}");
    assert_eq!(timeline.sort_key(events[0]), None, "its time is not known, and not 1970");
}

#[test]
fn a_contact_that_chatters_two_hundred_times_is_one_row_and_hides_nothing() {
    let site = site(TWO_RECORDERS);
    let (mut u1, mut u2) = (Log::of("U1", 1), Log::of("U2", 2));
    let at = monotonic_us("2026-11-22T10:00:00.000");
    for log in [&mut u1, &mut u2] {
        log.observed(
            How::Set { broadcast: None },
            "2026-11-22T10:00:00.000",
            (at, at + 2_000),
            Some(1_000),
        );
    }
    u1.changes("2026-11-22T10:00:10.000", &[1]).changes("2026-11-22T10:00:10.020", &[2]);
    for number in 0..200 {
        let ms = 30 + 5 * number;
        let time = format!("2026-11-22T10:00:{:02}.{:03}", 10 + ms / 1000, ms % 1000);
        u1.changes(&time, &[9]);
    }
    u2.changes("2026-11-22T10:00:10.007", &[1]).changes("2026-11-22T10:00:10.500", &[2]);
    u2.changes("2026-11-22T10:00:10.600", &[3]).changes("2026-11-22T10:00:10.700", &[1]);
    let history = history(&site, &[&u1, &u2]);
    let timeline = Timeline::new(&site, &history);
    let report = report(&timeline, Which::LastTrip);
    assert_eq!(report.rows.len(), 206, "nothing is left out");
    let [fold] = &report.chatter[..] else { panic!("{:?}", report.chatter) };
    assert_eq!((fold.first.input, fold.changes.len()), (9, 200));
    let is_shown = |row: &&ser_evidence::incident::Row| {
        !fold.changes.iter().skip(1).any(|folded| *folded == row.change)
    };
    assert_eq!(report.rows.iter().filter(is_shown).count(), 7);
    assert_eq!(report.first_out.known().map(|change| change.input), Some(1));
    assert_eq!(rows(&timeline, &report)[..3], ["U1/1 on", "U2/1 on", "U1/2 on"]);
}

#[test]
fn what_another_source_has_is_not_missing_and_the_rest_keeps_its_reason() {
    let site = site("[[recorder]]\nname = \"U1\"\n");
    let (mut early, mut late) = (Log::of("U1", 7), Log::of("U1", 7));
    early.changes("2026-11-22T10:00:00.100", &[1]).changes("2026-11-22T10:00:00.200", &[1]);
    late.tells_overwritten(0, 3).loses(3).changes("2026-11-22T10:00:00.400", &[2]);
    let history = history(&site, &[&late, &early]);
    let gaps: Vec<_> = history.recorders[0].lives[0].gaps.iter().collect();
    let [gap] = gaps[..] else { panic!("{gaps:?}") };
    assert_eq!((gap.after, gap.lost, gap.why), (2, Lost::Exactly(1), Why::Overwritten));
}

#[test]
fn what_a_list_lost_is_missing_though_it_skips_no_number() {
    let site = site("[[recorder]]\nname = \"U1\"\n");
    let mut list = Log::of("U1", 7);
    list.is_list().tells(0, Lost::AtLeast(1), Why::NotReached);
    list.changes("2026-11-22T10:00:00.100", &[1]).changes("2026-11-22T10:00:00.200", &[1]);
    list.tells(2, Lost::Unknown, Why::NotReached);
    list.changes("2026-11-22T10:00:00.300", &[1]).tells(3, Lost::Unknown, Why::NotReached);
    let history = history(&site, &[&list]);
    let gaps = history.recorders[0].lives[0].gaps.iter();
    let gaps: Vec<_> = gaps.map(|gap| (gap.place, gap.after, gap.lost)).collect();
    let (at_least, unknown) = (Lost::AtLeast(1), Lost::Unknown);
    assert_eq!(gaps, [(0, 0, at_least), (2, 2, unknown), (3, 3, unknown)]);
    let timeline = Timeline::new(&site, &history);
    let report = report(&timeline, Which::Last);
    assert_eq!(report.first_out.known(), None, "it may have been first");
    assert_eq!(report.first_out.gaps.len(), 1);
    assert!(report.is_incomplete());
}

#[test]
fn what_was_not_recorded_after_an_erase_is_missing_before_the_first_entry() {
    let site = site("[[recorder]]\nname = \"U1\"\n");
    let mut u1 = Log::of("U1", 7);
    u1.tells(0, Lost::Unknown, Why::NotRecorded(0b100));
    u1.changes("2026-11-22T10:00:00.100", &[1]).tells(1, Lost::Unknown, Why::NotRecorded(0b100));
    u1.changes("2026-11-22T10:00:00.200", &[1]);
    let history = history(&site, &[&u1]);
    let gaps: Vec<u64> = history.recorders[0].lives[0].gaps.iter().map(|gap| gap.after).collect();
    assert_eq!(gaps, [0], "two entries that show all states show that nothing changed between");
}

#[test]
fn first_out_is_a_set_where_the_clocks_do_not_decide() {
    let site = site(TWO_RECORDERS);
    let (mut u1, mut u2) = (Log::of("U1", 1), Log::of("U2", 2));
    let at = monotonic_us("2026-11-22T10:00:00.000");
    for (log, doubt) in [(&mut u1, 1_000), (&mut u2, 20_000)] {
        let bound = (at - doubt, at + doubt);
        log.observed(How::Set { broadcast: None }, "2026-11-22T10:00:00.000", bound, Some(0));
    }
    u1.changes("2026-11-22T10:00:01.000", &[1, 4]).changes("2026-11-22T10:00:01.050", &[2]);
    u2.changes("2026-11-22T10:00:01.010", &[1]);
    let history = history(&site, &[&u1, &u2]);
    let timeline = Timeline::new(&site, &history);
    let first = report(&timeline, Which::Last).first_out;
    assert_eq!(first.known(), None);
    let inputs: Vec<u8> = first.changes.iter().map(|change| change.input).collect();
    assert_eq!(
        inputs,
        [1, 4, 1],
        "both of the same millisecond, and the one of the other recorder"
    );
}

#[test]
fn what_was_overwritten_may_have_been_first() {
    let site = site(TWO_RECORDERS);
    let mut u1 = Log::of("U1", 1);
    u1.changes("2026-11-22T09:00:00.000", &[5]).loses(1);
    u1.changes("2026-11-22T10:00:01.000", &[1]).changes("2026-11-22T10:00:01.050", &[2]);
    let history = history(&site, &[&u1]);
    let timeline = Timeline::new(&site, &history);
    let report = report(&timeline, Which::Last);
    assert_eq!(report.first_out.known(), None);
    assert_eq!((report.first_out.changes.len(), report.first_out.gaps.len()), (1, 1));
    assert!(report.is_incomplete());
}

const BREAKER: &str = "
[[recorder]]
name = \"U1\"
clock = \"utc\"
[[point]]
input = 5
name = \"Relay trip\"
role = \"trip\"
equipment = \"52-1\"
normal = \"off\"
[[point]]
input = 7
name = \"52-1 closed\"
role = \"52a\"
equipment = \"52-1\"
normal = \"on\"
[[point]]
input = 8
name = \"52-1 open\"
role = \"52b\"
equipment = \"52-1\"
[[expect]]
name = \"opens\"
after = \"Relay trip on\"
then = \"52-1 closed off\"
within_ms = [15, 50]
[[expect]]
name = \"trip resets\"
after = \"Relay trip on\"
then = \"Relay trip off\"
within_ms = [50, 500]
";

/// A trip after which the breaker opens so many milliseconds later, seen on a clock that was set.
fn trip(opens_ms: u32, later: Option<&str>) -> Log {
    let mut u1 = Log::of("U1", 1);
    let at = monotonic_us("2026-11-22T10:00:00.000");
    let how = How::Set { broadcast: None };
    u1.observed(how, "2026-11-22T10:00:00.000", (at, at + 2_000), Some(1_000));
    u1.changes("2026-11-22T10:00:01.000", &[7]).changes("2026-11-22T10:00:10.000", &[5]);
    u1.changes(&format!("2026-11-22T10:00:10.{opens_ms:03}"), &[7]);
    u1.changes(&format!("2026-11-22T10:00:10.{:03}", opens_ms + 3), &[8]);
    if let Some(later) = later {
        u1.changes(later, &[20]);
    }
    u1
}

#[test]
fn a_time_that_cuts_an_incident_leaves_it_open_what_was_first() {
    let site = site(TWO_RECORDERS);
    let (mut u1, mut u2) = (Log::of("U1", 1), Log::of("U2", 2));
    for log in [&mut u1, &mut u2] {
        let at = monotonic_us("2026-11-22T10:00:00.000");
        log.observed(HOW, "2026-11-22T10:00:00.000", (at, at + 1_000), Some(0));
    }
    u1.changes("2026-11-22T10:00:05.000", &[1]).changes("2026-11-22T10:00:05.100", &[2]);
    u2.changes("2026-11-22T10:00:05.200", &[1]).changes("2026-11-22T10:00:30.000", &[2]);
    let history = history(&site, &[&u1, &u2]);
    let timeline = Timeline::new(&site, &history);
    let us = |text| Some(Moment::from_us(seen(text).us()));
    let between = |since, until| report(&timeline, Which::Between(us(since), us(until)));

    let whole = between("2026-11-22T10:00:00.000", "2026-11-22T10:00:20.000");
    assert_eq!(
        (whole.incident.earlier.len(), whole.incident.later),
        (0, 0),
        "25 s are a quiet time"
    );
    assert!(whole.first_out.known().is_some());
    let cut = between("2026-11-22T10:00:05.150", "2026-11-22T10:00:20.000");
    assert_eq!((cut.incident.earlier.len(), cut.incident.later), (2, 0));
    assert_eq!((cut.first_out.changes.len(), cut.first_out.known()), (1, None));
    let cut = between("2026-11-22T10:00:00.000", "2026-11-22T10:00:05.050");
    assert_eq!((cut.incident.earlier.len(), cut.incident.later), (0, 2));
    assert!(cut.first_out.known().is_some());
}

#[test]
fn what_went_wrong_in_the_incident_before_the_time_asked_for_has_not_returned() {
    let site = site(BREAKER);
    let u1 = trip(40, Some("2026-11-22T10:00:10.600"));
    let history = history(&site, &[&u1]);
    let timeline = Timeline::new(&site, &history);
    let us = |text| Some(Moment::from_us(seen(text).us()));
    let cut = report(&timeline, Which::Between(us("2026-11-22T10:00:10.020"), None));
    let since: Vec<_> =
        cut.abnormal.iter().map(|abnormal| abnormal.since.map(|since| since.event.place)).collect();
    assert_eq!(since, [Some(1), Some(2)], "the trip is before the time, and in the incident");
    let rest = report(&timeline, Which::Between(us("2026-11-22T10:00:10.500"), None));
    let input = |abnormal: &ser_evidence::incident::Abnormal| abnormal.since.map(|it| it.input);
    assert_eq!(rest.abnormal.iter().map(input).collect::<Vec<_>>(), [Some(5), Some(7)]);
}

#[test]
fn of_several_incidents_in_the_minute_that_was_asked_for_the_one_with_a_trip_is_meant() {
    let site = site(&format!(
        "{TWO_RECORDERS}[[point]]\nrecorder = \"U1\"\ninput = 1\nname = \"trip\"\nrole = \"trip\"\n"
    ));
    let mut u1 = Log::of("U1", 1);
    let at = monotonic_us("2026-11-22T10:00:00.000");
    u1.observed(HOW, "2026-11-22T10:00:00.000", (at, at + 1_000), Some(0));
    for (time, input) in [("10:05:05", 2), ("10:05:20", 1), ("10:05:40", 3), ("10:06:30", 1)] {
        u1.changes(&format!("2026-11-22T{time}.000"), &[input]);
    }
    let history = history(&site, &[&u1]);
    let timeline = Timeline::new(&site, &history);
    let moment = |text| Moment::from_us(seen(text).us());
    let around = |from, until| {
        let report = report(&timeline, Which::Around(moment(from), moment(until)));
        report.rows[0].change.event.place
    };
    assert_eq!(around("2026-11-22T10:05:00.000", "2026-11-22T10:05:59.999"), 1);
    assert_eq!(around("2026-11-22T10:05:38.000", "2026-11-22T10:05:39.000"), 2, "the nearest");
}

#[test]
fn expected_steps_are_judged_by_the_whole_doubt() {
    let site = site(BREAKER);
    for (opens_ms, verdict) in [
        (12, Verdict::Early),
        (15, Verdict::NotDecidable(Doubt::Straddles)),
        (40, Verdict::InTime),
        (50, Verdict::NotDecidable(Doubt::Straddles)),
        (61, Verdict::Late),
    ] {
        let u1 = trip(opens_ms, None);
        let history = history(&site, &[&u1]);
        let timeline = Timeline::new(&site, &history);
        let report = report(&timeline, Which::LastTrip);
        assert_eq!(report.steps[0].verdict, verdict, "{opens_ms} ms");
    }
}

#[test]
fn what_did_not_follow_is_missing_only_if_it_would_have_been_seen() {
    let site = site(BREAKER);
    for (later, verdict) in [
        (None, Verdict::NotDecidable(Doubt::NotReadSince)),
        (Some("2026-11-22T10:00:10.400"), Verdict::NotDecidable(Doubt::NotReadSince)),
        (Some("2026-11-22T10:00:10.600"), Verdict::Missing),
    ] {
        let u1 = trip(40, later);
        let history = history(&site, &[&u1]);
        let timeline = Timeline::new(&site, &history);
        let report = report(&timeline, Which::LastTrip);
        assert_eq!(report.steps[1].verdict, verdict, "{later:?}");
    }
}

#[test]
fn what_did_not_follow_is_not_called_missing_where_changes_of_its_input_were_left_out() {
    let site = site(BREAKER);
    for (input, verdict) in [(9, Verdict::Missing), (5, Verdict::NotDecidable(Doubt::LeftOut))] {
        let mut u1 = trip(40, Some("2026-11-22T10:00:10.600"));
        u1.left_out("2026-11-22T10:01:00.000", 4660, &[(input, 1)]);
        let history = history(&site, &[&u1]);
        let timeline = Timeline::new(&site, &history);
        let report = report(&timeline, Which::LastTrip);
        assert_eq!(report.steps[1].verdict, verdict, "input {input}");
    }
}

#[test]
fn a_breaker_says_how_long_it_took_and_its_contacts_how_long_they_disagreed() {
    let site = site(BREAKER);
    let u1 = trip(40, None);
    let history = history(&site, &[&u1]);
    let timeline = Timeline::new(&site, &history);
    let report = report(&timeline, Which::LastTrip);
    let [operation] = &report.operations[..] else { panic!("{:?}", report.operations) };
    assert!(operation.opened);
    // The delays of closing and of opening contacts differ by some tenths.
    let took = operation.took.unwrap().middle_us().unwrap();
    assert!((39_700..=40_000).contains(&took), "{took}");
    let [off] = &report.disagreements[..] else { panic!("{:?}", report.disagreements) };
    assert!(!off.both_on && off.until.is_some());
    let abnormal: Vec<usize> = report.abnormal.iter().map(|abnormal| abnormal.point.0).collect();
    assert_eq!(abnormal, [0, 1], "the trip has not reset, and the breaker is open");
}

/// The changes of `BREAKER` at these milliseconds, and what is said to have operated.
fn operated(site: &str, changes: &[(u32, u8)]) -> Vec<String> {
    let site = self::site(site);
    let mut u1 = Log::of("U1", 1);
    let at = monotonic_us("2026-11-22T10:00:00.000");
    u1.observed(HOW, "2026-11-22T10:00:00.000", (at, at + 2_000), Some(1_000));
    for (ms, input) in changes {
        u1.changes(&format!("2026-11-22T10:00:{:02}.{:03}", 10 + ms / 1000, ms % 1000), &[*input]);
    }
    let history = history(&site, &[&u1]);
    let timeline = Timeline::new(&site, &history);
    let ms = |delta: &ser_evidence::timeline::Delta| (delta.middle_us().unwrap() + 500) / 1000;
    let text = |operation: &ser_evidence::incident::Operation| {
        let mut text = (if operation.opened { "opened" } else { "closed" }).to_owned();
        text.extend(operation.took.iter().map(|took| format!(" {}", ms(took))));
        let bounce = operation.bounce.iter();
        text.extend(bounce.map(|of| format!(", bounced {} in {}", of.changes, ms(&of.lasted))));
        text.extend(operation.returned.iter().map(|after| format!(", back after {}", ms(after))));
        text
    };
    report(&timeline, Which::Last).operations.iter().map(text).collect()
}

/// The close command is input 6.
const CLOSE: &str = "
[[point]]
input = 6
name = \"Close\"
role = \"close\"
equipment = \"52-1\"
";

#[test]
fn a_breaker_that_does_not_stay_where_it_went_has_not_bounced() {
    let of = |changes: &[(u32, u8)]| operated(&format!("{BREAKER}{CLOSE}"), changes);
    // Contact 7 is 52a, and off at first; 8 is 52b.
    assert_eq!(of(&[(0, 7), (400, 5), (430, 7), (450, 7)])[1..], ["opened 30, back after 20"]);
    assert_eq!(of(&[(0, 6), (30, 7), (50, 7)]), ["closed 30, back after 20"]);
    let with_52b = [(0, 7), (400, 5), (430, 7), (433, 8), (447, 8), (450, 7)];
    assert_eq!(of(&with_52b)[1..], ["opened 30, back after 20"]);
    let bounced = [(0, 7), (400, 5), (430, 7), (433, 7), (436, 7)];
    assert_eq!(of(&bounced)[1..], ["opened 30, bounced 2 in 6"]);
    let bounced_and_back = [(0, 7), (400, 5), (430, 7), (433, 7), (436, 7), (450, 7)];
    assert_eq!(of(&bounced_and_back)[1..], ["opened 30, bounced 2 in 6, back after 20"]);
    // Closed on a fault, and tripped at once: neither is a bounce.
    assert_eq!(of(&[(0, 6), (50, 7), (55, 5), (75, 7)]), ["closed 50", "opened 20"]);
    assert_eq!(of(&[(0, 6), (45, 5), (50, 7), (75, 7)]), ["closed 50", "opened 30"]);
}

#[test]
fn an_operation_is_after_its_command_only_if_that_may_be_why() {
    let of = |changes: &[(u32, u8)]| operated(&format!("{BREAKER}{CLOSE}"), changes);
    let again = [(0, 7), (400, 5), (430, 7), (450, 5), (600, 7), (800, 7)];
    assert_eq!(of(&again), ["closed", "opened 30", "closed", "opened"]);
    // It was still on, or had just ended.
    assert_eq!(of(&[(0, 7), (400, 5), (1500, 7)])[1..], ["opened 1100"]);
    assert_eq!(of(&[(0, 7), (400, 5), (450, 5), (1300, 7)])[1..], ["opened 900"]);
    assert_eq!(of(&[(0, 7), (400, 5), (450, 5), (1600, 7)])[1..], ["opened"]);
}

#[test]
fn a_state_that_no_source_tells_is_not_off() {
    let site = site(BREAKER);
    let mut u1 = Log::of("U1", 1);
    let at = monotonic_us("2026-11-22T10:00:00.000");
    u1.observed(HOW, "2026-11-22T10:00:00.000", (at, at + 2_000), Some(1_000));
    u1.changes("2026-11-22T10:00:01.000", &[7]).changes("2026-11-22T10:00:10.000", &[5]);
    u1.moves("2026-11-22T10:00:10.040", &[7]);
    let history = history(&site, &[&u1]);
    let timeline = Timeline::new(&site, &history);
    let report = report(&timeline, Which::LastTrip);
    assert_eq!(rows(&timeline, &report), ["U1/5 on", "U1/7 ?"]);
    assert_eq!(report.operations, [], "nobody knows that the breaker opened");
    let opens = report.steps[0];
    assert_eq!(opens.verdict, Verdict::NotDecidable(Doubt::UnknownState));
    assert_eq!(opens.then.map(|then| then.input), Some(7), "it may be this");
    let abnormal: Vec<usize> = report.abnormal.iter().map(|abnormal| abnormal.point.0).collect();
    assert_eq!(abnormal, [0], "of the breaker nobody knows it");
    // A contact that may have opened or closed has the delays of both.
    let width = |input, place| {
        let event = EventId { recorder: 0, life: 0, place };
        timeline.moved_utc(event, Some(input)).width_us().unwrap()
    };
    assert!(width(7, 2) > width(5, 1));
}

#[test]
fn a_step_that_may_have_begun_is_not_decidable_and_what_follows_later_neither() {
    let site = site(&BREAKER.replace("[15, 50]", "[15, 60_000]"));
    let mut u1 = Log::of("U1", 1);
    u1.changes("2026-11-22T10:00:01.000", &[7]).moves("2026-11-22T10:00:10.000", &[5]);
    u1.changes("2026-11-22T10:00:10.040", &[7]);
    // After a quiet time.
    u1.changes("2026-11-22T11:00:00.000", &[5, 7]).changes("2026-11-22T11:00:10.000", &[5]);
    u1.changes("2026-11-22T11:00:20.000", &[5]).moves("2026-11-22T11:00:50.000", &[7]);
    let history = history(&site, &[&u1]);
    let timeline = Timeline::new(&site, &history);
    let incidents = Incident::all(&timeline).into_iter();
    let steps = incidents.flat_map(|incident| Report::new(&timeline, incident).steps);
    let opens: Vec<_> = steps.filter(|step| step.expectation == 0).collect();
    assert_eq!(opens.len(), 2, "{opens:?}");
    for step in opens {
        assert_eq!(step.verdict, Verdict::NotDecidable(Doubt::UnknownState));
        assert_eq!(step.then.map(|then| then.input), Some(7));
    }
}

const SET: How = How::Set { broadcast: None };

#[test]
fn a_clock_that_was_set_in_a_log_without_a_life_may_be_that_of_any_life() {
    let site = site(TWO_RECORDERS);
    let (mut known, mut unknown) = (Log::of("U1", 1), Log::of("U1", 0));
    let at = |utc: &str| (monotonic_us(utc), monotonic_us(utc) + 2_000);
    let observed = |log: &mut Log, how, showed: &str, utc: &str| {
        log.observed(how, showed, at(utc), Some(0));
    };
    known.changes("2026-11-22T10:00:01.000", &[1]);
    observed(&mut known, How::Query, "2026-11-22T10:00:02.000", "2026-11-22T11:00:02.000");
    // Another reader finds entries 3 and 4, knows nothing of lives, and sets the clock.
    unknown.loses(2).changes("2026-11-22T10:00:03.000", &[2]);
    unknown.changes("2026-11-22T10:00:04.000", &[2]);
    observed(&mut unknown, SET, "2026-11-22T11:00:05.000", "2026-11-22T11:00:05.000");
    known.loses(8).changes("2026-11-22T11:00:06.000", &[2]);
    observed(&mut known, How::Query, "2026-11-22T11:00:07.000", "2026-11-22T11:00:07.000");
    let history = history(&site, &[&known, &unknown]);
    assert_eq!(history.recorders[0].lives.len(), 2, "nothing joins the two");
    let timeline = Timeline::new(&site, &history);
    let is_wrong = |finding: &&Finding| matches!(finding, Finding::Contradiction { .. });
    assert_eq!(timeline.findings().iter().find(is_wrong), None, "nothing contradicts anything");
}

const SHARED: &str = "
[[recorder]]
name = \"U1\"
clock = \"utc\"
[[recorder]]
name = \"U2\"
clock = \"utc\"
[[point]]
recorder = \"U1\"
input = 1
name = \"52-1 closed\"
same_as = \"U2/52-1 closed\"
[[point]]
recorder = \"U2\"
input = 9
name = \"52-1 closed\"
inverted = true
";

#[test]
fn a_contact_on_two_recorders_ties_their_clocks_together() {
    let site = site(SHARED);
    let (mut u1, mut u2) = (Log::of("U1", 1), Log::of("U2", 2));
    let at = monotonic_us("2026-11-22T10:00:00.000");
    let how = How::Set { broadcast: None };
    u1.observed(how, "2026-11-22T10:00:00.000", (at, at + 2_000), Some(0));
    u2.observed(how, "2026-11-22T10:00:00.000", (at - 90_000, at + 90_000), Some(0));
    u1.changes("2026-11-22T10:00:01.000", &[4]).changes("2026-11-22T10:00:10.000", &[1]);
    // Normally on there: inverted, so it goes on first.
    u2.changes("2026-11-22T10:00:01.000", &[9]);
    u2.changes("2026-11-22T10:00:10.050", &[9]).changes("2026-11-22T10:00:10.056", &[3]);
    u1.changes("2026-11-22T10:00:10.002", &[2]).changes("2026-11-22T10:00:30.000", &[4]);
    u2.changes("2026-11-22T10:00:30.000", &[3]);
    let history = history(&site, &[&u1, &u2]);
    let timeline = Timeline::new(&site, &history);
    let find = |recorder: u32, sequence: u64| {
        timeline
            .entries()
            .find(|event| {
                event.recorder == recorder
                    && timeline.held(*event).is_some_and(|held| held.sequence == sequence)
            })
            .expect("an entry")
    };
    assert_eq!(timeline.contact_findings(), []);
    // Without the shared contact 180 ms would be unknown between them.
    assert_eq!(timeline.order(find(0, 3), find(1, 3)), Order::Before);
}

#[test]
fn two_movements_of_which_each_recorder_missed_one_are_not_taken_for_one() {
    let site = site(SHARED);
    let at = monotonic_us("2026-11-22T10:00:00.000");
    // Whether U1 was read again, and found to have seen nothing, decides it.
    for (is_read_again, is_one) in [(false, false), (true, true)] {
        let (mut u1, mut u2) = (Log::of("U1", 1), Log::of("U2", 2));
        u1.observed(SET, "2026-11-22T10:00:00.000", (at, at + 2_000), Some(0));
        u2.observed(SET, "2026-11-22T10:00:00.000", (at - 5_000_000, at + 5_000_000), Some(0));
        u1.changes("2026-11-22T10:00:01.000", &[4]).changes("2026-11-22T10:00:10.000", &[1]);
        u1.changes("2026-11-22T10:00:10.100", &[4]);
        // Its power came back only now. Inverted, so this is the same direction.
        u2.changes("2026-11-22T10:00:12.000", &[3]).changes("2026-11-22T10:00:13.000", &[9]);
        u2.changes("2026-11-22T10:00:14.000", &[3]).changes("2026-11-22T10:00:15.000", &[9]);
        u2.changes("2026-11-22T10:00:17.000", &[3]);
        if is_read_again {
            u1.changes("2026-11-22T10:00:40.000", &[4]);
        }
        let history = history(&site, &[&u1, &u2]);
        let timeline = Timeline::new(&site, &history);
        let mine = |event: &EventId| (event.recorder, timeline.held(*event).unwrap().sequence);
        let event = timeline.entries().find(|event| mine(event) == (0, 2)).expect("an entry");
        let same = timeline.same_movement(ChangeId { event, input: 1 });
        assert_eq!(same.is_some(), is_one, "{is_read_again}: {same:?}");
    }
}

#[test]
fn a_contact_that_bounced_is_not_taken_for_one_movement_of_a_recorder_that_overlooked_a_part() {
    let site = site(SHARED);
    let at = monotonic_us("2026-11-22T10:00:00.000");
    for (back_ms, is_one) in [(11, false), (50, true)] {
        let (mut u1, mut u2) = (Log::of("U1", 1), Log::of("U2", 2));
        for log in [&mut u1, &mut u2] {
            log.observed(SET, "2026-11-22T10:00:00.000", (at, at + 8_000), Some(0));
            log.changes("2026-11-22T10:00:01.000", &[4]);
        }
        u2.changes("2026-11-22T10:00:01.500", &[9]).changes("2026-11-22T10:00:10.013", &[9]);
        u2.changes("2026-11-22T10:00:12.000", &[4]);
        u1.changes("2026-11-22T10:00:10.010", &[1]);
        u1.changes(&format!("2026-11-22T10:00:10.0{back_ms}"), &[1]);
        u1.changes("2026-11-22T10:00:12.000", &[4]);
        let history = history(&site, &[&u1, &u2]);
        let timeline = Timeline::new(&site, &history);
        let mine = |event: &EventId| (event.recorder, timeline.held(*event).unwrap().sequence);
        let event = timeline.entries().find(|event| mine(event) == (0, 2)).expect("an entry");
        let same = timeline.same_movement(ChangeId { event, input: 1 });
        assert_eq!(same.is_some(), is_one, "{back_ms}: {same:?}");
    }
}

#[test]
fn a_contact_on_two_recorders_is_one_candidate_for_first_out() {
    let site = site(SHARED);
    let (mut u1, mut u2) = (Log::of("U1", 1), Log::of("U2", 2));
    let at = monotonic_us("2026-11-22T10:00:00.000");
    for log in [&mut u1, &mut u2] {
        log.observed(SET, "2026-11-22T10:00:00.000", (at, at + 2_000), Some(0));
    }
    // Normally on there, as it is inverted.
    u2.changes("2026-11-22T10:00:01.000", &[9]).changes("2026-11-22T10:00:20.001", &[9]);
    u1.changes("2026-11-22T10:00:01.000", &[4]).changes("2026-11-22T10:00:20.000", &[1]);
    u1.changes("2026-11-22T10:00:20.040", &[2]);
    u2.changes("2026-11-22T10:00:20.050", &[3]);
    let history = history(&site, &[&u1, &u2]);
    let timeline = Timeline::new(&site, &history);
    let report = report(&timeline, Which::Last);
    let first = report.first_out.known().expect("one contact moved first");
    let same = timeline.same_movement(first).expect("both saw it");
    let of = |change: ChangeId| (change.event.recorder, change.input);
    assert_eq!([of(first), of(same)], [(0, 1), (1, 9)]);
    assert!(report.first_out.includes(&timeline, same));
    assert_eq!(timeline.same_movement(same), Some(first));
}

#[test]
fn a_contact_that_one_of_its_recorders_saw_later_than_something_else_was_not_first() {
    let site = site(SHARED);
    let (mut u1, mut u2) = (Log::of("U1", 1), Log::of("U2", 2));
    let at = monotonic_us("2026-11-22T10:00:00.000");
    u1.observed(SET, "2026-11-22T10:00:00.000", (at, at + 2_000), Some(0));
    u2.observed(SET, "2026-11-22T10:00:00.000", (at - 90_000, at + 90_000), Some(0));
    u2.changes("2026-11-22T10:00:01.000", &[9]).changes("2026-11-22T10:00:20.000", &[9]);
    u1.changes("2026-11-22T10:00:01.000", &[5]).changes("2026-11-22T10:00:20.000", &[4]);
    // Two milliseconds prove that it came after input 4 here, but not there.
    u1.changes("2026-11-22T10:00:20.002", &[1]).changes("2026-11-22T10:00:20.040", &[2]);
    u2.changes("2026-11-22T10:00:20.050", &[3]);
    let history = history(&site, &[&u1, &u2]);
    let timeline = Timeline::new(&site, &history);
    let report = report(&timeline, Which::Last);
    assert_eq!(report.first_out.known().map(|change| change.input), Some(4));
}

#[test]
fn a_shared_contact_that_only_one_recorder_saw_is_told() {
    let site = site(SHARED);
    let (mut u1, mut u2) = (Log::of("U1", 1), Log::of("U2", 2));
    let at = monotonic_us("2026-11-22T10:00:00.000");
    let how = How::Set { broadcast: None };
    for log in [&mut u1, &mut u2] {
        log.observed(how, "2026-11-22T10:00:00.000", (at, at + 2_000), Some(0));
    }
    u1.changes("2026-11-22T10:00:20.000", &[1]);
    u2.changes("2026-11-22T10:00:10.000", &[3]).changes("2026-11-22T10:00:30.000", &[3]);
    let history = history(&site, &[&u1, &u2]);
    let timeline = Timeline::new(&site, &history);
    let [finding] = timeline.contact_findings() else { panic!("one") };
    assert_eq!((finding.point.0, finding.trouble), (0, ContactTrouble::Missing));
}

#[test]
fn a_shift_by_hand_moves_times_and_nothing_else() {
    let text = format!(
        "{TWO_RECORDERS}
[[shift]]
recorder = \"U1\"
ms = -250
from = \"2026-11-22T09:00:00Z\"
to = \"2026-11-22T12:00:00Z\"
why = \"found 250 ms fast\"
"
    );
    let site = site(&text);
    let mut u1 = Log::of("U1", 1);
    let at = monotonic_us("2026-11-22T10:00:00.000");
    u1.observed(
        How::Set { broadcast: None },
        "2026-11-22T10:00:00.000",
        (at, at + 2_000),
        Some(1_000),
    );
    u1.changes("2026-11-22T10:00:10.000", &[1]).changes("2026-11-22T10:00:10.020", &[2]);
    let history = history(&site, &[&u1]);
    let timeline = Timeline::new(&site, &history);
    let events: Vec<_> = timeline.entries().collect();
    assert_eq!(timeline.shift_us(events[0]), -250_000);
    let middle = timeline.moved_utc(events[0], None).middle().unwrap().us();
    let expected = common::seen("2026-11-22T10:00:09.750").us();
    assert!(middle.abs_diff(expected) < 2_000, "{middle} {expected}");
    let change = |place: usize, input| ChangeId { event: events[place], input };
    assert_eq!(timeline.delta(change(0, 1), change(1, 2)).middle_us(), Some(20_000));
}

/// The first change of each life that nothing in the incident is proven to precede: the plain
/// definition, which compares everything with everything.
fn plainly_first(timeline: &Timeline<'_>, incident: &Incident) -> Vec<EventId> {
    let life = |event: &EventId| (event.recorder, event.life);
    let is_first = |(place, event): &(usize, &EventId)| {
        !incident.events[..*place].iter().any(|before| life(before) == life(event))
    };
    let firsts = incident.events.iter().enumerate().filter(is_first).map(|(_, event)| *event);
    let is_out = |event: EventId| {
        incident.events.iter().any(|other| timeline.order(*other, event) == Order::Before)
    };
    firsts.filter(|&event| !is_out(event)).collect()
}

#[test]
fn what_may_have_been_first_is_found_as_if_everything_was_compared() {
    const NAMES: [&str; 6] = ["U1", "U2", "U3", "U4", "U5", "U6"];
    let recorder = |name: &&str| format!("[[recorder]]\nname = \"{name}\"\nclock = \"utc\"\n");
    let site = site(&NAMES.iter().map(recorder).collect::<String>());
    let mut random = oorandom::Rand64::new(7);
    let mut below = |end: u64| random.rand_range(0..end);
    let mut sizes = std::collections::BTreeSet::new();
    for _ in 0..300 {
        let mut logs: Vec<Log> = Vec::new();
        let broadcast = (below(2) == 0).then_some(7);
        for life in 0..10 {
            let name = NAMES[usize::try_from(below(6)).expect("small")];
            let mut log = Log::of(name, 1 + life);
            // Some clocks are well known, some badly, and some not at all.
            let doubt_us = [500, 5_000, 50_000, 500_000][usize::try_from(below(4)).expect("small")];
            let at = monotonic_us("2026-11-22T09:59:00.000");
            let how = How::Set { broadcast: broadcast.filter(|_| below(3) == 0) };
            if below(4) > 0 {
                let bound = (at - doubt_us, at + doubt_us);
                log.observed(how, "2026-11-22T10:00:00.000", bound, Some(1_000));
            }
            let mut ms = below(60);
            for _ in 0..=below(4) {
                log.changes(&format!("2026-11-22T10:00:05.{ms:03}"), &[1]);
                ms += below(40);
            }
            logs.push(log);
        }
        let history = history(&site, &logs.iter().collect::<Vec<_>>());
        let timeline = Timeline::new(&site, &history);
        for incident in Incident::all(&timeline) {
            let plainly = plainly_first(&timeline, &incident);
            let report = Report::new(&timeline, incident);
            let events = report.first_out.changes.iter().map(|change| change.event);
            assert_eq!(events.collect::<Vec<_>>(), plainly);
            sizes.insert(plainly.len());
        }
    }
    assert!(sizes.len() > 4, "known, and not known among several: {sizes:?}");
}

#[test]
fn a_clock_that_somebody_set_back_after_it_was_set_is_not_known_any_more() {
    let site = site(TWO_RECORDERS);
    let at = monotonic_us("2026-11-22T10:00:00.000");
    for log_is_empty in [false, true] {
        let (mut u1, mut u2) = (Log::of("U1", 1), Log::of("U2", 2));
        if !log_is_empty {
            u1.changes("2026-11-22T09:50:00.000", &[1]);
            u2.changes("2026-11-22T09:50:00.000", &[1]);
        }
        for log in [&mut u1, &mut u2] {
            log.observed(HOW, "2026-11-22T10:00:00.000", (at, at + 10_000), Some(0));
        }
        // Somebody sets U1 back by an hour. It moved first, at 10:00:05; U2 moved at 10:00:08.
        u1.changes("2026-11-22T09:00:05.000", &[3]);
        u2.changes("2026-11-22T10:00:08.000", &[4]);
        let history = history(&site, &[&u1, &u2]);
        let timeline = Timeline::new(&site, &history);
        let moved: Vec<EventId> = timeline
            .entries()
            .filter(|&event| timeline.held(event).unwrap().entry.changed.0 & 0b1100 != 0)
            .collect();
        let [one, other] = moved[..] else { panic!("{moved:?}") };
        assert_eq!(timeline.order(one, other), Order::Unknown, "empty: {log_is_empty}");
        assert_eq!(timeline.order(other, one), Order::Unknown, "empty: {log_is_empty}");
        let last = report(&timeline, Which::Last);
        assert!(
            last.rows.iter().all(|row| row.change.event != one && row.change.event != other)
                || last.first_out.known().is_none(),
            "{:?}",
            last.first_out
        );
    }
}

#[test]
fn a_clock_that_was_asked_and_then_set_back_is_not_known_any_more_either() {
    let site = site(TWO_RECORDERS);
    let (mut u1, mut u2) = (Log::of("U1", 1), Log::of("U2", 2));
    u1.changes("2026-11-22T10:00:00.000", &[1]);
    u2.changes("2026-11-22T10:00:00.000", &[1]);
    let at = monotonic_us("2026-11-22T10:05:00.000");
    for log in [&mut u1, &mut u2] {
        log.observed(How::Query, "2026-11-22T10:05:00.000", (at, at + 2_000), Some(0));
    }
    // U1 is set back by two minutes: still after its first entry, and before what it showed.
    u1.changes("2026-11-22T10:04:00.000", &[3]);
    u2.changes("2026-11-22T10:06:10.000", &[4]);
    let history = history(&site, &[&u1, &u2]);
    let timeline = Timeline::new(&site, &history);
    let entries: Vec<EventId> = timeline.entries().collect();
    let with = |bit: u32| {
        let is_it = |event: &&EventId| timeline.held(**event).unwrap().entry.changed.0 & bit != 0;
        *entries.iter().find(is_it).unwrap()
    };
    assert_eq!(timeline.order(with(0b100), with(0b1000)), Order::Unknown);
    assert_eq!(timeline.order(with(0b1000), with(0b100)), Order::Unknown);
}

/// A log with an incident from 10:00:05 to 10:00:06, whose clock was set at 10:00.
fn log_of_one_incident() -> Log {
    let mut u1 = Log::of("U1", 1);
    let at = monotonic_us("2026-11-22T10:00:00.000");
    u1.observed(HOW, "2026-11-22T10:00:00.000", (at, at + 2_000), Some(1_000));
    u1.changes("2026-11-22T10:00:05.000", &[1]).changes("2026-11-22T10:00:06.000", &[2]);
    u1
}

/// Of which inputs how much, whether since a look, and whether somebody looked afterwards.
type FoundLeftOut = (Vec<(u8, u64)>, bool, bool);

/// What was left out in that incident.
fn left_out(log: &Log) -> Option<FoundLeftOut> {
    let site = site(TWO_RECORDERS);
    let history = history(&site, &[log]);
    let timeline = Timeline::new(&site, &history);
    let report = report(&timeline, Which::Last);
    let of_u1 = &report.completeness[0];
    // It is no gap.
    assert!(of_u1.gaps.is_empty());
    let found = of_u1.left_out.clone()?;
    Some((found.changes.into_iter().collect(), found.from.is_some(), found.is_to_end))
}

#[test]
fn what_a_chatter_filter_left_out_is_counted_between_the_looks_around_the_incident() {
    assert_eq!(left_out(&log_of_one_incident()), None, "nobody looked");
    let mut u1 = log_of_one_incident();
    u1.left_out("2026-11-22T09:00:00.000", 1000, &[(3, 5), (4, 1)]);
    u1.left_out("2026-11-22T09:59:00.000", 4540, &[(3, 10), (4, 1)]);
    // One that is after it for sure counts, and not the ones behind.
    u1.left_out("2026-11-22T10:01:00.000", 4660, &[(3, 17), (4, 1), (5, 2)]);
    u1.left_out("2026-11-22T10:02:00.000", 4720, &[(3, 100), (4, 9), (5, 2)]);
    assert_eq!(left_out(&u1), Some((vec![(3, 7), (5, 2)], true, true)));
}

#[test]
fn without_a_look_before_it_is_counted_from_the_power_up_on() {
    let mut u1 = log_of_one_incident();
    u1.left_out("2026-11-22T10:01:00.000", 4660, &[(3, 17)]);
    assert_eq!(left_out(&u1), Some((vec![(3, 17)], false, true)));
    // And without one afterwards there may be more.
    let mut u1 = log_of_one_incident();
    u1.left_out("2026-11-22T10:00:05.500", 4660, &[(3, 17)]);
    assert_eq!(left_out(&u1), Some((vec![(3, 17)], false, false)));
    // One that ended before it says nothing of it.
    let mut u1 = log_of_one_incident();
    u1.left_out("2026-11-22T09:59:00.000", 4660, &[(3, 17)]);
    assert_eq!(left_out(&u1), None);
}

#[test]
fn counts_of_another_power_up_are_not_subtracted() {
    // It was on for half a minute only, and so all that it counted is new.
    let mut u1 = log_of_one_incident();
    u1.left_out("2026-11-22T09:59:00.000", 4660, &[(3, 10)]);
    u1.left_out("2026-11-22T10:01:00.000", 90, &[(3, 12)]);
    assert_eq!(left_out(&u1), Some((vec![(3, 12)], false, true)));
    // Counters that went back tell it as well.
    let mut u1 = log_of_one_incident();
    u1.left_out("2026-11-22T09:59:00.000", 4660, &[(3, 10)]);
    u1.left_out("2026-11-22T10:01:00.000", 4660, &[(3, 9)]);
    assert_eq!(left_out(&u1), Some((vec![(3, 9)], false, true)));
    // What was counted before and after a power failure within the incident is added.
    let mut u1 = log_of_one_incident();
    u1.left_out("2026-11-22T10:00:05.200", 4660, &[(3, 10)]);
    u1.left_out("2026-11-22T10:01:00.000", 54, &[(3, 12)]);
    assert_eq!(left_out(&u1), Some((vec![(3, 22)], false, true)));
    // One that was switched on after it has nothing to do with it.
    let mut u1 = log_of_one_incident();
    u1.left_out("2026-11-22T10:01:00.000", 5, &[(3, 12)]);
    assert_eq!(left_out(&u1), None);
}

#[test]
fn looks_at_counters_are_in_any_order_and_may_come_twice() {
    let mut u1 = log_of_one_incident();
    u1.left_out("2026-11-22T10:01:00.000", 4660, &[(3, 17)]);
    u1.left_out("2026-11-22T09:59:00.000", 4540, &[(3, 10)]);
    u1.left_out("2026-11-22T10:01:00.000", 4660, &[(3, 17)]);
    assert_eq!(left_out(&u1), Some((vec![(3, 7)], true, true)));
}
