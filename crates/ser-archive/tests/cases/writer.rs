//! Many threads add to one archive.

use std::thread;

use ser_archive::{Access, Archive, Error, Writer};

use crate::common::*;

fn writer(at: &Home, waiting: usize) -> Writer {
    let place = at.place();
    let open = move || Archive::open(&place, Access::Write { program: PROGRAM });
    Writer::start(open, waiting).unwrap()
}

pub(crate) fn what_many_threads_add_is_there_when_they_are_told_so(home: &Home) {
    let writer = writer(home, 4);
    thread::scope(|scope| {
        for recorder in 0..8 {
            let writer = &writer;
            scope.spawn(move || {
                for part in 0..20_u64 {
                    let mut batch = batch(entries(LIFE, part * 10 + 1..=part * 10 + 10));
                    batch.recorder = format!("SER{recorder}");
                    batch.bookmark = Some(bookmark(LIFE, part * 10 + 10));
                    let appended = writer.append(batch).unwrap().wait().unwrap();
                    assert_eq!(appended.entries, 10);
                }
            });
        }
    });
    let mut archive = writer.end().unwrap().unwrap();
    for recorder in 0..8 {
        let name = format!("SER{recorder}");
        assert_eq!(everything(&mut archive, &name), entries(LIFE, 1..=200));
        assert_eq!(archive.bookmark("cellar", &name).unwrap(), Some(bookmark(LIFE, 200)));
    }
    assert!(archive.verify().unwrap().1.is_empty());
}

pub(crate) fn one_that_cannot_be_written_keeps_nobody_else_from_it(home: &Home) {
    let writer = writer(home, 64);
    let mut nowhere = entry(LIFE, 7);
    nowhere.sequence = None;
    let tickets: Vec<_> = (1..=30_u64)
        .map(|part| {
            let mut records = entries(LIFE, [part]);
            if part % 3 == 0 {
                records.push(ser_evidence::record::Record::Entry(nowhere));
            }
            writer.append(batch(records)).unwrap()
        })
        .collect();
    for (part, ticket) in (1..).zip(tickets) {
        match ticket.wait() {
            Ok(_) => assert_ne!(part % 3, 0),
            Err(Error::NoPlace { .. }) => assert_eq!(part % 3, 0),
            Err(error) => panic!("{error}"),
        }
    }
    let mut archive = writer.end().unwrap().unwrap();
    let good = (1..=30).filter(|part| part % 3 != 0);
    assert_eq!(everything(&mut archive, "U1-SER1"), entries(LIFE, good));
}

pub(crate) fn who_asked_may_go_away_and_it_is_written_all_the_same(home: &Home) {
    let writer = writer(home, 2);
    for part in 1..=10 {
        drop(writer.append(batch(entries(LIFE, [part]))).unwrap());
    }
    drop(writer);
    assert_eq!(everything(&mut home.open(), "U1-SER1"), entries(LIFE, 1..=10));
}
