//! Who on the bus is a recorder, and what others answer.

use std::time::Duration;

use ser_client::{GeniHost, Options, Recognition};
use ser_proto::Model;
use ser_proto::genius::ForceTable;
use ser_sim::genius::{
    BlockKind, BusInterfaceUnit, BusTiming, Circuits, DiscreteBlock, Fault, Side, StationData,
};

use crate::desk::Desk;

const RECORDER: u8 = 5;
const ONE: [(u8, Model); 1] = [(RECORDER, Model::Ser160)];

/// A host's options with the patience of `ser-cli`.
const OPTIONS: Options = Options { timeout: Duration::from_secs(1), retries: 2 };
const ASKING: Recognition = Recognition::Asking(OPTIONS);

/// How long the questions themselves take: a few bus scans each.
const QUESTIONS_MS: u64 = 500;

/// Connects blocks with as many inputs as recorders have, and lets them log in.
fn connect_blocks(desk: &Desk) {
    desk.with(|bench| {
        let mut bus = bench.world.bus.borrow_mut();
        for (number, circuits) in [(7, Circuits::Sixteen), (8, Circuits::ThirtyTwo)] {
            bus.connect(DiscreteBlock::new(
                number,
                BusTiming::default(),
                circuits,
                BlockKind::Inputs,
            ));
        }
    });
    desk.run(1_000);
}

/// The bus addresses of the recorders, those of candidates that said nothing, and how long it took
/// to find out.
fn recorders(desk: &Desk, host: &GeniHost, how: Recognition) -> (Vec<u8>, Vec<u8>, u64) {
    let before_ms = desk.now_ms();
    let found = host.recorders(how).expect("the board is well");
    let numbers = found.recorders.iter().map(|&(number, _)| number).collect();
    (numbers, found.silent, desk.now_ms() - before_ms)
}

#[test]
fn a_recorder_is_known_whatever_model_number_its_board_has() {
    for model in [0, 4, 73, 255] {
        let desk = Desk::with_boards(&ONE, model);
        let host = desk.host();
        let (numbers, silent, took_ms) = recorders(&desk, &host, ASKING);
        assert_eq!((numbers, silent), (vec![RECORDER], vec![]), "model {model}");
        assert!(took_ms < 1_000, "{took_ms} ms");
    }
}

#[test]
fn a_block_with_as_many_inputs_does_not_answer_and_is_no_recorder() {
    let desk = Desk::new(&ONE);
    connect_blocks(&desk);
    let host = desk.host();
    let (numbers, silent, took_ms) = recorders(&desk, &host, ASKING);
    assert_eq!((numbers, silent), (vec![RECORDER], vec![7, 8]));
    // All were asked at the same time, three times. Nobody was waited for longer than that.
    assert!((3_000..3_000 + QUESTIONS_MS).contains(&took_ms), "{took_ms} ms");

    // The result is remembered.
    let (numbers, silent, took_ms) = recorders(&desk, &host, ASKING);
    assert_eq!((numbers, silent), (vec![RECORDER], vec![7, 8]));
    assert!(took_ms < QUESTIONS_MS, "{took_ms} ms");
}

#[test]
fn an_answer_is_remembered_until_the_device_logs_in_anew() {
    let desk = Desk::new(&ONE);
    let host = desk.host();
    assert_eq!(recorders(&desk, &host, ASKING).0, [RECORDER]);
    let board = desk.with(|bench| bench.world.recorders[0].board.id());
    // The recorder's board goes on, and a recorder that has answered once is not asked again ...
    desk.with(|bench| bench.paused = Some(bench.world.recorders.remove(0)));
    assert_eq!(recorders(&desk, &host, ASKING).0, [RECORDER]);
    // ... until its board was away, because it may be another device by then.
    let log_in_anew = || {
        desk.with(move |bench| {
            let mut bus = bench.world.bus.borrow_mut();
            let at_us = bus.now_us() + 1_000;
            bus.schedule(at_us, Fault::Disconnect { device: board, for_us: 1_000_000 });
        });
        desk.run(500);
        let (numbers, silent, _) = recorders(&desk, &host, ASKING);
        assert_eq!((numbers, silent), (vec![], vec![]), "it is away");
        desk.run(2_000);
    };
    log_in_anew();
    let (numbers, silent, _) = recorders(&desk, &host, ASKING);
    assert_eq!((numbers, silent), (vec![], vec![RECORDER]));
    // Silence is remembered no longer than that, either.
    desk.with(|bench| bench.world.recorders.extend(bench.paused.take()));
    log_in_anew();
    let (numbers, silent, _) = recorders(&desk, &host, ASKING);
    assert_eq!((numbers, silent), (vec![RECORDER], vec![]));
}

#[test]
fn by_model_number_nobody_is_asked() {
    let desk = Desk::with_boards(&ONE, 90);
    connect_blocks(&desk);
    let host = desk.host();
    // A device that could not answer is still a recorder.
    desk.with(|bench| bench.paused = Some(bench.world.recorders.remove(0)));
    let (numbers, silent, took_ms) = recorders(&desk, &host, Recognition::ModelNumber(90));
    assert_eq!((numbers, silent), (vec![RECORDER], vec![]));
    assert!(took_ms < QUESTIONS_MS, "{took_ms} ms");
    assert_eq!(recorders(&desk, &host, Recognition::ModelNumber(4)).0, Vec::<u8>::new());
}

#[test]
fn a_force_table_of_128_bytes_is_read() {
    const STATION: u8 = 9;
    let desk = Desk::new(&[(5, Model::Ser320)]);
    desk.with(|bench| {
        let data = StationData { discrete_bytes: 128, channels: 0 };
        let station =
            BusInterfaceUnit::new(STATION, BusTiming::default(), data, StationData::default());
        let mut bus = bench.world.bus.borrow_mut();
        let station = bus.connect(station);
        bus.get_mut(station).force_point(Side::Inputs, 8 * 128 - 1, Some(true));
    });
    let host = desk.host();
    let forces = host.read_forces(STATION, ForceTable::InputEnable).expect("a reply");
    assert_eq!((forces.contents.len(), forces.contents.last()), (128, Some(&0x80)));
}
