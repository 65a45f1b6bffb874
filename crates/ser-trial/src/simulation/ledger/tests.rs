//! Logs that differ from the ledger.

use chrono::DateTime;
use ser_proto::{AutoReport, Configure, Inputs, Model};

use super::*;

const SIZE: u16 = 8;
const NEVER_SET: (ClockSource, i64) = (ClockSource::NeverSet, 0);

/// A ledger with `count` events, and the same events as entries of a log.
fn recorded(count: u64) -> (Ledger, Vec<Entry>) {
    let mut ledger = Ledger::new(Model::Ser160);
    ledger.power_up(0, NEVER_SET, SIZE, &[InputFilter::OFF; 32]);
    record(&mut ledger, 1..=count);
    let entries = ledger.events.iter().map(|event| event.to_entry()).collect();
    (ledger, entries)
}

fn record(ledger: &mut Ledger, at_ms: impl Iterator<Item = u64>) {
    for at_ms in at_ms {
        ledger.contacts_moved(at_ms, 1);
        ledger.settle(at_ms);
    }
}

impl Recorded {
    /// The event as a recorder's entry.
    pub(in crate::simulation) fn to_entry(self) -> Entry {
        let time = DateTime::from_timestamp_millis(self.stamp_ms).expect("a time").naive_utc();
        let time = TimeStamp::try_from(time).expect("in this century");
        Entry { changed: Inputs(self.changed), state: Inputs(self.state), time }
    }
}

/// Checks that it is refused in these words.
fn assert_refused(result: Result<(), String>, words: &str) {
    let error = result.expect_err(words);
    assert!(error.contains(words), "{error}");
}

#[test]
fn a_log_that_holds_what_was_recorded_is_right() {
    let (ledger, entries) = recorded(5);
    assert_eq!(ledger.check_log(5, &entries), Ok(()));
    let (ledger, entries) = recorded(12);
    assert_eq!(ledger.check_log(12, &entries[4..]), Ok(()));
}

#[test]
fn every_entry_is_looked_at() {
    for place in 0..5 {
        let (ledger, entries) = recorded(5);
        let mut late = entries.clone();
        late[place].time.millisecond += 1;
        assert_refused(ledger.check_log(5, &late), &format!("as event {place} of 5"));
        let mut other = entries;
        other[place].state.0 ^= 2;
        assert_refused(ledger.check_log(5, &other), &format!("as event {place} of 5"));
    }
}

#[test]
fn no_entry_is_missing_and_none_too_many() {
    let (ledger, entries) = recorded(5);
    assert_refused(ledger.check_log(5, &entries[1..]), "event 0 must be there");
    assert_refused(ledger.check_log(5, &entries[..4]), "as event 4 of 5");
    assert_refused(ledger.check_log(5, &[]), "event 0 must be there");
    let twice: Vec<Entry> = entries.iter().chain(&entries[4..]).copied().collect();
    assert_refused(ledger.check_log(6, &twice), "holds 6 entries of 5 events");
}

#[test]
fn the_total_counts_from_the_latest_erase_on() {
    let (mut ledger, entries) = recorded(5);
    assert_refused(ledger.check_log(4, &entries), "counts 4 events");
    ledger.command_arrived(Port::Line, &Command::Erase, u64::MAX);
    // As long as there is no reply, the erase may still be to come.
    assert_eq!(ledger.check_log(5, &entries), Ok(()));
    assert_eq!(ledger.check_log(0, &[]), Ok(()));
    assert_refused(ledger.check_log(0, &entries), "counts 0 events");
    assert_eq!(ledger.replied(Port::Line, &Reply::Erased), Ok(()));
    assert_refused(ledger.check_log(5, &entries), "counts 5 events");
    assert_eq!(ledger.check_log(0, &[]), Ok(()));
    record(&mut ledger, 6..=7);
    let after: Vec<Entry> = ledger.events.iter().skip(5).map(|event| event.to_entry()).collect();
    assert_eq!(ledger.check_log(2, &after), Ok(()));
    assert_refused(ledger.check_log(7, &after), "counts 7 events");
    assert_refused(ledger.check_log(2, &after[1..]), "event 5 must be there");
}

#[test]
fn an_erase_that_arrived_earlier_can_be_the_latest() {
    let (mut ledger, entries) = recorded(3);
    ledger.command_arrived(Port::Line, &Command::Erase, u64::MAX);
    ledger.command_done(&Command::Erase);
    record(&mut ledger, 4..=5);
    assert_eq!(ledger.replied(Port::Line, &Reply::Erased), Ok(()));
    // The line's erase was done with its reply, or some time before.
    assert_eq!(ledger.check_log(0, &[]), Ok(()));
    let after: Vec<Entry> = ledger.events.iter().skip(3).map(|event| event.to_entry()).collect();
    assert_eq!(ledger.check_log(2, &after), Ok(()));
    assert_refused(ledger.check_log(3, &entries), "as event");
}

#[test]
fn an_answer_that_waited_in_its_queue_does_not_undo_a_resize_over_the_other_port() {
    let configuration =
        |size| Reply::Configuration(Configuration { size, ..Configuration::default() });
    let resize = |size| {
        let (auto_report, report_address) = (AutoReport::Off, 31);
        Command::Configure(Configure {
            size: Some(size),
            baud: None,
            auto_report,
            report_address,
            auto_print: false,
        })
    };
    let (mut ledger, _) = recorded(5);
    ledger.command_arrived(Port::Line, &Command::QueryConfiguration, u64::MAX);
    ledger.command_arrived(Port::Bus, &resize(3), u64::MAX);
    ledger.replied(Port::Bus, &configuration(3)).expect("a reply");
    ledger.replied(Port::Line, &configuration(SIZE)).expect("a reply of before");
    assert_eq!(ledger.smallest_size(), 3);
    record(&mut ledger, 6..=10);
    assert_eq!(ledger.overwritten_before(), 7);
    // A question asked afterwards is answered with the new settings.
    ledger.command_arrived(Port::Line, &Command::QueryConfiguration, u64::MAX);
    ledger.replied(Port::Line, &configuration(3)).expect("a reply");
    assert_eq!(ledger.smallest_size(), 3);
}

#[test]
fn events_that_wait_do_not_show_what_was_dropped_after_them() {
    let mut ledger = Ledger::new(Model::Ser160);
    ledger.power_up(0, NEVER_SET, MAX_SIZE, &[InputFilter::OFF; 32]);
    // A datagram of millisecond 1 is read late, while the main loop is held up.
    ledger.wait_after(Some(1));
    let queue_ms = QUEUE_LEN as u64;
    let moves = (2..2 + queue_ms).map(|at_ms| (at_ms, 1)).chain([(2 + queue_ms, 4)]);
    ledger.contacts_moved_unseen(moves);
    let shown_ms = 10 + queue_ms;
    ledger.contacts_moved(shown_ms, 1);
    ledger.wait_after(None);
    ledger.settle(shown_ms);
    assert_eq!(ledger.len(), QUEUE_LEN + 1);
    for (event, count) in ledger.events.iter().zip(1..) {
        let is_last = event.at_ms == shown_ms;
        let dropped = if is_last { 4 } else { 0 };
        assert_eq!((event.state, event.unrecorded), ((count % 2) | dropped, dropped), "{event:?}");
    }
}
