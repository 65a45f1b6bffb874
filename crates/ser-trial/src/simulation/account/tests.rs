//! The checker checked: what a reader must be told, and what must be refused.

use ser_proto::{ClockSource, Command, InputFilter, Inputs, Model, Reply};

use super::*;
use crate::simulation::port::Port;

const SIZE: u16 = 100;
const NEVER_SET: (ClockSource, i64) = (ClockSource::NeverSet, 0);
const RESTARTED: Delivery = Delivery::Lost { after: None, lost: Lost::LogRestarted };

/// A recorder's ledger with a reader's account. The events are numbered over all lives.
#[derive(Clone)]
struct Case {
    ledger: Ledger,
    account: Account,
    now_ms: u64,
    entries: Vec<Entry>,
}

impl Case {
    fn new() -> Case {
        let mut ledger = Ledger::new(Model::Ser160);
        ledger.power_up(0, NEVER_SET, SIZE, &[InputFilter::OFF; 32]);
        Case { ledger, account: Account::new("reader"), now_ms: 0, entries: Vec::new() }
    }

    /// A case in which `count` events are recorded and read.
    fn read_up_to(count: usize) -> Case {
        let mut case = Case::new();
        case.record(count);
        case.read(&[]).and_then(|()| case.deliver(0, count)).expect("they are all there");
        case
    }

    fn record(&mut self, count: usize) {
        for _ in 0..count {
            self.now_ms += 1;
            self.ledger.contacts_moved(self.now_ms, 1);
            self.ledger.settle(self.now_ms);
            self.entries.push(self.ledger.latest().next().expect("one was recorded").to_entry());
        }
    }

    fn erase(&mut self) {
        self.ledger.command_arrived(Port::Line, &Command::Erase, u64::MAX);
        self.ledger.replied(Port::Line, &Reply::Erased).expect("a reply");
    }

    fn power_cycle(&mut self) {
        self.account.power_goes(&self.ledger, true);
        self.now_ms += 1000;
        let time_ms = i64::try_from(self.now_ms).expect("early");
        self.ledger.power_up(
            self.now_ms,
            (ClockSource::NeverSet, time_ms),
            SIZE,
            &[InputFilter::OFF; 32],
        );
    }

    /// Begins a reading with these deliveries.
    fn read(&mut self, deliveries: &[Delivery]) -> Result<(), String> {
        self.account.begin_reading();
        // The reader knows the last event that it was given, unless it has found the log empty
        // since.
        let known = match self.account.known {
            Known::Event if self.account.restart_told => Known::EmptyLog,
            known => known,
        };
        self.account.set_known(known);
        deliveries.iter().try_for_each(|delivery| self.account.take(delivery, &self.ledger))
    }

    /// Delivers `count` events from the one numbered `from` on.
    fn deliver(&mut self, from: usize, count: usize) -> Result<(), String> {
        self.entries[from..from + count]
            .iter()
            .try_for_each(|entry| self.account.take(&delivery(*entry), &self.ledger))
    }

    /// Ends the reading, and returns the tally. Every event must be accounted for in it.
    fn finish(&mut self) -> Result<Tally, String> {
        self.account.finish_reading(&self.ledger)?;
        let tally = self.account.tally();
        assert_eq!(tally.accounted(), self.entries.len() as u64, "{tally:?}");
        Ok(tally)
    }
}

fn delivery(entry: Entry) -> Delivery {
    Delivery::Event { entry_number: 1, sequence: None, entry, model: Model::Ser160 }
}

fn overwritten(count: u32) -> Delivery {
    Delivery::Lost { after: None, lost: Lost::Overwritten { count } }
}

/// Checks that it is refused in these words.
fn assert_refused<T: std::fmt::Debug>(result: Result<T, String>, words: &str) {
    let error = result.expect_err(words);
    assert!(error.contains(words), "{error}");
}

#[test]
fn events_in_order_are_delivered() {
    let mut case = Case::read_up_to(3);
    case.record(2);
    case.read(&[]).and_then(|()| case.deliver(3, 2)).expect("they are all there");
    assert_eq!(case.finish(), Ok(Tally { delivered: 5, ..Tally::default() }));
}

#[test]
fn changes_that_were_not_recorded_are_told_before_the_event_after_them() {
    let stopped_for_one = || {
        let mut case = Case::read_up_to(3);
        case.ledger.set_recording(case.now_ms, false);
        case.now_ms += 1;
        case.ledger.contacts_moved(case.now_ms, 0b10);
        case.ledger.settle(case.now_ms);
        case.ledger.set_recording(case.now_ms, true);
        case.record(2);
        case
    };
    let told =
        |inputs| Delivery::Lost { after: None, lost: Lost::Unrecorded { inputs: Inputs(inputs) } };
    let mut case = stopped_for_one();
    case.read(&[told(0b10)]).and_then(|()| case.deliver(3, 2)).expect("that is how it was");
    assert_eq!(case.finish(), Ok(Tally { delivered: 5, unrecorded: 1, ..Tally::default() }));
    let wrongly = "not recorded are told wrongly";
    let mut case = stopped_for_one();
    assert_refused(case.read(&[]).and_then(|()| case.deliver(3, 2)), wrongly);
    let mut case = stopped_for_one();
    assert_refused(case.read(&[told(0b11)]).and_then(|()| case.deliver(3, 2)), wrongly);
    let mut case = Case::read_up_to(3);
    case.record(1);
    assert_refused(case.read(&[told(0b10)]).and_then(|()| case.deliver(3, 1)), wrongly);
}

#[test]
fn overwritten_events_are_lost_with_their_count() {
    let mut case = Case::read_up_to(3);
    case.record(usize::from(SIZE) + 7);
    let lost = |count| {
        let mut case = Case {
            ledger: case.ledger.clone(),
            account: case.account.clone(),
            entries: case.entries.clone(),
            ..case
        };
        case.read(&[overwritten(count)]).and_then(|()| case.deliver(10, SIZE.into()))?;
        case.finish()
    };
    assert_eq!(lost(7), Ok(Tally { delivered: 103, overwritten: 7, ..Tally::default() }));
    assert_refused(lost(0), "event 10 comes too early");
    assert_refused(lost(6), "event 10 comes too early");
    assert_refused(lost(8), "event 10 comes too early");
}

#[test]
fn events_that_are_still_there_are_not_lost() {
    let mut case = Case::read_up_to(3);
    case.record(5);
    assert_refused(
        case.read(&[overwritten(2)]).and_then(|()| case.deliver(5, 1)),
        "are still there",
    );
}

#[test]
fn events_come_once_in_order_and_as_recorded() {
    let mut case = Case::read_up_to(3);
    case.record(3);
    case.read(&[]).expect("nothing yet");
    assert_refused(case.deliver(2, 1), "event 2 comes twice or too late");
    assert_refused(case.deliver(4, 1), "event 4 comes too early");
    let never = Entry { changed: Inputs(2), ..case.entries[3] };
    assert_refused(case.read(&[delivery(never)]), "this event has never been");
    let mut time = case.entries[3].time;
    time.millisecond += 1;
    let late = Entry { time, ..case.entries[3] };
    assert_refused(case.read(&[delivery(late)]), "this event has never been");
    case.deliver(3, 2).expect("they are next");
    assert_refused(case.finish(), "events 5 to 5 have not been delivered");
}

/// Three events are read, three are unread, and then the log begins anew and has five more.
fn began_anew(how: fn(&mut Case)) -> Case {
    let mut case = Case::read_up_to(3);
    case.record(3);
    how(&mut case);
    case.record(5);
    case
}

#[test]
fn a_reported_restart_accounts_for_what_went_unread() {
    for how in [Case::erase, Case::power_cycle] {
        let mut case = began_anew(how);
        case.read(&[RESTARTED]).and_then(|()| case.deliver(6, 5)).expect("it was told");
        assert_eq!(
            case.finish(),
            Ok(Tally { delivered: 8, gone: 3, restarts: 1, ..Tally::default() })
        );
    }
}

#[test]
fn a_restart_without_a_word_is_refused() {
    assert_refused(began_anew(Case::erase).deliver(6, 1), "event 6 comes too early");
    assert_refused(began_anew(Case::power_cycle).deliver(6, 1), "no word of a restart");
    // A wrong report is no better than none: nothing was overwritten.
    for how in [Case::erase, Case::power_cycle] {
        let mut case = began_anew(how);
        assert!(case.read(&[overwritten(3)]).and_then(|()| case.deliver(6, 1)).is_err());
    }
}

#[test]
fn a_restart_without_a_word_is_refused_where_nothing_is_lost() {
    for how in [Case::erase, Case::power_cycle] {
        let mut case = Case::read_up_to(3);
        how(&mut case);
        case.record(2);
        assert_refused(case.read(&[]).and_then(|()| case.deliver(3, 1)), "no word of a restart");
    }
}

#[test]
fn a_log_that_is_empty_is_told_too() {
    for how in [Case::erase, Case::power_cycle] {
        let mut case = Case::read_up_to(3);
        case.record(3);
        how(&mut case);
        case.read(&[]).expect("nothing yet");
        assert_refused(
            case.account.clone().finish_reading(&case.ledger),
            "nor a word of a restart",
        );
        case.read(&[RESTARTED]).expect("it did begin anew");
        let tally = case.finish().expect("it was told");
        assert_eq!(
            Tally { restarts: 0, ..tally },
            Tally { delivered: 3, gone: 3, ..Tally::default() }
        );
    }
}

#[test]
fn a_restart_that_never_was_is_refused() {
    let mut case = Case::read_up_to(3);
    case.record(1);
    assert_refused(case.read(&[RESTARTED]), "there was none");
}

#[test]
fn what_follows_a_restart_is_not_overwritten_while_it_is_there() {
    for how in [Case::erase, Case::power_cycle] {
        let mut case = began_anew(how);
        let told = case.read(&[RESTARTED, overwritten(2)]);
        assert_refused(told.and_then(|()| case.deliver(8, 1)), "are still there");
    }
}

#[test]
fn what_follows_a_restart_can_be_overwritten() {
    for how in [Case::erase, Case::power_cycle] {
        let mut case = began_anew(how);
        case.record(SIZE.into());
        let told = case.read(&[
            RESTARTED,
            Delivery::Lost { after: None, lost: Lost::OverwrittenAtLeast { count: 5 } },
        ]);
        told.and_then(|()| case.deliver(11, SIZE.into())).expect("it was told");
        let expected =
            Tally { delivered: 103, overwritten: 5, gone: 3, restarts: 1, ..Tally::default() };
        assert_eq!(case.finish(), Ok(expected));
    }
}

#[test]
fn a_reader_that_knows_no_event_can_miss_an_erase() {
    let mut case = Case::new();
    case.record(3);
    case.erase();
    case.record(2);
    case.read(&[]).and_then(|()| case.deliver(3, 2)).expect("it has nothing to go by");
    let unreported = Unreported { first_reading: 3, ..Unreported::default() };
    let expected = Tally { delivered: 2, unreported, traceless: 1, ..Tally::default() };
    assert_eq!(case.finish(), Ok(expected));
}

#[test]
fn a_reader_that_found_the_log_empty_can_miss_what_came_and_went() {
    for how in [Case::erase, Case::power_cycle] {
        let mut case = Case::new();
        case.account.set_known(Known::EmptyLog);
        case.record(3);
        how(&mut case);
        case.record(2);
        case.read(&[]).and_then(|()| case.deliver(3, 2)).expect("it has nothing to go by");
        let tally = case.finish().expect("nor at the end");
        let unreported = Unreported { empty_log: 3, ..Unreported::default() };
        assert_eq!(
            Tally { traceless: 0, ..tally },
            Tally { delivered: 2, unreported, ..Tally::default() }
        );
    }
}

#[test]
fn what_comes_and_goes_after_a_restart_was_told_of_an_empty_log_is_not_reported_with_it() {
    for how in [Case::erase, Case::power_cycle] {
        let mut case = Case::read_up_to(3);
        case.record(4);
        case.erase();
        case.read(&[RESTARTED]).expect("it is empty");
        case.account.set_known(Known::EmptyLog);
        case.record(5);
        how(&mut case);
        case.record(2);
        case.read(&[]).and_then(|()| case.deliver(12, 2)).expect("it has nothing to go by");
        let tally = case.finish().expect("nor at the end");
        let unreported = Unreported { empty_log: 5, ..Unreported::default() };
        let expected = Tally { delivered: 5, gone: 4, unreported, restarts: 1, ..Tally::default() };
        assert_eq!(Tally { traceless: 0, ..tally }, expected);
    }
}

#[test]
fn a_log_that_is_full_again_can_hide_an_erase() {
    let mut case = began_anew(Case::erase);
    case.record(SIZE.into());
    // The totals are 3 and 105, and the log holds the latest 100.
    case.read(&[overwritten(2)])
        .and_then(|()| case.deliver(11, SIZE.into()))
        .expect("it cannot know");
    let unreported = Unreported { full_again: 8, ..Unreported::default() };
    let expected = Tally { delivered: 103, unreported, traceless: 1, ..Tally::default() };
    assert_eq!(case.finish(), Ok(expected));
}

#[test]
fn a_log_that_is_full_again_can_hide_that_the_power_went() {
    let mut case = began_anew(Case::power_cycle);
    case.record(SIZE.into());
    case.read(&[overwritten(5)])
        .and_then(|()| case.deliver(11, SIZE.into()))
        .expect("it cannot know");
    let tally = case.finish().expect("nor at the end");
    assert_eq!(tally.unreported.all() + tally.overwritten, 8);
    assert_eq!(tally.unreported, Unreported { full_again: 3, ..Unreported::default() });
}

#[test]
fn nothing_else_excuses_silence() {
    // A log that was full again since one erase need not be full again since a later one.
    let mut case = began_anew(Case::erase);
    case.record(SIZE.into());
    case.erase();
    case.record(1);
    let last = case.entries.len() - 1;
    assert_refused(case.read(&[]).and_then(|()| case.deliver(last, 1)), "no word");
    // The ledger excuses nothing either: events that are gone need a reason.
    let mut case = began_anew(Case::erase);
    let erase = case.ledger.erases()[0];
    assert_refused(case.account.count_gone(3..6, erase, &case.ledger), "nothing excuses that");
    case.account.power_goes(&case.ledger, true);
    case.ledger.power_up(case.now_ms, NEVER_SET, SIZE, &[InputFilter::OFF; 32]);
    assert_refused(case.account.count_cut_off(&case.ledger), "nothing excuses that");
}

#[test]
fn what_the_power_took_is_open_until_the_next_reading() {
    let mut case = Case::read_up_to(3);
    case.record(2);
    case.power_cycle();
    let unreported = Unreported { not_read_since: 2, ..Unreported::default() };
    assert_eq!(case.account.tally(), Tally { delivered: 3, unreported, ..Tally::default() });
    case.read(&[RESTARTED]).expect("it did");
    let expected = Tally { delivered: 3, gone: 2, ..Tally::default() };
    assert_eq!(case.finish(), Ok(expected));
}

#[test]
fn a_log_that_is_full_again_hides_no_event_that_is_there() {
    let mut case = began_anew(Case::erase);
    case.record(SIZE.into());
    let told = case.read(&[overwritten(2)]);
    assert_refused(told.and_then(|()| case.deliver(14, 1)), "are still there");
}

#[test]
fn the_power_takes_what_a_reader_that_is_not_connected_cannot_miss() {
    let mut case = Case::read_up_to(3);
    case.record(2);
    case.account.power_goes(&case.ledger, false);
    let tally = case.account.tally();
    assert_eq!(tally, Tally { delivered: 3, unwatched: 2, ..Tally::default() });
}

#[test]
fn a_reading_through_a_power_cut_may_deliver_what_it_has_in_hand() {
    let mut case = Case::read_up_to(3);
    case.record(5);
    case.read(&[]).expect("nothing yet");
    case.power_cycle();
    case.record(1);
    case.account
        .take(&overwritten(2), &case.ledger)
        .and_then(|()| case.deliver(5, 2))
        .expect("they were read");
    // The next reading holds nothing from before, and has to be told.
    let next_reading = |from| {
        let mut case = case.clone();
        case.read(&[]).and_then(|()| case.deliver(from, 1))
    };
    assert_refused(next_reading(7), "never been");
    assert_refused(next_reading(8), "no word of a restart");
    case.read(&[RESTARTED]).and_then(|()| case.deliver(8, 1)).expect("it is told");
    let tally = Tally { delivered: 6, overwritten: 2, gone: 1, restarts: 1, ..Tally::default() };
    assert_eq!(case.finish(), Ok(tally));
}

#[test]
fn what_is_in_hand_of_a_life_that_began_unseen_has_a_count_worth_nothing() {
    let mut case = Case::read_up_to(3);
    case.power_cycle();
    case.record(5);
    case.read(&[]).expect("nothing yet");
    case.power_cycle();
    case.record(1);
    assert_refused(case.clone().deliver(5, 1), "never been");
    case.account
        .take(&overwritten(60_000), &case.ledger)
        .and_then(|()| case.deliver(5, 3))
        .expect("they were read");
    case.read(&[RESTARTED]).and_then(|()| case.deliver(8, 1)).expect("it is told");
    let tally = Tally { delivered: 7, overwritten: 2, restarts: 1, ..Tally::default() };
    assert_eq!(case.finish(), Ok(tally));
}
