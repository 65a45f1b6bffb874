//! Auto reports that waited in the board or in the host while nobody looked. They are neither
//! answers nor news.

use ser_client::{Cursor, Delivery, GeniHost, LogFollower, RequestError, Unsolicited};
use ser_proto::{AutoReport, Command, Configure, Inputs, Model};

use crate::desk::{Desk, unit};

const NODE: u8 = 5;
const SIZE: u16 = 2048;

/// The inputs that events say are on.
type Seen = Vec<Inputs>;

fn desk() -> Desk {
    Desk::new(&[(NODE, Model::Ser160)])
}

/// Makes the recorder send its reports to the host's board.
fn report_to(host: &GeniHost) {
    let report = Configure {
        auto_report: AutoReport::Genius,
        report_address: host.number(),
        ..unit(host, NODE).configuration().expect("a reply").into()
    };
    unit(host, NODE).configure(report).expect("the settings are taken");
}

/// Contacts of these inputs close, one after the other.
fn events(desk: &Desk, inputs: impl IntoIterator<Item = u8>) {
    for input in inputs {
        desk.with(move |bench| bench.world.recorders[0].contact(input, true));
        // Each closing is an event of its own, and reported before the next.
        desk.run(50);
    }
}

/// Erases the log over RS-232, and opens all contacts unseen.
fn erase(desk: &Desk) {
    desk.with(|bench| {
        let recorder = &mut bench.world.recorders[0];
        recorder.serial_ask(&Command::SetMode { recording: false });
        (1..=16).for_each(|input| recorder.contact(input, false));
    });
    desk.run(50);
    desk.with(|bench| {
        let recorder = &mut bench.world.recorders[0];
        recorder.serial_ask(&Command::Erase);
        recorder.serial_ask(&Command::SetMode { recording: true });
    });
    desk.run(50);
}

fn states(deliveries: &[Delivery]) -> Seen {
    deliveries
        .iter()
        .map(|delivery| match delivery {
            Delivery::Event { entry, .. } => entry.changed,
            Delivery::Lost { lost, .. } => panic!("{lost:?}"),
        })
        .collect()
}

/// The events of inputs that closed one after the other.
fn of(inputs: impl IntoIterator<Item = u8>) -> Seen {
    inputs.into_iter().map(|input| Inputs(1 << (input - 1))).collect()
}

fn read_range(host: &GeniHost) -> Seen {
    let mut read = Vec::new();
    unit(host, NODE).read_range(1, 10, SIZE, &mut |delivery| read.push(delivery)).expect("a log");
    states(&read)
}

/// What a watcher sees: the log, and then what reports make it read.
fn watch(host: &GeniHost) -> Result<Seen, RequestError> {
    let mut unit = unit(host, NODE);
    let mut follower = LogFollower::new(None, SIZE);
    let mut seen = Vec::new();
    let read_new =
        &mut |follower: &mut LogFollower, unit: &mut ser_client::Unit, seen: &mut Seen| {
            follower.read_new(unit, &mut |step| {
                seen.extend(states(step.deliveries));
                Ok::<(), RequestError>(())
            })
        };
    read_new(&mut follower, &mut unit, &mut seen)?;
    while let Some(message) = unit.wait_event(std::time::Duration::from_millis(200))? {
        let Unsolicited::Report(_) = message else { panic!("{message:?}") };
        read_new(&mut follower, &mut unit, &mut seen)?;
    }
    Ok(seen)
}

#[test]
fn reports_of_an_erased_log_that_waited_in_the_board_answer_no_read() {
    let desk = desk();
    report_to(&desk.host());
    events(&desk, [1, 2]);
    erase(&desk);
    events(&desk, [3, 4]);
    let host = desk.host();
    assert_eq!(host.lost(), (0, 4), "what was thrown away is counted");
    assert_eq!(read_range(&host), of([3, 4]));
}

#[test]
fn reports_of_an_erased_log_that_waited_in_the_board_are_no_news_to_a_watcher() {
    let desk = desk();
    events(&desk, [1, 2]);
    report_to(&desk.host());
    events(&desk, [3, 4, 5]);
    erase(&desk);
    events(&desk, [6, 7]);
    assert_eq!(watch(&desk.host()).expect("all is well"), of([6, 7]));
}

#[test]
fn a_host_that_has_not_looked_for_long_is_told_no_old_stories() {
    let desk = desk();
    let host = desk.host();
    events(&desk, [1, 2]);
    report_to(&host);
    events(&desk, [3, 4, 5]);
    erase(&desk);
    events(&desk, [6, 7]);
    assert_eq!(read_range(&host), of([6, 7]));

    erase(&desk);
    events(&desk, [8, 9, 10]);
    erase(&desk);
    events(&desk, [11]);
    assert_eq!(watch(&host).expect("all is well"), of([11]));
}

#[test]
fn a_queue_that_ran_over_says_nothing_either() {
    let desk = desk();
    report_to(&desk.host());
    // The board keeps fifteen datagrams.
    events(&desk, (1..=10).chain(1..=10));
    erase(&desk);
    events(&desk, 1..=16);
    let host = desk.host();
    assert_eq!(read_range(&host), of(1..=10));
    assert_eq!(watch(&host).expect("all is well"), of(1..=16));
}

#[test]
fn reports_that_come_while_something_else_is_asked_are_not_lost() {
    let desk = desk();
    let host = desk.host();
    report_to(&host);
    events(&desk, [1]);
    let mut unit = unit(&host, NODE);
    let mut cursor: Option<Cursor> = None;
    unit.read_new(&mut cursor, SIZE, &mut drop).expect("a log");
    events(&desk, [2, 3]);
    // The reports wait in the board. The question gets its own answer, and the reports are there
    // afterwards.
    assert_eq!(unit.last_broadcast().expect("a reply"), None);
    let mut seen = Vec::new();
    while let Some(message) = unit.wait_event(std::time::Duration::ZERO).expect("all is well") {
        let Unsolicited::Report(report) = message else { panic!("{message:?}") };
        seen.extend(report.entries.iter().map(|entry| entry.changed));
    }
    assert_eq!(seen, of([2, 3]));
}
