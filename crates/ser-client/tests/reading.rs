//! Reading by cursor, against a recorder that is only a list.

mod common;

use std::collections::VecDeque;

use common::{Recorder, Told, serial, told};
use proptest::prelude::*;
use ser_client::{Cursor, Delivery, Disturbed, LogReader, Lost, Summary};
use ser_proto::Inputs;

/// A host that keeps its cursor from reading to reading, and checks what it gets against what
/// really happened.
struct Host {
    cursor: Option<Cursor>,
    /// Serial number of the event that must come next; unknown before the first.
    expected: Option<u32>,
    /// The most events that happen between two replies.
    rate: u32,
    /// The most requests under way.
    window: usize,
    /// Which replies are lost, first one first, over and over; their requests are repeated.
    lost: Vec<bool>,
    /// Whether readings go on until they have caught up.
    keeps_up: bool,
}

/// What happens to the recorder without the host's knowledge.
#[derive(Clone, Copy, Debug)]
enum Change {
    Nothing,
    /// Erase or power cycle.
    Erase,
    Resize(usize),
}

impl Host {
    fn new() -> Host {
        Host { cursor: None, expected: None, rate: 0, window: 1, lost: Vec::new(), keeps_up: false }
    }

    /// One reading as in `Unit::read_new`; `meanwhile` is called after each reply.
    fn read(
        &mut self,
        recorder: &mut Recorder,
        mut meanwhile: impl FnMut(&mut Recorder),
    ) -> (Vec<Told>, Summary) {
        let mut all = Vec::new();
        for _ in 0..6 {
            let size = u16::try_from(recorder.size).unwrap();
            let mut reader = LogReader::new(self.cursor, size).keeping_up(self.keeps_up);
            match self.read_with(&mut reader, recorder, &mut meanwhile, &mut all) {
                Ok(()) => return (all, reader.summary()),
                Err(Disturbed::NoProgress) => panic!("no progress: {reader:?}"),
                Err(_) => {}
            }
        }
        panic!("disturbed again and again");
    }

    fn read_with(
        &mut self,
        reader: &mut LogReader,
        recorder: &mut Recorder,
        meanwhile: &mut dyn FnMut(&mut Recorder),
        all: &mut Vec<Told>,
    ) -> Result<(), Disturbed> {
        let mut requests = 0;
        let mut after_loss = false;
        let mut under_way = VecDeque::new();
        // A repeated request is the only one under way.
        let mut again = VecDeque::new();
        let mut lost = self.lost.iter().cycle();
        let mut last = self.cursor.map(|cursor| cursor.sequence);
        let in_a_row =
            self.lost.repeat(2).split(|lost| !lost).map(<[bool]>::len).max().unwrap_or(0);
        let rate = self.rate * u32::try_from(1 + in_a_row).unwrap();
        loop {
            while under_way.len() < self.window
                && again.is_empty()
                && let Some(request) = reader.request()
            {
                under_way.push_back(request);
            }
            let Some(request) = under_way.pop_front().or_else(|| again.pop_front()) else {
                assert!(!reader.is_waiting());
                return Ok(());
            };
            requests += 1;
            assert!(requests < 20_000, "no end: {reader:?}");
            assert!((1..=10).contains(&request.count));
            assert!(
                usize::from(request.start) + usize::from(request.count)
                    <= recorder.size.max(2047) + 2
            );
            let reply = recorder.read(request.start, request.count);
            if lost.next() == Some(&true) {
                again.push_back(request);
                meanwhile(recorder);
                continue;
            }
            let result = reader.take(&reply, &mut |delivery| {
                check_sequence(delivery, &mut last, recorder);
                if let Delivery::Event { entry_number, entry, model, .. } = delivery {
                    let given_up = serial(&entry).saturating_sub(oldest_serial(recorder));
                    // The event may have been overwritten between its reply and the one that proves
                    // it.
                    if serial(&entry) >= oldest_serial(recorder) {
                        let held = recorder.read(entry_number, 1);
                        assert_eq!(
                            held.entries[..],
                            [entry],
                            "entry {entry_number} is another event"
                        );
                    }
                    assert_eq!(model, recorder.model);
                    assert!(!after_loss || given_up <= 4 * rate, "{given_up} could have been read");
                }
                after_loss = matches!(delivery, Delivery::Lost { .. });
                all.push(told(delivery));
            });
            self.cursor = reader.cursor();
            result?;
            meanwhile(recorder);
        }
    }

    /// Checks what was delivered against what happened. `first_of_life` is the serial number of the
    /// first event after the latest erase.
    fn judge(&mut self, told: &[Told], first_of_life: u32) {
        for &told in told {
            match told {
                Told::Event(serial) => {
                    assert_eq!(
                        serial,
                        self.expected.unwrap_or(serial),
                        "not the event that comes next"
                    );
                    self.expected = Some(serial + 1);
                }
                Told::Overwritten(count) | Told::AtLeast(count) => {
                    self.expected = self.expected.map(|expected| expected + count);
                }
                Told::Restarted => self.expected = Some(first_of_life),
                Told::Unrecorded(inputs) => {
                    panic!("inputs {inputs:#x} did not change without an entry")
                }
            }
        }
    }
}

/// Checks that sequences continue from the last one, that a loss takes as many as were lost, and
/// that they are the recorder's own totals, except for a multiple of 65536.
fn check_sequence(delivery: Delivery, last: &mut Option<u64>, recorder: &Recorder) {
    match delivery {
        Delivery::Event { sequence, entry, .. } => {
            assert_eq!(sequence, Some(last.unwrap_or(0) + 1), "not the sequence that comes next");
            if let Some(actual) = recorder.sequence(serial(&entry)) {
                assert_eq!(sequence.map(|sequence| sequence % 65_536), Some(actual % 65_536));
            }
            *last = sequence;
        }
        Delivery::Lost { lost: Lost::LogRestarted, after } => {
            assert_eq!(after, *last);
            *last = None;
        }
        Delivery::Lost { lost, after } => {
            assert_eq!(after, Some(last.unwrap_or(0)), "the place of {lost:?}");
            *last = Some(last.unwrap_or(0) + u64::from(lost.known_count()));
        }
    }
}

fn events(serials: impl IntoIterator<Item = u32>) -> Vec<Told> {
    serials.into_iter().map(Told::Event).collect()
}

fn oldest_serial(recorder: &Recorder) -> u32 {
    serial(&recorder.history[recorder.history.len() - recorder.held()])
}

#[test]
fn a_first_reading_delivers_everything_in_order_and_a_second_one_nothing() {
    for size in [1, 2, 7, 10, 2048] {
        for count in [0, 1, 2, 9, 10, 11, 25] {
            let mut recorder = Recorder::new(size);
            recorder.append_many(count);
            let mut host = Host::new();
            let count = u32::try_from(count).unwrap();
            let lost = count.saturating_sub(u32::try_from(size).unwrap());
            let mut expected = events(lost + 1..=count);
            if lost > 0 {
                expected.insert(0, Told::AtLeast(lost));
            }
            let (told, summary) = host.read(&mut recorder, |_| {});
            assert_eq!(told, expected, "size {size}, {count} events");
            assert_eq!(
                (summary.delivered, summary.lost, summary.restarted),
                (count - lost, lost, false)
            );
            assert_eq!(u32::from(summary.position.total), count);
            assert_eq!(host.read(&mut recorder, |_| {}).0, []);
        }
    }
}

#[test]
fn only_what_is_new_is_delivered_across_the_end_of_the_ring_and_of_the_total() {
    for size in [1, 2, 7, 10, 2048] {
        let mut recorder = Recorder::after(size, 65_530);
        let mut host = Host::new();
        host.read(&mut recorder, |_| {});
        for _ in 0..40 {
            recorder.append();
            let newest = serial(recorder.history.last().unwrap());
            assert_eq!(host.read(&mut recorder, |_| {}).0, events([newest]), "size {size}");
        }
        assert!(recorder.total() < 100);
    }
}

#[test]
fn what_was_overwritten_is_counted() {
    let mut recorder = Recorder::new(7);
    let mut host = Host::new();
    recorder.append_many(5);
    host.read(&mut recorder, |_| {});
    recorder.append_many(10);
    let mut expected = vec![Told::Overwritten(3)];
    expected.extend(events(9..=15));
    assert_eq!(host.read(&mut recorder, |_| {}).0, expected);
    // As many as fit: nothing is lost, although the anchor is.
    recorder.append_many(7);
    assert_eq!(host.read(&mut recorder, |_| {}).0, events(16..=22));
}

#[test]
fn a_sequence_goes_on_where_the_total_wraps_and_is_exact_from_the_beginning_of_a_log() {
    for (past, exact) in
        [(0, true), (3, true), (9, true), (10, false), (65_540, false), (200_000, false)]
    {
        let mut recorder = Recorder::after(10, past);
        let mut host = Host::new();
        host.read(&mut recorder, |_| {});
        // A log that has just become full may have become full several times.
        let cursor = host.cursor.unwrap();
        assert_eq!(cursor.is_exact, exact, "{past} events");
        let unseen = recorder.count() - cursor.sequence;
        assert!(if exact { unseen == 0 } else { unseen.is_multiple_of(65_536) }, "{unseen}");
        for _ in 0..70 {
            recorder.append_many(1000);
            host.read(&mut recorder, |_| {});
        }
        let cursor = host.cursor.unwrap();
        assert_eq!((cursor.sequence + unseen, cursor.is_exact), (recorder.count(), exact));
        recorder.erase();
        recorder.append_many(4);
        host.read(&mut recorder, |_| {});
        let cursor = host.cursor.unwrap();
        assert_eq!(
            (cursor.sequence, cursor.is_exact),
            (4, true),
            "a new log counts from its beginning"
        );
    }
}

#[test]
fn a_change_that_no_entry_shows_is_told_where_it_happened() {
    let mut recorder = Recorder::new(20);
    let mut host = Host::new();
    recorder.append_many(5);
    host.read(&mut recorder, |_| {});
    // Recording is stopped for two changes, then one is recorded.
    let states = [recorder.skip(2), recorder.history.last().unwrap().state.0];
    recorder.append_many(3);
    let inputs = Inputs(states[0] ^ states[1]);
    let mut told = Vec::new();
    let mut reader = LogReader::new(host.cursor, 20);
    while let Some(request) = reader.request() {
        reader
            .take(&recorder.read(request.start, request.count), &mut |delivery| told.push(delivery))
            .unwrap();
    }
    assert_eq!(told[0], Delivery::Lost { after: Some(5), lost: Lost::Unrecorded { inputs } });
    assert_eq!(told.len(), 4);
    assert_eq!((reader.summary().unrecorded, reader.summary().lost), (1, 0));
    // Entries are not neighbours if events between them were overwritten.
    recorder.append_many(30);
    host.cursor = reader.cursor();
    assert_eq!(host.read(&mut recorder, |_| {}).0[0], Told::Overwritten(10));
}

#[test]
fn an_erased_log_is_noticed_whatever_its_total_is() {
    for before in [1, 5, 6, 7, 8, 20] {
        for after in 0..7 {
            let mut recorder = Recorder::new(7);
            let mut host = Host::new();
            recorder.append_many(before);
            host.read(&mut recorder, |_| {});
            recorder.erase();
            recorder.append_many(after);
            let first = u32::try_from(before).unwrap() + 1;
            let mut expected = vec![Told::Restarted];
            expected.extend(events(first..first + u32::try_from(after).unwrap()));
            let (told, summary) = host.read(&mut recorder, |_| {});
            assert_eq!(told, expected, "{before} events, erased, {after} events");
            assert!(summary.restarted);
            assert_eq!(host.read(&mut recorder, |_| {}).0, [], "told twice");
        }
    }
}

#[test]
fn a_reading_reaches_what_was_there_when_it_began_although_the_ring_turns() {
    let mut recorder = Recorder::after(62, 65_575);
    let lost = [[false; 7].as_slice(), &[true], &[false; 3], &[true], &[false]].concat();
    let mut host = Host { window: 3, lost, rate: 40, ..Host::new() };
    host.expected = recorder.first_serial_known();
    for (before, meanwhile) in [(7, &[13, 70, 25, 0][..]), (21, &[33, 20, 5, 0, 3])] {
        recorder.append_many(before);
        let due = recorder.history.last().map(serial).unwrap();
        let mut percents = meanwhile.iter().cycle();
        let mut replies = 0;
        let (told, _) = host.read(&mut recorder, |recorder| {
            replies += 1;
            if replies < 300 {
                recorder.append_many(40 * percents.next().unwrap() / 100);
            }
        });
        host.judge(&told, 1);
        assert!(host.expected.unwrap() > due, "the reading ended before its time: {told:?} {due}");
    }
}

#[test]
fn an_empty_log_that_gets_events_has_lost_none() {
    let mut recorder = Recorder::new(10);
    let mut host = Host::new();
    assert_eq!(host.read(&mut recorder, |_| {}).0, []);
    assert_eq!(host.cursor, Some(Cursor { sequence: 0, is_exact: true, anchor: None }));
    recorder.append_many(10);
    assert_eq!(host.read(&mut recorder, |_| {}).0, events(1..=10));
}

#[test]
fn a_resize_between_two_readings_loses_what_it_throws_away() {
    let mut recorder = Recorder::new(10);
    let mut host = Host::new();
    recorder.append_many(25);
    host.read(&mut recorder, |_| {});
    // Smaller: the newest four of eight new events are left.
    recorder.append_many(8);
    recorder.resize(4);
    let mut expected = vec![Told::Overwritten(4)];
    expected.extend(events(30..=33));
    assert_eq!(host.read(&mut recorder, |_| {}).0, expected);
    // Larger: four of six new events were there at the resize, and two more came after it.
    recorder.append_many(8);
    recorder.resize(100);
    recorder.append_many(2);
    let mut expected = vec![Told::Overwritten(4)];
    expected.extend(events(38..=43));
    assert_eq!(host.read(&mut recorder, |_| {}).0, expected);
    recorder.append();
    assert_eq!(host.read(&mut recorder, |_| {}).0, events([44]));
}

#[test]
fn a_reading_that_breaks_off_goes_on_where_it_stopped() {
    let mut recorder = Recorder::new(50);
    recorder.append_many(50);
    let mut cursor = None;
    let mut all = Vec::new();
    // Each reading is given up after its fourth reply.
    for _ in 0..20 {
        let mut reader = LogReader::new(cursor, 50);
        for _ in 0..4 {
            let Some(request) = reader.request() else { break };
            let reply = recorder.read(request.start, request.count);
            reader.take(&reply, &mut |delivery| all.push(told(delivery))).unwrap();
        }
        cursor = reader.cursor();
    }
    assert_eq!(all, events(1..=50));
}

#[test]
fn a_download_takes_few_requests_more_than_there_are_full_replies() {
    for window in [1, 2, 3] {
        let mut recorder = Recorder::after(2048, 5000);
        let mut requests = 0;
        let mut host = Host { window, ..Host::new() };
        host.read(&mut recorder, |_| requests += 1);
        // The position, whether the log is full (before the first entries and after them), ten
        // entries at a time once around the end of the ring, and one entry to look at in every
        // tenth reply or so.
        assert!((3 + 205 + 1..=3 + 205 + 1 + 3).contains(&requests), "{requests}");
    }
}

#[test]
fn a_total_that_is_the_same_after_65536_events_is_not_an_empty_log() {
    let mut recorder = Recorder::new(10);
    let mut host = Host::new();
    host.read(&mut recorder, |_| {});
    recorder.append_many(65_536);
    let mut expected = vec![Told::Restarted, Told::AtLeast(65_526)];
    expected.extend(events(65_527..=65_536));
    assert_eq!(host.read(&mut recorder, |_| {}).0, expected);
    // The total is 0 once more, but now there is an anchor.
    recorder.erase();
    recorder.append_many(3);
    let mut expected = vec![Told::Restarted];
    expected.extend(events(65_537..=65_539));
    assert_eq!(host.read(&mut recorder, |_| {}).0, expected);
}

#[test]
fn a_total_that_goes_back_during_the_reading_is_an_erase() {
    let mut recorder = Recorder::new(8);
    let mut host = Host::new();
    recorder.append_many(4);
    host.read(&mut recorder, |_| {});
    recorder.append_many(8);
    let mut replies = 0;
    let (told, _) = host.read(&mut recorder, |recorder| {
        replies += 1;
        if replies == 1 {
            // The slots agree: 8 divides 65536.
            recorder.erase();
            recorder.append_many(11);
        }
    });
    let mut expected = vec![Told::Restarted, Told::AtLeast(3)];
    expected.extend(events(16..=23));
    assert_eq!(told, expected);
}

#[test]
fn a_total_that_goes_back_by_any_number_is_never_a_loss_of_65536() {
    for (at_reply, events_after) in
        (1..=6).flat_map(|reply| (0..60).map(move |events| (reply, events)))
    {
        let mut recorder = Recorder::new(4);
        recorder.append_many(8);
        // The log was empty at the last reading, so there is no anchor.
        let mut reader =
            LogReader::new(Some(Cursor { sequence: 0, is_exact: true, anchor: None }), 4);
        let mut lost = 0;
        for reply in 1..=8 {
            let Some(request) = reader.request() else { break };
            let taken =
                reader.take(&recorder.read(request.start, request.count), &mut |delivery| {
                    if let Delivery::Lost { lost: what, .. } = delivery {
                        lost += what.known_count();
                    }
                });
            if taken.is_err() {
                break;
            }
            // More than the ring holds, so the reading is behind.
            recorder.append_many(9);
            if reply == at_reply {
                recorder.erase();
                recorder.append_many(events_after);
            }
        }
        assert!(
            lost < 1000,
            "{lost} events lost, erased at reply {at_reply} and {events_after} since"
        );
    }
}

#[test]
fn what_was_read_ahead_of_a_log_that_is_gone_is_not_delivered() {
    // 128 divides 65536, so slots agree whatever the totals are.
    let mut recorder = Recorder::new(128);
    recorder.append_many(1);
    let mut host = Host::new();
    host.read(&mut recorder, |_| {});
    recorder.append_many(60);
    let old = recorder.history.last().map(serial).unwrap();

    let mut reader = LogReader::new(host.cursor, 128);
    for reply in 0..40 {
        let Some(request) = reader.request() else { break };
        let gone = reply > 2;
        let answer = recorder.read(request.start, request.count);
        let taken = reader.take(&answer, &mut |delivery| {
            if let Delivery::Event { entry, .. } = delivery {
                assert!(!gone || serial(&entry) > old, "event {} of the old log", serial(&entry));
            }
        });
        assert_eq!(taken, Ok(()));
        if reply == 2 {
            // The ring is full again, with a larger total: events seem to have come faster than
            // they can be read.
            recorder.erase();
            recorder.append_many(400);
        }
    }
    assert!(reader.request().is_none());
}

#[test]
fn resizes_under_a_reading_that_is_behind_spoil_no_count() {
    let sizes = [17, 16, 9, 3, 40];
    let resizes =
        |at| sizes.into_iter().flat_map(move |size| (at..at + 5).map(move |at| (at, size)));
    let pairs = resizes(1).flat_map(|first| resizes(first.0).map(move |second| [first, second]));
    for (resizes, new_events) in pairs.flat_map(|pair| (1..60).map(move |events| (pair, events))) {
        let mut recorder = Recorder::new(18);
        recorder.append_many(5);
        let mut host = Host::new();
        let (told, _) = host.read(&mut recorder, |_| {});
        host.judge(&told, 1);
        recorder.append_many(new_events);
        let mut replies = 0;
        // Next slot is 0 before and after for some of these, so no position shows it.
        let (told, _) = host.read(&mut recorder, |recorder| {
            replies += 1;
            for (_, size) in resizes.into_iter().filter(|(at, _)| *at == replies) {
                recorder.resize(size);
            }
        });
        host.judge(&told, 1);
        let (told, _) = host.read(&mut recorder, |_| {});
        host.judge(&told, 1);
        assert_eq!(
            host.expected,
            recorder.history.last().map(|entry| serial(entry) + 1),
            "{resizes:?}"
        );
    }
}

#[test]
fn a_log_that_was_empty_tells_what_a_resize_that_nobody_told_of_has_thrown_away() {
    for (actual, new_events) in
        [3, 9, 17, 34, 36].into_iter().flat_map(|size| (0..80).map(move |new| (size, new)))
    {
        let mut recorder = Recorder::new(35);
        let mut host = Host::new();
        host.read(&mut recorder, |_| {});
        host.expected = Some(1);
        recorder.append_many(new_events / 2);
        recorder.resize(actual);
        recorder.append_many(new_events.div_ceil(2));
        // The host uses the size that it knows, and asks for it when it contradicts the replies.
        let mut all = Vec::new();
        let mut reader = LogReader::new(host.cursor, 35);
        if host.read_with(&mut reader, &mut recorder, &mut |_| {}, &mut all).is_err() {
            all.extend(host.read(&mut recorder, |_| {}).0);
        }
        host.judge(&all, 1);
        let next = u32::try_from(new_events).unwrap() + 1;
        assert_eq!(host.expected, Some(next), "size {actual}, {new_events} events: {all:?}");
    }
}

#[test]
fn a_log_that_was_empty_and_has_had_more_events_than_the_total_can_tell_is_read() {
    // If the size divides 65536, total and next slot show nothing.
    for size in [7, 100, 1000] {
        for new_events in [65_536, 65_537, 65_541, 65_600, 66_500] {
            let mut host = Host {
                cursor: Some(Cursor { sequence: 0, is_exact: true, anchor: None }),
                ..Host::new()
            };
            let mut recorder = Recorder::after(size, new_events);
            let newest = serial(recorder.history.last().unwrap());
            let (told, _) = host.read(&mut recorder, |_| {});
            let held = u32::try_from(size).unwrap();
            assert_eq!(
                told[told.len() - size..],
                events(newest + 1 - held..=newest),
                "{size}, {new_events}"
            );
        }
    }
}

#[test]
fn a_reader_that_is_faster_than_events_come_catches_up_with_them() {
    for (size, rate) in [(2048, 8), (2048, 5), (100, 6), (60, 5), (40, 3), (20, 2)] {
        let mut recorder = Recorder::after(size, 5000);
        let mut host = Host { rate: u32::try_from(rate).unwrap(), ..Host::new() };
        host.read(&mut recorder, |_| {});
        // The reading is three rings behind.
        recorder.append_many(3 * size);
        let mut lost = Vec::new();
        for _ in 0..30 {
            let (_, summary) = host.read(&mut recorder, |recorder| recorder.append_many(rate));
            lost.push(summary.lost);
        }
        assert_eq!(
            lost[10..].iter().sum::<u32>(),
            0,
            "size {size}, {rate} events a reply: {lost:?}"
        );
    }
}

#[test]
fn polling_an_idle_log_takes_one_request_when_the_position_is_known() {
    for size in [1, 7, 2048] {
        let mut recorder = Recorder::after(size, 20);
        let mut host = Host::new();
        let (_, summary) = host.read(&mut recorder, |_| {});
        let mut reader = LogReader::new(host.cursor, u16::try_from(size).unwrap())
            .starting_near(summary.position);
        let request = reader.request().unwrap();
        let reply = recorder.read(request.start, request.count);
        reader.take(&reply, &mut |delivery| panic!("{delivery:?}")).unwrap();
        assert_eq!(reader.request(), None, "size {size}");
    }
}

#[test]
fn a_resize_that_nobody_told_of_is_no_restart_where_the_position_is_known() {
    let mut recorder = Recorder::after(8, 12);
    let mut host = Host::new();
    let (_, summary) = host.read(&mut recorder, |_| {});
    for events in 0..20 {
        recorder.resize(3);
        recorder.append_many(events);
        let mut reader = LogReader::new(host.cursor, 8).starting_near(summary.position);
        let request = reader.request().unwrap();
        let reply = recorder.read(request.start, request.count);
        let taken = reader.take(&reply, &mut |delivery| panic!("{delivery:?}"));
        // The ring of three sometimes stands where one of eight would.
        let agrees = u32::from(reply.next_slot) == (4 + u32::from(reply.total) - 12) % 8;
        assert_eq!(taken.is_err(), !agrees, "{reply:?}");
    }
}

#[test]
fn a_size_that_is_not_the_recorders_is_noticed() {
    let mut recorder = Recorder::new(20);
    recorder.append_many(25);
    let mut reader = LogReader::new(None, 10);
    let mut result = Ok(());
    while let (Ok(()), Some(request)) = (result, reader.request()) {
        result = reader.take(&recorder.read(request.start, request.count), &mut |_| {});
    }
    assert_eq!(result, Err(Disturbed::WrongSize));
}

#[test]
fn a_size_that_is_too_large_is_noticed_before_anything_is_called_lost() {
    let anchored = |recorder: &Recorder| recorder.history.get(159).copied();
    for (size, with_cursor) in [(101, false), (2048, false), (101, true), (2048, true)] {
        let mut recorder = Recorder::new(100);
        recorder.append_many(250);
        let cursor = with_cursor.then(|| Cursor {
            sequence: 160,
            is_exact: true,
            anchor: anchored(&recorder),
        });
        let mut reader = LogReader::new(cursor, size);
        let mut result = Ok(());
        while let (Ok(()), Some(request)) = (result, reader.request()) {
            let reply = recorder.read(request.start, request.count);
            result = reader
                .take(&reply, &mut |delivery| assert!(!matches!(delivery, Delivery::Lost { .. })));
            // The ring goes on turning during the questions.
            recorder.append();
        }
        assert_eq!(result, Err(Disturbed::WrongSize), "size {size}, with cursor {with_cursor}");
    }
}

#[test]
fn replies_that_make_no_sense_end_the_reading() {
    // The reply is always the same, with a total and no entries.
    let recorder = Recorder::new(5);
    let mut reader =
        LogReader::new(Some(Cursor { sequence: 3, is_exact: true, anchor: None }), 100);
    let mut result = Ok(());
    for _ in 0..1000 {
        let Some(request) = reader.request() else { break };
        let mut reply = recorder.read(request.start, request.count);
        reply.total = 40;
        reply.next_slot = 30;
        result = reader.take(&reply, &mut |delivery| panic!("{delivery:?}"));
        if result.is_err() {
            break;
        }
    }
    assert_eq!(result, Err(Disturbed::NoProgress));
}

#[test]
fn an_overrun_reading_comes_past_everything_that_had_happened_when_it_began() {
    // What was given up to get ahead of the recorder reaches beyond that.
    let rate = 57;
    let mut recorder = Recorder::after(2048, 65_566);
    let mut host = Host { window: 3, lost: vec![false], ..Host::new() };
    host.expected = recorder.first_serial_known();
    host.rate = rate;
    for (before, percents) in
        [(42, &[51, 95, 95, 0, 60, 15][..]), (9, &[32, 13, 71]), (19, &[64, 79, 20, 23])]
    {
        recorder.append_many(before);
        let due = recorder.history.last().map(serial).unwrap();
        let mut percents = percents.iter().cycle();
        let (told, _) = host.read(&mut recorder, |recorder| {
            recorder.append_many(rate as usize * percents.next().unwrap() / 100);
        });
        host.judge(&told, 1);
        assert!(host.expected.unwrap() > due, "{:?} is not after {due}", host.expected);
    }
}

fn any_size() -> impl Strategy<Value = usize> {
    prop_oneof![
        Just(1),
        Just(2),
        Just(7),
        Just(10),
        Just(11),
        Just(2048),
        1_usize..40,
        40_usize..300
    ]
}

fn any_past() -> impl Strategy<Value = u64> {
    prop_oneof![Just(0), 0_u64..30, 65_500_u64..65_600, 0_u64..200_000]
}

/// Requests under way, and which replies are lost: none, or some.
fn any_window() -> impl Strategy<Value = (usize, Vec<bool>)> {
    let lost =
        prop_oneof![Just(Vec::new()), prop::collection::vec(prop::bool::weighted(0.2), 1..20)];
    (1_usize..=4, lost).prop_map(|(window, mut lost)| {
        // Every reply gets through sooner or later.
        lost.push(false);
        (window, lost)
    })
}

fn any_change() -> impl Strategy<Value = Change> {
    prop_oneof![
        4 => Just(Change::Nothing),
        1 => Just(Change::Erase),
        1 => any_size().prop_map(Change::Resize),
    ]
}

/// Makes something happen that a host can notice; see "what cannot be known" in the reader's
/// documentation. Returns how many events may follow before the next reply.
fn change(recorder: &mut Recorder, change: Change) -> usize {
    match change {
        Change::Erase if recorder.count() < 60_000 => {
            let followers = recorder.history.len().min(recorder.size)
                - usize::from(!recorder.history.is_empty());
            recorder.erase();
            followers
        }
        // A total that has wrapped and equals what the ring holds looks as if nothing had been
        // discarded.
        Change::Resize(size) if recorder.count() < 65_536 || size <= recorder.size => {
            recorder.resize(size);
            usize::MAX
        }
        _ => usize::MAX,
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 2000,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    /// Nothing happens during the readings: exactly what the recorder no longer holds is lost.
    #[test]
    fn each_event_once_and_every_loss_counted(
        size in any_size(),
        past in any_past(),
        reply_limit in prop_oneof![Just(10), Just(7), Just(1)],
        rounds in prop::collection::vec((any_change(), 0_usize..50), 1..12),
        (window, lost) in any_window(),
    ) {
        let mut recorder = Recorder::after(size, past);
        recorder.reply_limit = reply_limit;
        let mut host = Host { window, lost, ..Host::new() };
        let mut first_of_life = 1;
        let (told, _) = host.read(&mut recorder, |_| {});
        host.judge(&told, first_of_life);
        if past > 0 {
            let events = told.iter().filter(|told| matches!(told, Told::Event(_))).count();
            prop_assert_eq!(events, recorder.held());
        }
        let mut next_serial = recorder.history.last().map_or(1, |entry| serial(entry) + 1);
        prop_assert!(host.expected.is_none_or(|expected| expected == next_serial));
        host.expected = Some(next_serial);
        for (what, count) in rounds {
            let followers = change(&mut recorder, what);
            if recorder.history.is_empty() && recorder.count() == 0 {
                first_of_life = next_serial;
            }
            let count = count.min(followers);
            recorder.append_many(count);
            next_serial += u32::try_from(count).unwrap();
            let oldest = if recorder.held() == 0 { next_serial } else { oldest_serial(&recorder) };
            let unread = host.expected.unwrap().max(first_of_life);
            let (told, _) = host.read(&mut recorder, |_| {});
            let lost: u32 = told
                .iter()
                .map(|told| match *told {
                    Told::Overwritten(count) | Told::AtLeast(count) => count,
                    _ => 0,
                })
                .sum();
            prop_assert_eq!(lost, oldest.saturating_sub(unread), "{:?}", told);
            host.judge(&told, first_of_life);
            prop_assert_eq!(host.expected, Some(next_serial), "{:?}", told);
        }
    }

    /// Events happen during the readings, even so many that the ring turns. Order and count still
    /// hold.
    #[test]
    fn events_during_the_reading_are_delivered_or_counted(
        size in any_size(),
        past in any_past(),
        rate in prop_oneof![Just(0_usize), Just(1), Just(3), Just(12), 0_usize..100],
        rounds in prop::collection::vec((0_usize..50, prop::collection::vec(0_usize..=100, 1..8)), 1..8),
        (window, lost) in any_window(),
        keeps_up in any::<bool>(),
    ) {
        let mut recorder = Recorder::after(size, past);
        let mut host = Host { window, lost, keeps_up, ..Host::new() };
        host.expected = recorder.first_serial_known();
        host.rate = u32::try_from(rate).unwrap();
        for (before, meanwhile) in rounds {
            recorder.append_many(before);
            let due = recorder.history.last().map(serial);
            let mut percents = meanwhile.iter().cycle();
            let mut replies = 0;
            let (told, _) = host.read(&mut recorder, |recorder| {
                replies += 1;
                // A reading that keeps up would never end.
                if replies < 300 {
                    recorder.append_many(rate * percents.next().unwrap() / 100);
                }
            });
            host.judge(&told, 1);
            if let Some(due) = due {
                prop_assert!(host.expected.unwrap() > due, "the reading ended before its time");
            }
        }
        // The rest comes when the events stop.
        let (told, _) = host.read(&mut recorder, |_| {});
        host.judge(&told, 1);
        let next_serial = recorder.history.last().map_or(1, |entry| serial(entry) + 1);
        prop_assert_eq!(host.expected.unwrap_or(next_serial), next_serial);
        prop_assert_eq!(host.read(&mut recorder, |_| {}).0, vec![]);
    }

    /// Another host erases or resizes the log in the middle of a reading.
    #[test]
    fn changes_during_the_reading_are_noticed(
        size in any_size(),
        past in prop_oneof![1_u64..40, 1_u64..5000],
        new in prop_oneof![0_usize..40, 0_usize..300],
        at in prop_oneof![0_usize..8, 0_usize..40],
        what in any_change(),
        followers in prop_oneof![0_usize..20, 0_usize..300],
        (window, lost) in any_window(),
    ) {
        let mut recorder = Recorder::after(size, past);
        let mut host = Host { window, lost, ..Host::new() };
        host.read(&mut recorder, |_| {});
        host.expected = Some(recorder.history.last().map_or(1, |entry| serial(entry) + 1));
        recorder.append_many(new);
        host.rate = u32::try_from(followers).unwrap();
        let mut first_of_life = 1;
        let mut replies = 0;
        let (mut told, _) = host.read(&mut recorder, |recorder| {
            if replies == at {
                let next_serial = recorder.history.last().map_or(1, |entry| serial(entry) + 1);
                let room = change(recorder, what);
                if recorder.history.is_empty() {
                    first_of_life = next_serial;
                }
                recorder.append_many(followers.min(room));
            }
            replies += 1;
        });
        told.extend(host.read(&mut recorder, |_| {}).0);
        host.judge(&told, first_of_life);
        let next_serial = recorder.history.last().map_or(first_of_life, |entry| serial(entry) + 1);
        prop_assert_eq!(host.expected, Some(next_serial), "{:?}", told);
    }

    /// The total has wrapped, and after an erase so many events follow at once that neither it nor
    /// the next slot shows the erase. The entries show it.
    #[test]
    fn an_erase_that_no_header_shows_is_noticed(
        size in prop_oneof![Just(64_usize), Just(256), Just(2048)],
        total in 0_usize..1000,
        new in 0_usize..1000,
        at in 0_usize..1000,
        more in 0_usize..4,
        (window, lost) in any_window(),
    ) {
        let (total, new) = ((size - 4) * total / 1000, size * new / 1000);
        let mut recorder = Recorder::after(size, u64::try_from(65_536 + total - new).unwrap());
        let mut host = Host { window, lost, ..Host::new() };
        host.read(&mut recorder, |_| {});
        let serial_now = |recorder: &Recorder| serial(recorder.history.last().unwrap());
        host.expected = Some(serial_now(&recorder) + 1);
        recorder.append_many(new);
        let last = serial_now(&recorder);
        let mut replies = 0;
        let mut erased = false;
        let at = (3 + new / 8) * at / 1000;
        let (told, _) = host.read(&mut recorder, |recorder| {
            if replies == at {
                recorder.erase();
                recorder.append_many(total + more);
                erased = true;
            }
            replies += 1;
        });
        host.judge(&told, last + 1);
        let (told, _) = host.read(&mut recorder, |_| {});
        host.judge(&told, last + 1);
        let followers = if erased { u32::try_from(total + more).unwrap() } else { 0 };
        prop_assert_eq!(host.expected, Some(last + 1 + followers), "{:?}", told);
    }

    /// Whatever a broken recorder sends, reading neither panics nor goes on for ever.
    #[test]
    fn no_reply_can_break_the_reader(
        size in any::<u16>(),
        cursor in prop::option::of((any::<u64>(), any::<bool>())),
        replies in prop::collection::vec((any::<u16>(), 0_u16..2048, 0_usize..=10, any::<u32>()), 1..200),
    ) {
        let cursor = cursor.map(|(sequence, anchored)| {
            let anchor = anchored.then(|| common::event(0));
            Cursor { sequence, is_exact: anchored, anchor }
        });
        let mut reader = LogReader::new(cursor, size);
        for (total, next_slot, count, event) in replies {
            let Some(request) = reader.request() else { break };
            let entries: heapless::Vec<_, 10> = std::iter::repeat_n(common::event(event), count).collect();
            let model = (count > 0).then_some(ser_proto::Model::Ser160);
            let reply = ser_proto::ReadReply { start: request.start, total, next_slot, model, entries };
            let _ = reader.take(&reply, &mut |_| {});
            prop_assert!(reader.pending() <= 2048);
        }
    }
}

/// All that a reading delivers of a log that the recorder says is another one.
fn of_another_log(recorder: &Recorder, cursor: Cursor) -> (Vec<Told>, Option<Cursor>) {
    let size = u16::try_from(recorder.size).unwrap();
    let mut reader = LogReader::new(Some(cursor), size).of_another_log();
    let mut all = Vec::new();
    while let Some(request) = reader.request() {
        let reply = recorder.read(request.start, request.count);
        reader.take(&reply, &mut |delivery| all.push(told(delivery))).unwrap();
    }
    (all, reader.cursor())
}

proptest! {
    #[test]
    fn a_log_that_is_told_to_be_another_one_is_read_whole_whatever_it_looks_like(
        size in 1_usize..40,
        before in 0_usize..100,
        after in 1_usize..100,
        looks_alike in any::<bool>(),
    ) {
        let mut recorder = Recorder::new(size);
        recorder.append_many(before);
        let mut host = Host::new();
        host.read(&mut recorder, |_| {});
        let cursor = host.cursor.unwrap_or(Cursor { sequence: 0, is_exact: true, anchor: None });
        // The same events once more, as far as anybody can tell from them.
        let mut other = if looks_alike { Recorder::new(size) } else { recorder.clone() };
        other.erase();
        other.append_many(after);
        let (all, new) = of_another_log(&other, cursor);
        let held = after.min(size);
        let mut expected = vec![Told::Restarted];
        let lost = u32::try_from(after - held).unwrap();
        expected.extend((lost > 0).then_some(Told::AtLeast(lost)));
        let serials = other.history.iter().map(serial).skip(after - held);
        expected.extend(serials.map(Told::Event));
        prop_assert_eq!(all, expected);
        prop_assert_eq!(new.unwrap().sequence, u64::try_from(after).unwrap());
    }
}

#[test]
fn a_log_that_is_another_one_and_empty_is_told_at_once() {
    let cursor = Cursor { sequence: 7, is_exact: true, anchor: Some(common::event(7)) };
    let (all, new) = of_another_log(&Recorder::new(20), cursor);
    assert_eq!(all, [Told::Restarted]);
    assert_eq!(new, Some(Cursor { sequence: 0, is_exact: true, anchor: None }));
}
