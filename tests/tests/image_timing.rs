//! The ARM image in virtual time: what it costs in instructions, and that a load at its limit costs
//! no event. `cargo xtask timing` prints all the numbers.
#![cfg(target_os = "linux")]

use image_bench::bench::{Carried, Parts, RATE};
use image_bench::costs::{
    self, Change, Commands, Cost, LONGEST_DEBOUNCE_MS, SHORTEST_DEBOUNCE_MS, Way, runs_of,
};
use image_bench::lateness::{Lateness, expiry};
use image_bench::load::Load;
use image_bench::lockstep::{INSTRUCTIONS_PER_MS, Lockstep, LockstepOptions};
use image_bench::program::{Handler, Kind, Program};
use image_bench::tally::Tally;
use ser_board::budget::CAPTURE_INSTRUCTIONS;
use ser_proto::Model;
use ser_sim::EmulatorOptions;
use ser_sim::testing::image;

/// Where the emulator's plugin is: set by `cargo xtask test`, which builds it.
const PLUGIN_VARIABLE: &str = "SER_QEMU_PLUGIN";

/// How long nothing happens before the load.
const REST_MS: u64 = 100;

/// How long all inputs change in every millisecond, which makes more events than the log holds.
/// `cargo xtask timing --load-seconds 60` goes on for a minute, which takes more than one of real
/// time.
const LOAD_MS: u64 = 3_000;

/// How many bytes a direction of the line may have been behind when the load began.
const LINE_SLACK: u64 = 4;

fn parts() -> Parts {
    let plugin = std::env::var_os(PLUGIN_VARIABLE);
    let plugin =
        plugin.unwrap_or_else(|| panic!("{PLUGIN_VARIABLE} is not set: run `cargo xtask test`"));
    Parts { image: image(), plugin: plugin.into() }
}

fn program(parts: &Parts) -> Program {
    Program::read(&parts.image).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
#[ignore = "needs the emulator and the image: cargo xtask test"]
fn the_capture_interrupt_keeps_to_its_budget() {
    let parts = parts();
    let program = program(&parts);
    let mut cases = Vec::new();
    for debounce_ms in [0, SHORTEST_DEBOUNCE_MS, LONGEST_DEBOUNCE_MS] {
        for change in Change::ALL {
            let instructions = costs::capture(&parts, &program, change, debounce_ms).unwrap();
            cases.push((format!("{change:?}, debounce of {debounce_ms} ms"), instructions));
        }
    }
    // With a longer debounce time the watchdog ends the hanging main loop before the queue is full.
    for debounce_ms in [0, SHORTEST_DEBOUNCE_MS] {
        let instructions = costs::capture_beyond_queue(&parts, &program, debounce_ms).unwrap();
        cases.push((format!("queue full, debounce of {debounce_ms} ms"), instructions));
    }
    for (case, instructions) in &cases {
        println!("{instructions:4} instructions: {case}");
    }
    let beyond: Vec<_> =
        cases.iter().filter(|(_, instructions)| *instructions > CAPTURE_INSTRUCTIONS).collect();
    assert!(beyond.is_empty(), "more than {CAPTURE_INSTRUCTIONS} instructions: {beyond:?}");
    // Each case differs from the others: changes, debounce and a full queue all cost something.
    let cost =
        |case: &str| cases.iter().find(|(name, _)| name == case).map_or(0, |(_, cost)| *cost);
    let [idle, all] = ["None", "All"].map(|change| cost(&format!("{change}, debounce of 0 ms")));
    let [idle_debounced, all_debounced] = ["None", "All"]
        .map(|change| cost(&format!("{change}, debounce of {SHORTEST_DEBOUNCE_MS} ms")));
    assert!(0 < idle && idle < all && idle < idle_debounced && idle_debounced < all_debounced);
    assert!(all < cost("queue full, debounce of 0 ms"), "the queue was not full");
    let full = format!("queue full, debounce of {SHORTEST_DEBOUNCE_MS} ms");
    assert!(all_debounced < cost(&full), "the queue was not full");
}

#[test]
#[ignore = "needs the emulator and the image: cargo xtask test"]
fn a_load_on_both_ports_delays_no_sample_and_loses_no_event() {
    let parts = parts();
    let program = program(&parts);
    let mut load = Load::start(&parts, &program).unwrap();
    load.rest_ms(REST_MS).unwrap();
    load.run_ms(LOAD_MS).unwrap();
    load.bench.tell(false);
    // Both are measured by the same expiry of the timer, so a delay that load brings to all
    // interrupts shows as well.
    let [quiet, busy] = load.lateness();
    let longest = runs_of(&load.bench.tally, Handler::Capture).map(|run| run.instructions).max();
    assert_eq!((quiet.count() as u64, quiet.max()), (REST_MS, 0));
    assert_eq!((busy.count() as u64, busy.max()), (LOAD_MS, 0));
    assert_eq!(load.bench.tally.longest_masked.instructions, 0);
    assert!(longest.is_some_and(|longest| longest <= CAPTURE_INSTRUCTIONS), "{longest:?}");
    let account = load.settle().unwrap();
    println!("{account:?}");
    assert!(account.is_settled() && account.changes == LOAD_MS, "{account:?}");
    // There was something to be accounted for.
    let [(_, line, _), (_, bus, _)] = account.hosts;
    assert!(line.delivered > 0 && line.overwritten > 0, "{account:?}");
    assert!(bus.delivered > 0 && bus.overwritten > 0, "{account:?}");
    // The line was full both ways, and not more than full.
    let full = u64::from(RATE) * LOAD_MS / 1000;
    let Carried { to, from } = account.carried;
    assert!((full * 95 / 100..=full + LINE_SLACK).contains(&to), "{account:?}");
    assert!((full * 95 / 100..=full + LINE_SLACK).contains(&from), "{account:?}");
}

#[test]
#[ignore = "needs the emulator and the image: cargo xtask test"]
fn two_runs_count_the_same() {
    let parts = parts();
    let program = program(&parts);
    let run = || -> Vec<Cost> {
        let mut commands = Commands::start(&parts, &program, Way::Line).unwrap();
        costs::commands().iter().map(|(_, command)| commands.cost(command).unwrap()).collect()
    };
    let costs = run();
    assert!(costs.iter().all(|cost| cost.main_loop > 0 && cost.handlers > 0), "{costs:?}");
    assert_eq!(costs, run());
}

/// Checks the measurement itself: where interrupts are masked, here by an instruction in place of
/// the sleep, the interrupt is seen to be late.
#[test]
#[ignore = "needs the emulator and the image: cargo xtask test"]
fn an_interrupt_that_is_masked_is_seen_to_be_late() {
    const MASK: u16 = 0xB672;
    const UNMASK: u16 = 0xB662;
    /// A pass of the main loop is a small part of a millisecond.
    const PASSES: u64 = 500;

    let parts = parts();
    let program = program(&parts);
    let sleeps: Vec<u32> = program.all(Kind::Sleep).collect();
    let mut lockstep = Lockstep::start(&LockstepOptions {
        emulator: EmulatorOptions::new(&parts.image),
        plugin: parts.plugin.clone(),
        model: Model::Ser320,
        debounce_ms: 0,
        geni: false,
        stops: [&[program.reset()], &sleeps[..]].concat(),
    })
    .unwrap();
    for &sleep in &sleeps {
        lockstep.patch(sleep, UNMASK).unwrap();
    }
    let mut tally = Tally::new(&program);
    let mut total = 0_u64;
    for pass in 0..PASSES {
        let stop = lockstep
            .run_and_tell(&mut |address| {
                total += 1;
                tally.executed(address);
            })
            .unwrap();
        assert!(sleeps.contains(&stop));
        tally.executed(stop);
        // Interrupts are masked during every second pass.
        lockstep.patch(stop, if pass.is_multiple_of(2) { MASK } else { UNMASK }).unwrap();
    }
    let began = costs::beginnings(&tally);
    let lateness = Lateness::of(&began, expiry(&began, INSTRUCTIONS_PER_MS), INSTRUCTIONS_PER_MS);
    assert!(total / INSTRUCTIONS_PER_MS > 5 && lateness.count() > 5, "{lateness:?}");
    assert!((1..INSTRUCTIONS_PER_MS).contains(&lateness.max()), "{lateness:?}");
}
