//! What is added is there, once, and given back as it was.

use crate::common::*;
use ser_archive::{Access, Archive, Batch, Error, Keep, LeftOut, Wanted, Window};
use ser_evidence::record::{
    EntryRecord, Life, NoteRecord, Outcome, PointRecord, Record, SiteRecord,
};
use ser_evidence::time::shown;
use ser_proto::{Inputs, TimeStamp};

pub(crate) fn what_was_added_is_given_back_and_added_again_changes_nothing(home: &Home) {
    let mut archive = home.open();
    let known = vec![
        life(LIFE),
        observed(LIFE, 3),
        gap(LIFE, 5, 2),
        watched(LIFE, 9),
        command(Outcome::Done),
    ];
    let records = [known.clone(), entries(LIFE, [1, 2, 3, 4, 5, 8, 9])].concat();
    let appended = archive.append(&[batch(records.clone())]).unwrap()[0];
    assert_eq!((appended.entries, appended.evidence, appended.known), (7, 5, 0));
    assert_eq!(everything(&mut archive, "U1-SER1"), records);
    assert_eq!(in_order(&mut archive), records);

    let again = archive.append(&[batch(records.clone())]).unwrap()[0];
    assert_eq!((again.entries, again.evidence, again.known), (0, 0, 12));
    assert_eq!(again.position, appended.position);
    drop(archive);
    let mut archive = home.open_for(Access::Read).unwrap();
    assert_eq!(everything(&mut archive, "U1-SER1"), records);
    assert!(everything(&mut archive, "U1-SER2").is_empty());
    assert_eq!(archive.recorders().unwrap(), ["U1-SER1"]);
}

pub(crate) fn two_collectors_that_read_the_same_add_it_once(home: &Home) {
    let (mut one, mut other) = (home.open(), home.open());
    one.append(&[batch(entries(LIFE, 1..=5))]).unwrap();
    let mut late = batch(entries(LIFE, 3..=7));
    late.collector = "control room".to_owned();
    let appended = other.append(&[late]).unwrap()[0];
    assert_eq!((appended.entries, appended.known, appended.conflicts), (2, 3, 0));
    assert_eq!(everything(&mut one, "U1-SER1"), entries(LIFE, 1..=7));
}

pub(crate) fn another_content_at_the_same_place_is_kept_beside_it(home: &Home) {
    let mut archive = home.open();
    let mut other = entry(LIFE, 2);
    other.entry.state = Inputs(0);
    let (first, other) = (entries(LIFE, 1..=3), vec![Record::Entry(other)]);
    archive.append(&[batch(first.clone())]).unwrap();
    for conflicts in [1, 0] {
        let appended = archive.append(&[batch(other.clone())]).unwrap()[0];
        assert_eq!((appended.entries, appended.conflicts), (0, conflicts));
    }
    assert_eq!(everything(&mut archive, "U1-SER1"), [first, other].concat());
    let check = archive.check().unwrap();
    assert_eq!(check.recorders[0].conflicts, 1);
    assert!(!check.is_sound());
}

pub(crate) fn a_conflict_within_one_batch_is_one_too(home: &Home) {
    let mut archive = home.open();
    let mut other = entry(LIFE, 1);
    other.entry.changed = Inputs(4);
    let records = vec![Record::Entry(entry(LIFE, 1)), Record::Entry(other)];
    let appended = archive.append(&[batch([records.clone(), records].concat())]).unwrap()[0];
    assert_eq!((appended.entries, appended.conflicts, appended.known), (1, 1, 2));
}

pub(crate) fn the_number_in_the_ring_is_no_part_of_what_an_entry_is(home: &Home) {
    let mut archive = home.open();
    let mut resized = entry(LIFE, 1);
    resized.number = 700;
    archive.append(&[batch(entries(LIFE, [1]))]).unwrap();
    assert_eq!(archive.append(&[batch(vec![Record::Entry(resized)])]).unwrap()[0].known, 1);
}

pub(crate) fn a_bookmark_moves_with_what_was_read_or_not_at_all(home: &Home) {
    let mut archive = home.open();
    assert_eq!(archive.bookmark("cellar", "U1-SER1").unwrap(), None);
    let mut good = batch(entries(LIFE, 1..=5));
    good.bookmark = Some(bookmark(LIFE, 5));
    archive.append(&[good]).unwrap();
    assert_eq!(archive.bookmark("cellar", "U1-SER1").unwrap(), Some(bookmark(LIFE, 5)));
    assert_eq!(archive.bookmark("control room", "U1-SER1").unwrap(), None);

    let mut nowhere = entry(LIFE, 7);
    nowhere.sequence = None;
    let mut bad = batch(vec![Record::Entry(entry(LIFE, 6)), Record::Entry(nowhere)]);
    bad.bookmark = Some(bookmark(LIFE, 7));
    let mut fine = batch(entries(NEXT_LIFE, [1]));
    fine.recorder = "U1-SER2".to_owned();
    let error = archive.append(&[fine, bad]).unwrap_err();
    assert!(matches!(error, Error::NoPlace { .. }), "{error}");
    assert_eq!(archive.bookmark("cellar", "U1-SER1").unwrap(), Some(bookmark(LIFE, 5)));
    assert_eq!(everything(&mut archive, "U1-SER1"), entries(LIFE, 1..=5));
    assert_eq!(archive.recorders().unwrap(), ["U1-SER1"]);

    let mut empty = batch(Vec::new());
    empty.bookmark = Some(bookmark(NEXT_LIFE, 0));
    let position = archive.position().unwrap();
    archive.append(&[empty]).unwrap();
    assert_eq!(archive.bookmark("cellar", "U1-SER1").unwrap(), Some(bookmark(NEXT_LIFE, 0)));
    assert_eq!(archive.position().unwrap(), position);
}

pub(crate) fn what_could_not_be_read_again_is_not_added(home: &Home) {
    let mut archive = home.open();
    let named = |name: &str| {
        Record::Point(PointRecord {
            input: 1,
            name: name.into(),
            on: "on".into(),
            off: "off".into(),
        })
    };
    for bad in [named("two\nlines"), named(&"long ".repeat(20_000))] {
        let mut batch = batch([entries(LIFE, [1]), vec![bad]].concat());
        batch.bookmark = Some(bookmark(LIFE, 1));
        assert!(archive.append(&[batch]).is_err());
    }
    assert_eq!(archive.bookmark("cellar", "U1-SER1").unwrap(), None);
    archive.append(&[batch(vec![named("pump")])]).unwrap();
    assert_eq!(everything(&mut archive, "U1-SER1"), [named("pump")]);
}

pub(crate) fn remarks_and_versions_of_the_site_file_are_kept_as_they_are(home: &Home) {
    let mut archive = home.open();
    let note = |text: &str, closes| {
        Record::Note(NoteRecord {
            at: host_reading(90),
            user: "ada".to_owned(),
            host: "desk-7".to_owned(),
            life: LIFE,
            sequence: 2,
            text: text.to_owned(),
            closes,
        })
    };
    let site = |text: &str| Record::Site(SiteRecord { at: host_reading(0), text: text.to_owned() });
    let records = [
        site("[[recorder]]\n\tname = \"Süd\"\r\n"),
        note("test of the relay", false),
        note("", true),
        site(&"# long\n".repeat(100_000)),
    ];
    archive.append(&[batch([&records[..], &entries(LIFE, 1..=3)].concat())]).unwrap();
    let appended = archive.append(&[batch(records.to_vec())]).unwrap();
    assert_eq!(appended[0].known, 4);
    assert_eq!(everything(&mut archive, "U1-SER1"), [&records[..], &entries(LIFE, 1..=3)].concat());
    assert!(archive.check().unwrap().is_sound());
    assert_eq!(archive.verify().unwrap().1, []);

    let control = site("\u{1b}");
    assert!(archive.append(&[batch(vec![control])]).is_err());
}

pub(crate) fn a_window_is_by_what_the_recorder_showed_and_an_impossible_stamp_is_in_each(
    home: &Home,
) {
    let mut archive = home.open();
    let mut impossible = entry(LIFE, 4);
    impossible.entry.time = TimeStamp { month: 13, ..impossible.entry.time };
    let impossible = Record::Entry(impossible);
    let records = [entries(LIFE, 1..=3), vec![impossible.clone()], entries(LIFE, 5..=9)].concat();
    archive.append(&[batch(records)]).unwrap();
    let moment = |sequence| shown(&entry(LIFE, sequence).entry.time);
    let window = |from: Option<u64>, until: Option<u64>| Window {
        from: from.and_then(moment),
        until: until.and_then(moment),
    };
    let mut read = |window| {
        let mut found = Vec::new();
        archive
            .read("U1-SER1", window, &mut |record| {
                found.push(record.clone());
                Ok(())
            })
            .unwrap();
        found
    };
    let with = |before, after| [before, vec![impossible.clone()], after].concat();
    assert_eq!(read(window(Some(6), Some(7))), with(vec![], entries(LIFE, 6..=7)));
    assert_eq!(read(window(None, Some(2))), with(entries(LIFE, 1..=2), vec![]));
    assert_eq!(read(window(Some(8), None)), with(vec![], entries(LIFE, 8..=9)));
}

pub(crate) fn an_excerpt_shows_what_is_missing_beside_it_and_says_what_it_leaves_out(home: &Home) {
    let mut archive = home.open();
    let one = [1..=20, 31..=40, 43..=60].into_iter().flatten();
    let mut conflict = entry(LIFE, 3);
    conflict.entry.state = Inputs(0);
    let records = [
        vec![gap(LIFE, 20, 10), life(LIFE)],
        entries(LIFE, one),
        entries(NEXT_LIFE, 70..=80),
        vec![Record::Entry(conflict)],
    ];
    archive.append(&[batch(records.concat())]).unwrap();
    let moment = |sequence| shown(&entry(LIFE, sequence).entry.time);
    let mut excerpt = |wanted: &Wanted| {
        let mut found = Vec::new();
        let left_out = archive.excerpt("U1-SER1", wanted, &mut |record| {
            let Record::Entry(entry) = record else { panic!("{record:?}") };
            found.push((entry.life, entry.sequence.unwrap()));
            Ok(())
        });
        (found, left_out.unwrap())
    };
    let in_life = |sequences: &[u64], of_next: &[u64]| -> Vec<(Life, u64)> {
        let one = sequences.iter().map(|&sequence| (LIFE, sequence));
        let next = of_next.iter().map(|&sequence| (NEXT_LIFE, sequence));
        one.chain(next).collect()
    };
    let between = |life, after, before| LeftOut { life, after, before };
    // Nothing is wanted: the ends of each life, what contradicts, and their neighbours.
    let (found, left_out) = excerpt(&Wanted::default());
    let mut expected = in_life(&[1, 2, 3, 4, 59, 60], &[70, 71, 79, 80]);
    expected.push((LIFE, 3));
    assert_eq!(found, expected);
    assert_eq!(left_out, [between(LIFE, 4, 59), between(NEXT_LIFE, 71, 79)]);
    // Both sides of what is missing next to the window are there, and nothing is left out there.
    let windows = vec![Window { from: moment(38), until: moment(40) }];
    let (found, left_out) = excerpt(&Wanted { windows, ..Wanted::default() });
    for sequence in [37, 38, 39, 40, 43] {
        assert!(found.contains(&(LIFE, sequence)), "{sequence}: {found:?}");
    }
    assert!(left_out.iter().all(|left_out| left_out.before <= 37 || left_out.after >= 43));
    // A window in which nothing is: what is missing over all of it shows.
    let windows = vec![Window { from: moment(24), until: moment(26) }];
    let (found, left_out) = excerpt(&Wanted { windows, ..Wanted::default() });
    assert!(found.contains(&(LIFE, 20)) && found.contains(&(LIFE, 31)));
    assert!(left_out.iter().all(|left_out| left_out.before <= 20 || left_out.after >= 31));
    // A place, and what comes after it; a whole life.
    let wanted = Wanted { places: vec![(LIFE, 20)], lives: vec![NEXT_LIFE], ..Wanted::default() };
    let (found, left_out) = excerpt(&wanted);
    assert!(found.contains(&(LIFE, 20)) && found.contains(&(LIFE, 31)));
    assert_eq!(found.iter().filter(|(life, _)| *life == NEXT_LIFE).count(), 11);
    assert!(left_out.iter().all(|left_out| left_out.life == LIFE));
    assert_eq!(archive.excerpt("U9", &wanted, &mut |_| panic!()).unwrap(), []);
    assert_eq!(archive.lives("U1-SER1").unwrap(), [NEXT_LIFE, LIFE], "as signed numbers");
    assert_eq!(archive.lives("U9").unwrap(), []);
}

pub(crate) fn the_last_time_that_an_input_went_on_is_found_whatever_clocks_showed(home: &Home) {
    let mut archive = home.open();
    // Input 3 changes in each 32nd entry; it goes on there, but for the last one.
    let mut off = entry(LIFE, 66);
    off.entry.state = Inputs(0);
    let old = |sequence| {
        let mut old = entry(NEXT_LIFE, sequence);
        old.entry.time.year = 0;
        Record::Entry(old)
    };
    archive.append(&[batch(entries(LIFE, 1..=65))]).unwrap();
    archive.append(&[batch(vec![Record::Entry(off)])]).unwrap();
    assert_eq!(archive.last_on("U1-SER1", 1 << 2).unwrap(), [(LIFE, 34)]);
    assert_eq!(archive.last_on("U1-SER2", 1 << 2).unwrap(), []);
    archive.append(&[batch((1..=3).map(old).collect())]).unwrap();
    assert_eq!(archive.last_on("U1-SER1", 1 << 2).unwrap(), [(LIFE, 34), (NEXT_LIFE, 2)]);
}

pub(crate) fn a_life_is_found_by_an_entry_of_it(home: &Home) {
    let mut archive = home.open();
    let far = 3 * 65_536 + 7;
    archive.append(&[batch(entries(LIFE, [1, 2, far]))]).unwrap();
    let mut life_of = |sequence, entry| archive.life_of("U1-SER1", sequence, &entry).unwrap();
    assert_eq!(life_of(2, entry(LIFE, 2).entry), Some((LIFE, 2)));
    assert_eq!(life_of(7, entry(LIFE, far).entry), Some((LIFE, far)));
    assert_eq!(life_of(3, entry(LIFE, 2).entry), None);
    assert_eq!(life_of(2, entry(LIFE, 1).entry), None);
    let mut impossible = entry(LIFE, 3);
    impossible.entry.time.month = 13;
    archive.append(&[batch(vec![Record::Entry(impossible)])]).unwrap();
    let mut life_of = |sequence, entry| archive.life_of("U1-SER1", sequence, &entry).unwrap();
    assert_eq!(life_of(3, impossible.entry), Some((LIFE, 3)));
    assert_eq!(life_of(3, entry(LIFE, 3).entry), None);
}

/// A batch of another collector, which has drawn other names for lives.
fn elsewhere(records: Vec<Record>) -> Batch {
    Batch { collector: "control room".to_owned(), joins: true, ..batch(records) }
}

/// The same entries in a life of another name, counted from elsewhere.
fn renamed(life: Life, sequences: impl IntoIterator<Item = u64>, back: u64) -> Vec<Record> {
    let renamed = |sequence| {
        let entry = entry(LIFE, sequence);
        Record::Entry(EntryRecord { life, sequence: Some(sequence - back), ..entry })
    };
    sequences.into_iter().map(renamed).collect()
}

pub(crate) fn a_life_with_two_names_is_filed_once(home: &Home) {
    let mut archive = home.open();
    let far = 3 * 65_536;
    archive.append(&[batch(entries(LIFE, far + 1..=far + 5))]).unwrap();
    // The other collector has seen the log later, and does not know that its total had wrapped.
    let other = Life::from_bits(77);
    let seen = [vec![life(other), gap(other, 0, 2)], renamed(other, far + 3..=far + 7, far)];
    let appended = archive.append(&[elsewhere(seen.concat())]).unwrap()[0];
    assert_eq!((appended.entries, appended.known, appended.conflicts), (2, 3, 0));
    // Later batches have no entry in common any more, and none at all.
    let later = [renamed(other, [far + 8], far), vec![gap(other, 8, 2), watched(other, 10)]];
    archive.append(&[elsewhere(later.concat())]).unwrap();
    assert_eq!(
        everything(&mut archive, "U1-SER1"),
        [
            vec![life(LIFE), gap(LIFE, 0, 2), gap(LIFE, far + 8, 2), watched(LIFE, far + 10)],
            entries(LIFE, far + 1..=far + 8)
        ]
        .concat()
    );
    assert!(archive.verify().unwrap().1.is_empty());
}

pub(crate) fn a_life_that_contradicts_another_is_not_that_one(home: &Home) {
    let mut archive = home.open();
    archive.append(&[batch(entries(LIFE, 1..=5))]).unwrap();
    let other = Life::from_bits(77);
    let mut seen = renamed(other, 1..=5, 0);
    let Some(Record::Entry(last)) = seen.last_mut() else { unreachable!() };
    last.entry.state = Inputs(0x8000_0000);
    let appended = archive.append(&[elsewhere(seen)]).unwrap()[0];
    assert_eq!((appended.entries, appended.conflicts), (5, 0));
}

pub(crate) fn what_one_collector_tells_apart_stays_apart(home: &Home) {
    let mut archive = home.open();
    // A recorder without a clock: the log begins with the same entry after each power failure.
    for name in [77, 78] {
        let entries = renamed(Life::from_bits(name), [1], 0);
        let appended = archive.append(&[elsewhere(entries)]).unwrap()[0];
        assert_eq!((appended.entries, appended.conflicts), (1, 0));
    }
    // For another collector it may be either, and is one of them.
    let third = Batch { collector: "tower".to_owned(), ..elsewhere(renamed(NEXT_LIFE, [1], 0)) };
    assert_eq!(archive.append(&[third]).unwrap()[0].known, 1);
}

pub(crate) fn of_several_lives_the_one_with_most_in_common_is_taken(home: &Home) {
    let mut archive = home.open();
    // After a power failure the log began with the same entry, and went on.
    archive.append(&[batch(renamed(Life::from_bits(1), [1], 0))]).unwrap();
    archive.append(&[batch(renamed(Life::from_bits(2), 1..=40, 0))]).unwrap();
    archive.append(&[batch(renamed(Life::from_bits(3), [1], 0))]).unwrap();
    let appended = archive.append(&[elsewhere(renamed(NEXT_LIFE, 1..=41, 0))]).unwrap()[0];
    assert_eq!((appended.entries, appended.known), (1, 40));
}

pub(crate) fn who_moves_to_an_archive_that_was_given_his_rows_goes_on_there(home: &Home) {
    let mut archive = home.open();
    archive.append(&[elsewhere(renamed(LIFE, 1..=40, 0))]).unwrap();
    // It has no bookmark there, so it draws a new name for the log.
    let mut again = elsewhere(renamed(NEXT_LIFE, 20..=45, 0));
    again.bookmark = Some(bookmark(NEXT_LIFE, 45));
    let appended = archive.append(&[again]).unwrap()[0];
    assert_eq!((appended.entries, appended.known), (5, 21));
    // What it tells apart from then on stays apart.
    let mut other = elsewhere(renamed(Life::from_bits(5), [1], 0));
    other.bookmark = Some(bookmark(Life::from_bits(5), 1));
    assert_eq!(archive.append(&[other]).unwrap()[0].entries, 1);
}

pub(crate) fn an_impossible_stamp_tells_a_life_as_well(home: &Home) {
    let mut archive = home.open();
    let impossible = |life| {
        let mut entry = entry(life, 3);
        entry.entry.time.month = 13;
        vec![Record::Entry(entry)]
    };
    archive.append(&[batch(impossible(LIFE))]).unwrap();
    let again = elsewhere(impossible(NEXT_LIFE));
    assert_eq!(archive.append(&[again]).unwrap()[0].known, 1);
}

pub(crate) fn what_an_outlet_does_not_have_is_not_let_go(home: &Home) {
    let mut archive = home.open();
    for second in 0..4 {
        let first = second * 5 + 1;
        let sequences = first.try_into().unwrap()..=(first + 4).try_into().unwrap();
        archive.append(&[Batch { at: at_s(second), ..batch(entries(LIFE, sequences)) }]).unwrap();
    }
    assert_eq!(archive.outlet("plant database").unwrap(), 0);
    for (given, kept) in [(12, 12), (7, 12)] {
        archive.set_outlet("plant database", given).unwrap();
        assert_eq!(archive.outlet("plant database").unwrap(), kept, "it never moves back");
    }
    assert_eq!(archive.outlets().unwrap(), [("plant database".to_owned(), 12)]);
    let keep = Keep { since: Some(at_s(100)), bytes: None };
    let expired = archive.expire(keep, at_s(200)).unwrap();
    assert_eq!((expired.entries, expired.is_held_back), (10, true), "whole batches");
    assert!(archive.forget_outlet("plant database").unwrap());
    assert!(!archive.forget_outlet("plant database").unwrap());
    let expired = archive.expire(keep, at_s(200)).unwrap();
    assert_eq!((expired.entries, expired.is_held_back), (10, false));
    assert!(archive.verify().unwrap().1.is_empty());
}

pub(crate) fn who_reads_while_others_write_misses_nothing_and_sees_no_contradiction(home: &Home) {
    home.open().append(&[batch(vec![life(LIFE)])]).unwrap();
    let place = home.place();
    let writes = move || {
        let mut archive = Archive::open(&place, Access::Write { program: PROGRAM }).unwrap();
        for number in 0..400 {
            let mut batch =
                batch([vec![gap(LIFE, 2 * number, 1)], entries(LIFE, [2 * number + 2])].concat());
            batch.collector = format!("collector {}", number / 10);
            archive.append(&[batch]).unwrap();
        }
    };
    let mut archive = home.open_for(Access::Read).unwrap();
    let (mut seen, mut last) = (0, 0);
    std::thread::scope(|scope| {
        let writer = scope.spawn(writes);
        loop {
            let is_over = writer.is_finished();
            let some = archive.since(last, 1000).unwrap();
            let Some(newest) = some.last() else {
                if is_over {
                    break;
                }
                continue;
            };
            last = newest.position;
            seen += some.len();
            let check = archive.check().unwrap();
            assert!(check.is_sound(), "{check:?}");
            assert_eq!(archive.verify().unwrap().1, []);
        }
    });
    assert_eq!((seen, last), (801, 801));
}

pub(crate) fn an_archive_of_a_newer_program_is_refused_by_name(home: &Home) {
    home.open().append(&[batch(entries(LIFE, 1..=3))]).unwrap();
    let set = |column: &str, value: i64| {
        let change = format!("UPDATE archive SET {column} = {value}, program = 'ser-cli 9.0.0'");
        home.sql(&change);
    };
    set("schema", 1000);
    let error = home.open_for(Access::Write { program: PROGRAM }).err().unwrap();
    let text = error.to_string();
    assert!(text.contains("ser-cli 9.0.0") && text.contains("schema 1000"), "{text}");
    let mut archive = home.open_for(Access::Read).unwrap();
    assert_eq!(everything(&mut archive, "U1-SER1").len(), 3);
    assert!(archive.append(&[batch(entries(LIFE, [4]))]).is_err(), "it was opened to read");
    set("readable_by", 1000);
    assert!(matches!(home.open_for(Access::Read), Err(Error::Newer { .. })));
}
