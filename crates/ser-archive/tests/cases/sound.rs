//! What is missing is said, and what somebody changed is found.

use crate::common::*;
use ser_archive::{Access, Error, Hole, Keep};
use ser_evidence::record::{Gap, Lost, Record, Why};

pub(crate) fn a_number_that_is_not_there_is_a_hole_unless_it_was_told(home: &Home) {
    let mut archive = home.open();
    let records = [vec![life(LIFE), gap(LIFE, 5, 2)], entries(LIFE, [3, 4, 5, 8, 9, 12])].concat();
    archive.append(&[batch(records)]).unwrap();
    let check = archive.check().unwrap();
    let found = &check.recorders[0];
    let hole = |after, missing| Hole { life: LIFE, after, missing, told: 0 };
    assert_eq!(found.holes, [hole(0, 2), hole(9, 2)]);
    assert_eq!((found.entries, found.lives, found.told.len()), (6, 1, 1));
    archive.append(&[batch(vec![gap(LIFE, 0, 2), gap(LIFE, 9, 2)])]).unwrap();
    assert!(archive.check().unwrap().is_sound());
}

pub(crate) fn what_was_watched_must_be_there(home: &Home) {
    let mut archive = home.open();
    archive.append(&[batch([vec![watched(LIFE, 5)], entries(LIFE, 1..=4)].concat())]).unwrap();
    let hole = Hole { life: LIFE, after: 4, missing: 1, told: 0 };
    assert_eq!(archive.check().unwrap().recorders[0].holes, [hole]);
    archive.append(&[batch(entries(LIFE, [5]))]).unwrap();
    assert!(archive.check().unwrap().is_sound());
}

pub(crate) fn where_a_log_began_is_not_known_if_its_total_had_wrapped(home: &Home) {
    let mut archive = home.open();
    archive.append(&[batch(entries(LIFE, 700..=705))]).unwrap();
    assert!(archive.check().unwrap().is_sound());
}

pub(crate) fn heads_are_what_verification_finds_and_earlier_ones_are_known_again(home: &Home) {
    let mut archive = home.open();
    archive.append(&[batch(entries(LIFE, 1..=3))]).unwrap();
    let early = archive.heads().unwrap();
    archive.append(&[batch(entries(LIFE, 4..=5))]).unwrap();
    let mut other = batch(entries(NEXT_LIFE, [1]));
    other.collector = "attic".to_owned();
    archive.append(&[other]).unwrap();
    let heads = archive.heads().unwrap();
    let mut verified = archive.verify().unwrap().0;
    verified.sort_by(|one, other| one.collector.cmp(&other.collector));
    assert_eq!(heads, verified);
    assert_eq!(heads.len(), 2);
    assert!(archive.has_head(&early[0].digest).unwrap());
    assert!(!archive.has_head(&[7; 32]).unwrap());
}

pub(crate) fn a_tail_that_is_taken_away_shows_in_the_head_that_was_written_down(home: &Home) {
    let mut archive = home.open();
    archive.append(&[batch(entries(LIFE, 1..=3))]).unwrap();
    let middle = archive.verify().unwrap().0;
    archive.append(&[batch(entries(LIFE, 4..=6))]).unwrap();
    let end = archive.verify().unwrap().0;
    assert_ne!(middle, end);
    assert_eq!(archive.heads().unwrap(), end);
    home.sql("DELETE FROM entry WHERE position > 3; DELETE FROM link WHERE position > 3");
    assert_eq!(archive.verify().unwrap(), (middle, Vec::new()));
}

pub(crate) fn what_is_let_go_is_told_and_the_rest_stays_proven(home: &Home) {
    let mut archive = home.open();
    for day in 0..10 {
        let first = u64::try_from(day).unwrap() * 100 + 1;
        let records = [vec![observed(LIFE, first)], entries(LIFE, first..first + 100)].concat();
        let mut batch = batch(records);
        batch.at = at_s(day * 86_400);
        archive.append(&[batch]).unwrap();
    }
    archive.append(&[batch(vec![life(LIFE)])]).unwrap();
    let mut left = 1000;
    for day in [3, 3, 7] {
        let keep = Keep { since: Some(at_s(day * 86_400)), bytes: None };
        let gone = archive.expire(keep, at_s(20 * 86_400)).unwrap();
        let now_left = 1000 - u64::try_from(day).unwrap() * 100;
        assert_eq!(gone.entries, left - now_left);
        left = now_left;
        let check = archive.check().unwrap();
        assert!(check.is_sound(), "{check:?}");
        assert_eq!(archive.heads().unwrap(), archive.verify().unwrap().0);
        assert_eq!(check.recorders[0].entries, left);
        let told: u64 = check.recorders[0]
            .told
            .iter()
            .map(|gap| match gap {
                Gap { lost: Lost::Exactly(count), why: Why::Expired, .. } => u64::from(*count),
                other => panic!("{other:?}"),
            })
            .sum();
        assert_eq!(told, 1000 - left);
        let (heads, broken) = archive.verify().unwrap();
        assert_eq!(broken, []);
        assert!(heads[0].expired_to.is_some());
    }
    // What is known of the clock stays.
    let clocks = everything(&mut archive, "U1-SER1")
        .into_iter()
        .filter(|record| matches!(record, Record::Clock(_)))
        .count();
    assert_eq!(clocks, 10);
    // Read again from the recorder, it does not come back unseen: the rest is as it was.
    assert_eq!(archive.append(&[batch(entries(LIFE, 900..=1000))]).unwrap()[0].known, 101);
}

pub(crate) fn what_another_collector_adds_late_is_no_contradiction(home: &Home) {
    let mut archive = home.open();
    archive.append(&[batch([vec![life(LIFE)], entries(LIFE, 1..=50)].concat())]).unwrap();
    archive.expire(Keep { since: Some(at_s(1)), bytes: None }, at_s(2)).unwrap();
    let mut late = batch(entries(LIFE, 30..=60));
    late.collector = "control room".to_owned();
    late.at = at_s(3);
    archive.append(&[late]).unwrap();
    let check = archive.check().unwrap();
    assert!(check.is_sound(), "{check:?}");
    // What was read by nobody is missing all the same.
    archive.append(&[batch([vec![gap(LIFE, 61, 3)], entries(LIFE, [63, 70])].concat())]).unwrap();
    let hole = |after, missing, told| Hole { life: LIFE, after, missing, told };
    assert_eq!(archive.check().unwrap().recorders[0].holes, [hole(60, 2, 1), hole(63, 6, 1)]);
}

pub(crate) fn entries_that_collectors_add_in_turn_become_one_gap(home: &Home) {
    let mut archive = home.open();
    for number in 1..=200 {
        let mut batch = batch(entries(LIFE, [number]));
        batch.collector = format!("collector {}", number % 2);
        archive.append(&[batch]).unwrap();
    }
    let gone = archive.expire(Keep { since: Some(at_s(1)), bytes: None }, at_s(2)).unwrap();
    assert_eq!((gone.entries, gone.gaps), (200, 1));
    let whole = Gap { life: LIFE, after: Some(0), lost: Lost::Exactly(200), why: Why::Expired };
    assert_eq!(everything(&mut archive, "U1-SER1"), [Record::Gap(whole)]);
    assert!(archive.check().unwrap().is_sound());
    let (heads, broken) = archive.verify().unwrap();
    assert_eq!((heads.len(), broken.len()), (2, 0));
}

pub(crate) fn neighbouring_gaps_become_one_in_time(home: &Home) {
    let mut archive = home.open();
    for day in 0..40_u64 {
        let seconds = i64::try_from(day).unwrap() * 86_400;
        let records = [vec![observed(LIFE, day + 1)], entries(LIFE, day * 5 + 1..=day * 5 + 5)];
        let mut batch = batch(records.concat());
        batch.collector = format!("collector {}", day % 2);
        batch.at = at_s(seconds);
        archive.append(&[batch]).unwrap();
        let keep = Keep { since: Some(at_s(seconds - 3 * 86_400)), bytes: None };
        archive.expire(keep, at_s(seconds + 1)).unwrap();
        let check = archive.check().unwrap();
        assert!(check.is_sound(), "{check:?}");
        assert!(check.recorders[0].told.len() <= 12, "{day}: {:?}", check.recorders[0].told);
        assert_eq!(archive.verify().unwrap().1, []);
    }
}

pub(crate) fn a_conflict_that_was_let_go_is_one_still(home: &Home) {
    let mut archive = home.open();
    for (second, sequence) in [(0, 1), (10, 2), (20, 3)] {
        let mut other = entry(LIFE, sequence);
        other.entry.state.0 ^= 2;
        let records = vec![Record::Entry(entry(LIFE, sequence)), Record::Entry(other)];
        let mut batch = batch(records);
        batch.at = at_s(second);
        archive.append(&[batch]).unwrap();
    }
    for (since, left) in [(5, 2), (15, 1), (25, 0)] {
        archive.expire(Keep { since: Some(at_s(since)), bytes: None }, at_s(30)).unwrap();
        let check = archive.check().unwrap();
        let found = &check.recorders[0];
        assert_eq!((found.conflicts, found.expired_conflicts), (left, 3 - left));
        assert!(!check.is_sound());
        assert_eq!(archive.verify().unwrap().1, []);
    }
}

pub(crate) fn all_may_be_let_go(home: &Home) {
    let mut archive = home.open();
    archive.append(&[batch(entries(LIFE, 1..=50))]).unwrap();
    let keep = Keep { since: Some(at_s(1)), bytes: None };
    assert_eq!(archive.expire(keep, at_s(2)).unwrap().entries, 50);
    assert_eq!(archive.verify().unwrap().1, []);
    archive.append(&[batch(entries(LIFE, 51..=60))]).unwrap();
    assert_eq!(archive.verify().unwrap().1, []);
    assert!(archive.check().unwrap().is_sound());
}

pub(crate) fn a_life_of_which_nothing_is_left_has_no_hole_before_its_first_entry(home: &Home) {
    let mut archive = home.open();
    let records = [entries(LIFE, 700..=705), vec![watched(LIFE, 705)]].concat();
    archive.append(&[batch(records)]).unwrap();
    archive.expire(Keep { since: Some(at_s(1)), bytes: None }, at_s(2)).unwrap();
    let check = archive.check().unwrap();
    assert!(check.is_sound(), "{check:?}");
    archive.append(&[batch(vec![watched(LIFE, 706)])]).unwrap();
    let hole = Hole { life: LIFE, after: 699, missing: 7, told: 6 };
    assert_eq!(archive.check().unwrap().recorders[0].holes, [hole]);
}

pub(crate) fn an_archive_that_is_too_large_loses_its_oldest(home: &Home) {
    let mut archive = home.open();
    for part in 0..40_u64 {
        let mut batch = batch(entries(LIFE, part * 100 + 1..=part * 100 + 100));
        batch.at = at_s(part.try_into().unwrap());
        archive.append(&[batch]).unwrap();
    }
    let keep = Keep { since: None, bytes: Some(300_000) };
    let gone = archive.expire(keep, at_s(100)).unwrap();
    let check = archive.check().unwrap();
    assert!(check.is_sound());
    assert!((500..3500).contains(&gone.entries), "{gone:?}");
    assert_eq!(check.recorders[0].entries, 4000 - gone.entries);
    let left = everything(&mut archive, "U1-SER1");
    assert_eq!(left.last(), entries(LIFE, [4000]).last());
    assert_eq!(archive.expire(keep, at_s(101)).unwrap().entries, 0);
}

pub(crate) fn evidence_that_is_too_large_alone_takes_no_entry_with_it(home: &Home) {
    let mut archive = home.open();
    let clocks = (1..=400).map(|after| observed(LIFE, after)).collect();
    archive.append(&[batch(clocks), batch(entries(LIFE, 1..=400))]).unwrap();
    let keep = Keep { since: Some(at_s(1)), bytes: Some(60_000) };
    let error = archive.expire(keep, at_s(2)).unwrap_err();
    assert!(matches!(error, Error::KeepsTooLittle { bytes: 60_000, .. }), "{error}");
    assert_eq!(archive.check().unwrap().recorders[0].entries, 400);
}

pub(crate) fn a_clock_that_was_wrong_takes_no_more_than_is_too_much(home: &Home) {
    let mut archive = home.open();
    for part in 0..40_u64 {
        let mut batch = batch(entries(LIFE, part * 100 + 1..=part * 100 + 100));
        let is_wrong = [0, 2, 20].contains(&part);
        batch.at = at_s(if is_wrong { 4_000_000_000 } else { part.try_into().unwrap() });
        archive.append(&[batch]).unwrap();
    }
    let keep = Keep { since: None, bytes: Some(300_000) };
    let gone = archive.expire(keep, at_s(100)).unwrap();
    assert!((500..3500).contains(&gone.entries), "{gone:?}");
    let left = everything(&mut archive, "U1-SER1");
    assert_eq!(left.last(), entries(LIFE, [4000]).last());
    assert!(archive.check().unwrap().is_sound());
    assert_eq!(archive.verify().unwrap().1, []);
}

pub(crate) fn many_small_batches_are_let_go(home: &Home) {
    let mut archive = home.open();
    let batches: Vec<_> = (1..=10_000)
        .map(|number| {
            let mut batch = batch(entries(LIFE, number * 8 - 7..=number * 8));
            batch.at = at_s(number.try_into().unwrap());
            batch
        })
        .collect();
    archive.append(&batches).unwrap();
    let keep = Keep { since: Some(at_s(9001)), bytes: None };
    // Who looks meanwhile finds everything told after each step.
    let mut reader = home.open_for(Access::Read).unwrap();
    let gone = std::thread::scope(|scope| {
        let expiry = scope.spawn(move || archive.expire(keep, at_s(20_000)).unwrap());
        loop {
            let is_over = expiry.is_finished();
            let check = reader.check().unwrap();
            assert!(check.is_sound(), "{check:?}");
            assert_eq!(reader.verify().unwrap().1, []);
            if is_over {
                break expiry.join().unwrap();
            }
        }
    });
    // Each step has a gap of its own, and there are few.
    assert_eq!((gone.entries, gone.gaps), (72_000, 3));
}

pub(crate) fn numbers_that_no_log_has_are_damage_and_no_more(home: &Home) {
    let mut archive = home.open();
    let mut first = entry(LIFE, 1);
    first.sequence = Some(0);
    let error = archive.append(&[batch(vec![Record::Entry(first)])]).unwrap_err();
    assert!(matches!(error, Error::NoPlace { .. }), "{error}");
    archive.append(&[batch([vec![life(LIFE)], entries(LIFE, 1..=3)].concat())]).unwrap();
    let keep = Keep { since: Some(at_s(1)), bytes: None };
    for number in [0, -1, i64::MIN, i64::MAX] {
        home.sql(&format!("UPDATE entry SET sequence = {number} WHERE position = 2"));
        assert!(archive.check().is_err(), "{number}");
        assert!(archive.expire(keep, at_s(2)).is_err(), "{number}");
        assert!(archive.verify().is_err(), "{number}");
    }
    home.sql("UPDATE entry SET sequence = 1 WHERE position = 2");
    assert_eq!(archive.verify().unwrap().1, []);
    home.sql(&format!("UPDATE link SET rows = {}", i64::MAX));
    assert!(archive.append(&[batch(entries(LIFE, 4..=5))]).is_err());
    home.sql(&format!("UPDATE link SET rows = 4; UPDATE archive SET position = {}", i64::MAX));
    assert!(archive.append(&[batch(entries(LIFE, 4..=5))]).is_err());
}

pub(crate) fn a_row_that_somebody_changed_is_found(home: &Home) {
    let mut archive = home.open();
    for part in 0..3 {
        archive.append(&[batch(entries(LIFE, part * 3 + 1..=part * 3 + 3))]).unwrap();
    }
    for change in [
        "UPDATE entry SET state = state + 1 WHERE sequence = 5",
        "UPDATE entry SET stamp = stamp - 1 WHERE sequence = 5",
        "DELETE FROM entry WHERE sequence = 4",
    ] {
        home.sql(change);
        let broken = archive.verify().unwrap().1;
        assert_eq!((broken.len(), broken[0].good_to), (1, 3), "{change}");
        assert!(broken[0].until.is_some_and(|until| (5..=6).contains(&until)), "{broken:?}");
    }
}
