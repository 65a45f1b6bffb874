//! How much of its stack the ARM image needs when everything happens at once, and that it keeps
//! recording.
#![cfg(unix)]

use std::thread;

use ser_client::{Cursor, Delivery, Endpoint, Unit, open};
use ser_proto::{AutoReport, Configuration, Entry, Model, TimeStamp};
use ser_sim::Played;
use ser_sim::testing::{Kind, PATIENCE};
use ser_trial::recorder::{NODE, PATIENT, Recorder};

/// The length of the stack in the image's memory map.
const STACK_LEN: u32 = 8 * 1024;

/// The variable with the bound that the checks of the image have found by walking through it, in
/// bytes. `cargo xtask test` sets it.
const BOUND_VARIABLE: &str = "SER_STACK_BOUND_MPS2_AN385";

/// How deep the stack of the image can get, by its instructions.
fn bound() -> u32 {
    let bound = std::env::var(BOUND_VARIABLE);
    let bound =
        bound.unwrap_or_else(|_| panic!("{BOUND_VARIABLE} is not set: run `cargo xtask test`"));
    bound.parse().expect("a number of bytes")
}

/// How often the image looks at its stack.
const LOOK_EVERY_MS: u32 = 1000;

/// How long contacts move, in milliseconds, while hosts ask for everything.
const MOVING_MS: u64 = 4000;

/// Events that the log holds: fewer than there are moves in that time.
const SIZE: u16 = 2048;

/// Moves all 32 contacts, once a millisecond, alternately one after the other and all together.
fn everything_moves(milliseconds: u64) -> Vec<(u64, u8, bool)> {
    (0..milliseconds)
        .flat_map(|ms| {
            let on = ms.is_multiple_of(2);
            let together = ms % 64 < 32;
            (1..=32)
                .filter(move |&input| together || u64::from(input) == ms % 32 + 1)
                .map(move |input| (ms, input, on))
        })
        .collect()
}

/// How many of these moves change anything, with contacts closed as in `state` before.
fn changes(mut state: u32, steps: &[(u64, u8, bool)]) -> usize {
    let together = steps.chunk_by(|(a_ms, ..), (b_ms, ..)| a_ms == b_ms);
    together
        .filter(|steps| {
            let before = state;
            for &(_, input, on) in *steps {
                let bit = 1 << (input - 1);
                state = if on { state | bit } else { state & !bit };
            }
            state != before
        })
        .count()
}

/// Everything that a host can ask for and have answered at once.
fn ask_for_everything(unit: &mut Unit, cursor: &mut Option<Cursor>) {
    let time =
        TimeStamp { year: 26, month: 11, day: 22, hour: 10, minute: 0, second: 0, millisecond: 0 };
    unit.set_clock(|_| time).expect("the clock is set");
    unit.mode().expect("the mode");
    unit.last_broadcast().expect("a reply");
    let configuration = unit.configuration().expect("a reply");
    unit.configure(configuration.into()).expect("configured");
    read_new(unit, cursor);
}

fn read_new(unit: &mut Unit, cursor: &mut Option<Cursor>) -> Vec<Entry> {
    let mut entries = Vec::new();
    let mut deliver = |delivery: Delivery| {
        if let Delivery::Event { entry, .. } = delivery {
            entries.push(entry);
        }
    };
    unit.read_new(cursor, SIZE, &mut deliver).expect("the log is read");
    entries
}

/// Checks that the log holds the latest moves, one event each, in their order.
fn assert_log_is(entries: &[Entry], played: &[Played]) {
    assert_eq!(entries.len(), usize::from(SIZE), "the log is full");
    let latest = &played[played.len() - entries.len()..];
    for (entry, moved) in entries.iter().zip(latest) {
        assert_eq!((entry.changed, entry.state), (moved.changed, moved.state), "{moved:?}");
    }
}

#[test]
#[ignore = "needs the emulator and the image: cargo xtask test"]
fn a_quarter_of_the_stack_is_never_in_use_nor_more_than_the_bound_found_in_the_image() {
    let bound = bound();
    let recorder = Recorder::start_on_bus(Kind::Emulated, Model::Ser320);
    let (host, board, port) = (recorder.host(), recorder.board(), recorder.port().to_owned());
    let mut on_bus = host.unit(NODE, PATIENT);
    let everything = Configuration {
        auto_report: AutoReport::Genius,
        report_address: host.number(),
        auto_print: true,
        ..Configuration::default()
    };
    recorder.play(&everything_moves(300));
    let played = recorder.played();
    let closed = played.last().map_or(0, |moved| moved.state.0);
    // As many printouts as may wait, with enough lines to last to the end.
    for _ in 0..4 {
        on_bus.print(1, SIZE).expect("accepted");
    }
    on_bus.configure(everything.into()).expect("configured");
    let moves = everything_moves(MOVING_MS);
    let all_moves = played.len() + changes(closed, &moves);
    recorder.start_playing(&moves);

    // Asking goes on to the last move, so all that the log holds in the end was recorded meanwhile.
    let is_moving = || recorder.played().len() < all_moves;
    thread::scope(|scope| {
        scope.spawn(|| {
            let endpoint: Endpoint = port.parse().expect("the simulator names its port");
            let mut on_line = Unit::new(open(&endpoint, 9600).expect("the line"), PATIENT);
            let mut cursor = None;
            while is_moving() {
                ask_for_everything(&mut on_line, &mut cursor);
            }
        });
        let mut cursor = None;
        while is_moving() {
            ask_for_everything(&mut on_bus, &mut cursor);
        }
    });
    let now_ms = board.tick_ms();
    assert!(board.wait(PATIENCE, |board| board.tick_ms() - now_ms > 2 * LOOK_EVERY_MS));

    let used = board.stack_bytes();
    println!(
        "{used} of {STACK_LEN} bytes of the stack have been in use ({} %)",
        used * 100 / STACK_LEN
    );
    assert!(used > 0, "the image has not looked");
    assert!(used <= STACK_LEN / 4 * 3, "{used} of {STACK_LEN} bytes");
    assert!(
        used <= bound,
        "{used} bytes in use, and no more than {bound} can be by the image's instructions"
    );
    assert_eq!(board.boots(), 1);
    recorder.assert_lawful();

    // The log is checked too, because a recorder that does nothing needs little stack.
    assert_log_is(&read_new(&mut recorder.unit(), &mut None), &recorder.played());
}
