//! What the ARM image does after a fatal fault: it starts anew, records again, and says what the
//! fault was.
//!
//! The faults are brought about in the very image that is to be flashed, by a word of the emulated
//! board's external bus. Events are lost with the memory that held them; the configuration and the
//! time are not.
#![cfg(unix)]

mod image_records;

use std::num::NonZeroU32;
use std::time::{Duration, Instant};

use ser_client::{Delivery, GeniusError, RequestError, TransportError, Unit};
use ser_proto::{AutoReport, Baud, Configuration, Entry, Inputs, Model, TimeStamp};
use ser_sim::testing::{Kind, PATIENCE};
use ser_sim::{ForcedFault, ResetCause};
use ser_trial::recorder::{NODE, PATIENT, Recorder, assert_entries_are, stamp_ms};

const TEN_O_CLOCK: TimeStamp =
    TimeStamp { year: 26, month: 11, day: 22, hour: 10, minute: 0, second: 0, millisecond: 0 };

const WANTED: Configuration = Configuration {
    size: 1024,
    baud: Baud::B9600,
    auto_report: AutoReport::Genius,
    report_address: 1,
    auto_print: false,
};

/// How late a main loop may come to set the clock or to read it, on a computer that does other
/// things as well.
const CLOCK_TOLERANCE: Duration = Duration::from_millis(500);

fn read_all(unit: &mut Unit) -> Vec<Entry> {
    let mut entries = Vec::new();
    unit.read_new(&mut None, 2048, &mut |delivery| match delivery {
        Delivery::Event { entry, .. } => entries.push(entry),
        Delivery::Lost { lost, .. } => panic!("{lost:?}"),
    })
    .expect("the log is read");
    entries
}

/// Moves input 1 every `period_ms`, `count` times.
fn toggling(count: u64, period_ms: u64) -> Vec<(u64, u8, bool)> {
    (0..count).map(|index| (index * period_ms, 1, index % 2 == 0)).collect()
}

fn milliseconds(time: Duration) -> i64 {
    i64::try_from(time.as_millis()).expect("minutes")
}

/// A clock that was set to ten o'clock, and when by this computer's clock.
struct SetClock {
    not_before: Instant,
    not_after: Instant,
}

impl SetClock {
    fn set(unit: &mut Unit) -> SetClock {
        let not_before = Instant::now();
        assert_eq!(unit.set_clock(|_| TEN_O_CLOCK).expect("the clock is set"), TEN_O_CLOCK);
        SetClock { not_before, not_after: Instant::now() }
    }

    /// Checks the time of an entry that was recorded between two moments, with allowance for the
    /// time that the bench kept the clock from running.
    fn assert_is_right(&self, entry: &Entry, from: Instant, to: Instant, stood_still: Duration) {
        let shown_ms = stamp_ms(entry) - stamp_ms(&Entry { time: TEN_O_CLOCK, ..*entry });
        let tolerance_ms = milliseconds(CLOCK_TOLERANCE + stood_still);
        let least_ms = milliseconds(from - self.not_after) - tolerance_ms;
        let most_ms = milliseconds(to - self.not_before) + tolerance_ms;
        assert!(
            (least_ms..=most_ms).contains(&shown_ms),
            "{shown_ms} ms are not within {least_ms}…{most_ms}"
        );
    }
}

/// A recorder that somebody has worked with.
struct InUse {
    recorder: Recorder,
    unit: Unit,
    clock: SetClock,
}

impl InUse {
    fn new(recorder: Recorder) -> InUse {
        let mut unit = recorder.unit();
        let clock = SetClock::set(&mut unit);
        let set_ms = recorder.board().tick_ms();
        assert_eq!(unit.configure(WANTED.into()).expect("configured"), WANTED);
        recorder.play(&[(0, 1, true), (5, 32, true), (9, 1, false)]);
        assert_eq!(read_all(&mut unit).len(), 3);
        // A clock that stood still while the recorder was away would be far off.
        let long_enough_ms = 4 * u32::try_from(CLOCK_TOLERANCE.as_millis()).expect("seconds");
        assert!(recorder.board().wait(PATIENCE, |board| board.tick_ms() - set_ms > long_enough_ms));
        InUse { recorder, unit, clock }
    }

    /// Checks that it goes on as it was told, right from the start, on the same line as before.
    fn assert_goes_on(&mut self) {
        let InUse { recorder, unit, clock } = self;
        let board = recorder.board();
        let boot_time = board.boot_time();
        // The time is printed and not asserted, because the emulator's clock goes on while this
        // computer stands still.
        println!("recording {boot_time:?} after reset");
        let played_before = recorder.played().len();
        let from = Instant::now();
        recorder.play(&[(0, 2, true), (3, 32, false)]);
        let to = Instant::now();
        assert_eq!(unit.configuration().expect("it answers on the same line"), WANTED);
        let entries = read_all(unit);
        assert_entries_are(&entries, &recorder.played()[played_before..]);
        assert_eq!(
            entries[0].state,
            Inputs(1 << 31 | 1 << 1),
            "contacts are taken as they are found"
        );
        clock.assert_is_right(&entries[0], from, to, board.clock_stood_still());
    }
}

/// Forces a fault upon a recorder in use, and checks that it comes back.
fn survives(fault: ForcedFault, cause: ResetCause, words: impl Fn(&str) -> bool) {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("log");
    let mut in_use = InUse::new(Recorder::start_logging(&log));
    let board = in_use.recorder.board().clone();
    assert_eq!((board.reset_cause(), board.fault_starts_ago()), (Some(ResetCause::PowerOn), None));
    let boots = board.boots();
    board.force(fault);
    assert!(board.wait_reboot(boots, PATIENCE), "it does not come back");
    assert_eq!((board.reset_cause(), board.fault_starts_ago()), (Some(cause), NonZeroU32::new(1)));
    assert!(words(&board.last_words()), "{:?}", board.last_words());
    assert!(board.wait(PATIENCE, |board| board.lamps().fault), "the fault lamp blinks");
    in_use.assert_goes_on();
    assert_eq!(board.boots(), boots + 1, "once is enough");
    let told = format!("the previous run ended with a fault: {cause:?}: {}", board.last_words());
    image_records::wait_for(&log, &[&told]);
}

#[test]
#[ignore = "needs the emulator and the image: cargo xtask test"]
fn a_hard_fault_is_over_in_a_moment_and_says_where_it_was() {
    survives(ForcedFault::HardFault, ResetCause::HardFault, |words| {
        words.starts_with("pc 0000") && words.ends_with("address a0000000")
    });
}

#[test]
#[ignore = "needs the emulator and the image: cargo xtask test"]
fn a_panic_is_over_in_a_moment_and_its_text_is_kept() {
    survives(ForcedFault::Panic, ResetCause::Panic, |words| {
        words.contains("forced.rs:") && words.ends_with(": forced by the bench")
    });
}

#[test]
#[ignore = "needs the emulator and the image: cargo xtask test"]
fn a_stack_that_runs_out_is_a_fault_and_harms_nothing_else() {
    // The processor finds no room for the registers that would tell where it happened.
    survives(ForcedFault::StackOverflow, ResetCause::StackOverflow, |words| {
        words.starts_with("status ")
    });
}

#[test]
#[ignore = "needs the emulator and the image: cargo xtask test"]
fn a_stack_that_runs_out_by_a_store_is_told_from_a_hard_fault() {
    survives(ForcedFault::StackOverflowByStore, ResetCause::StackOverflow, |words| {
        words.starts_with("pc 0000") && words.ends_with("address 1ffffffc")
    });
}

#[test]
#[ignore = "needs the emulator and the image: cargo xtask test"]
fn last_words_are_told_after_further_resets_until_there_are_newer_ones() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("log");
    let recorder = Recorder::start_logging(&log);
    let board = recorder.board();
    let force = |fault| {
        let boots = board.boots();
        board.force(fault);
        assert!(board.wait_reboot(boots, PATIENCE), "it does not come back");
    };
    force(ForcedFault::Panic);
    let words = board.last_words();
    assert!(words.ends_with(": forced by the bench"), "{words:?}");
    for starts_ago in [2, 3] {
        force(ForcedFault::SilentReset);
        assert_eq!(
            (board.reset_cause(), board.last_words()),
            (Some(ResetCause::Unknown), words.clone())
        );
        assert_eq!(board.fault_starts_ago(), NonZeroU32::new(starts_ago));
        let told = format!("the latest fault was {starts_ago} starts ago: Panic: {words}");
        image_records::wait_for(&log, &[&told]);
    }
    force(ForcedFault::HardFault);
    assert_eq!(
        (board.reset_cause(), board.fault_starts_ago()),
        (Some(ResetCause::HardFault), NonZeroU32::new(1))
    );
    assert!(board.last_words().starts_with("pc "), "{:?}", board.last_words());
}

#[test]
#[ignore = "needs the emulator and the image: cargo xtask test"]
fn a_main_loop_that_hangs_is_ended_by_the_watchdog() {
    survives(ForcedFault::MainLoopHangs, ResetCause::Watchdog, |words| {
        words == "the main loop stands still"
    });
}

#[test]
#[ignore = "needs the emulator and the image: cargo xtask test"]
fn capture_that_stops_is_ended_by_the_watchdog_though_the_main_loop_runs() {
    survives(ForcedFault::CaptureStops, ResetCause::Watchdog, |words| {
        words == "capture stands still"
    });
}

#[test]
#[ignore = "needs the emulator and the image: cargo xtask test"]
fn a_power_cycle_leaves_configuration_and_time() {
    let mut in_use = InUse::new(Recorder::start(Kind::Emulated, Model::Ser320));
    in_use.recorder.power_cycle();
    let board = in_use.recorder.board();
    assert_eq!((board.reset_cause(), board.fault_starts_ago()), (Some(ResetCause::PowerOn), None));
    in_use.assert_goes_on();
}

/// The emulated memory's sectors hold 15 records each, and every one of these changes is written.
#[test]
#[ignore = "needs the emulator and the image: cargo xtask test"]
fn a_configuration_outlives_power_cycles_around_the_erasing_of_its_sectors() {
    let recorder = Recorder::start(Kind::Emulated, Model::Ser160);
    let mut wanted = WANTED;
    for round in 0..5 {
        let mut unit = recorder.unit();
        for change in 1..=8 {
            wanted.size = 100 * round + change;
            assert_eq!(unit.configure(wanted.into()).expect("configured"), wanted);
        }
        drop(unit);
        recorder.power_cycle();
        assert_eq!(recorder.unit().configuration().expect("it answers"), wanted);
    }
}

#[test]
#[ignore = "needs the emulator and the image: cargo xtask test"]
fn the_clock_goes_on_from_one_simulator_to_the_next_with_the_same_memory() {
    let folder = tempfile::tempdir().expect("a folder");
    let memory = folder.path().join("memory");
    let InUse { recorder, clock, .. } = InUse::new(Recorder::start_with_memory(&memory));
    let stood_still = recorder.board().clock_stood_still();
    drop(recorder);
    let recorder = Recorder::start_with_memory(&memory);
    let mut unit = recorder.unit();
    assert_eq!(unit.configuration().expect("it remembers"), WANTED);
    let from = Instant::now();
    recorder.play(&[(0, 7, true)]);
    let stood_still = stood_still.max(recorder.board().clock_stood_still());
    clock.assert_is_right(&read_all(&mut unit)[0], from, Instant::now(), stood_still);
}

#[test]
#[ignore = "needs the emulator and the image: cargo xtask test"]
fn a_clock_that_was_never_set_begins_in_2000() {
    let recorder = Recorder::start(Kind::Emulated, Model::Ser160);
    recorder.play(&[(0, 1, true)]);
    let entry = read_all(&mut recorder.unit())[0];
    assert_eq!((entry.time.year, entry.time.month, entry.time.day), (0, 1, 1));
}

/// Moves before the restart are lost with the log. Moves after it are not.
#[test]
#[ignore = "needs the emulator and the image: cargo xtask test"]
fn contacts_that_move_all_the_time_are_recorded_again_from_the_first_sample_on() {
    let recorder = Recorder::start(Kind::Emulated, Model::Ser160);
    let board = recorder.board();
    recorder.start_playing(&toggling(400, 5));
    assert!(board.wait(PATIENCE, |_| recorder.played().len() > 50));
    let boots = board.boots();
    board.force(ForcedFault::Panic);
    assert!(board.wait_reboot(boots, PATIENCE), "it does not come back");
    recorder.wait_played();
    let entries = read_all(&mut recorder.unit());
    let played = recorder.played();
    // Ticks begin anew with the recorder.
    let anew = played.windows(2).position(|pair| pair[1].tick_before < pair[0].tick_before);
    let (before, after) = played.split_at(anew.expect("contacts moved before and after") + 1);
    assert!(before.len() > 50 && after.len() > 50, "{} and {}", before.len(), after.len());
    assert!(
        played.iter().all(|moved| moved.tick_before <= moved.tick_after),
        "no move is one of both runs"
    );
    assert_entries_are(&entries, after);
}

#[test]
#[ignore = "needs the emulator and the image: cargo xtask test"]
fn a_fault_takes_the_recorder_off_the_bus_and_brings_it_back() {
    let recorder = Recorder::start_on_bus(Kind::Emulated, Model::Ser160);
    let (host, board) = (recorder.host(), recorder.board());
    let mut unit = host.unit(NODE, PATIENT);
    assert_eq!(unit.configure(WANTED.into()).expect("configured"), WANTED);
    let boots = board.boots();
    board.force(ForcedFault::HardFault);
    assert!(board.wait_reboot(boots, PATIENCE), "it does not come back");
    // The bus may still hold the run before the fault for logged in, and then finds that it is gone.
    let found = (0..).find_map(|look| {
        host.find(NODE).expect("it is logged in again");
        match unit.configuration() {
            Err(RequestError::Transport(TransportError::Genius(GeniusError::NotOnBus {
                ..
            }))) if look < 10 => None,
            other => Some(other),
        }
    });
    assert_eq!(found.expect("a last look").expect("it remembers"), WANTED);
    let played_before = recorder.played().len();
    recorder.play(&toggling(5, 2));
    assert_entries_are(&read_all(&mut unit), &recorder.played()[played_before..]);
    recorder.assert_lawful();
}

#[test]
#[ignore = "needs the emulator and the image: cargo xtask test"]
fn lamps_tell_what_the_recorder_does() {
    let recorder = Recorder::start(Kind::Emulated, Model::Ser160);
    let board = recorder.board();
    for lit in [true, false, true] {
        assert!(board.wait(PATIENCE, |board| board.lamps().run == lit), "the run lamp blinks");
    }
    assert!(board.wait(PATIENCE, |board| !board.lamps().event), "nothing moves");
    recorder.start_playing(&toggling(10_000, 20));
    assert!(board.wait(PATIENCE, |board| board.lamps().event), "contacts move");
    let mut unit = recorder.unit();
    assert!(board.wait(PATIENCE, |board| !board.lamps().communication), "nobody asks");
    assert!(
        board.wait(PATIENCE, |board| unit.mode().is_ok() && board.lamps().communication),
        "somebody asks"
    );
}
