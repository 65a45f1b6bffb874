//! Some virtual time of the whole system with random operations: every event is read once, or
//! reported as lost.
//!
//! `cargo xtask simulate` goes on for as long as one likes.

use ser_trial::simulation::account::Tally;
use ser_trial::simulation::questions::Answers;
use ser_trial::simulation::{Options, Report, run, run_flat_out};

const HOUR_MS: u64 = 3_600_000;
const MINUTE_MS: u64 = 60_000;

/// The setting with which no life is on a bus.
const NO_BUS: u64 = 0;

fn lived(seed: u64, duration_ms: u64, bus_one_in: u64) -> Report {
    let lived = run(Options { seed, duration_ms, bus_one_in });
    let (report, paces) = lived.unwrap_or_else(|failure| panic!("{failure}"));
    assert_eq!(paces.on_bus.virtual_ms, report.hours.bus_ms);
    assert_eq!(paces.on_bus.virtual_ms + paces.without_bus.virtual_ms, report.hours.total_ms);
    report
}

/// Checks that each edge and each event is in one of the columns.
fn assert_accounted(report: &Report) {
    for edges in &report.edges {
        let in_columns = edges.recorded
            + edges.stopped
            + edges.filtered
            + edges.chatter
            + edges.queue_full
            + edges.cut_off
            + edges.undecided;
        assert_eq!(edges.applied, in_columns, "{report}");
    }
    for (tally, recorder) in report.tallies.iter().map(|(_, tally)| tally).zip([0, 0, 1]) {
        assert_eq!(report.recorded[recorder], tally.accounted(), "{report}");
    }
}

/// Checks that recorders were asked, and told to filter, and that chatter was left out and came to
/// rest. Each answer and each count was compared with the ledger.
fn assert_asked(reports: &[Report], recorder: usize) {
    let sum = |count: fn(&Answers) -> u64| {
        reports.iter().map(|report| count(&report.answers[recorder])).sum::<u64>()
    };
    let counts = [
        sum(|answers| answers.times),
        sum(|answers| answers.identities),
        sum(|answers| answers.counters),
        sum(|answers| answers.filters),
        reports.iter().map(|report| report.filters_set[recorder]).sum(),
    ];
    assert!(counts.iter().all(|&count| count >= 20), "{counts:?}");
    let edges = || reports.iter().map(|report| report.edges[recorder]);
    assert!(edges().map(|edges| edges.chatter).sum::<u64>() > 1_000);
    assert!(edges().map(|edges| edges.rests).sum::<u64>() > 10);
}

/// What became of the events of all these runs, for one of the readers.
fn sum(reports: &[Report], reader: usize) -> Tally {
    let add = |sum: Tally, report: &Report| {
        let tally = report.tallies[reader].1;
        Tally {
            delivered: sum.delivered + tally.delivered,
            overwritten: sum.overwritten + tally.overwritten,
            gone: sum.gone + tally.gone,
            unrecorded: sum.unrecorded + tally.unrecorded,
            restarts: sum.restarts + tally.restarts,
            ..sum
        }
    };
    reports.iter().fold(Tally::default(), add)
}

#[test]
fn days_without_a_bus() {
    let reports: Vec<Report> = (1..=6).map(|seed| lived(seed, 24 * HOUR_MS, NO_BUS)).collect();
    for report in &reports {
        assert_accounted(report);
        assert_eq!(report.hours.bus_ms, 0);
        assert!(report.hours.steps < report.hours.total_ms / 2, "{report}");
    }
    // There was something to be accounted for.
    let tally = sum(&reports, 0);
    assert!(
        tally.delivered > 1000
            && tally.overwritten > 0
            && tally.gone > 0
            && tally.restarts > 0
            && tally.unrecorded > 0,
        "{tally:?}"
    );
    assert_asked(&reports, 0);
    let edges = || reports.iter().flat_map(|report| &report.edges);
    assert!(edges().any(|edges| edges.filtered > 0) && edges().any(|edges| edges.stopped > 0));
}

/// Together with the days and the minutes on a bus, these are a hundred different beginnings.
#[test]
fn many_beginnings_without_a_bus() {
    for seed in 201..=284 {
        assert_accounted(&lived(seed, 6 * MINUTE_MS, NO_BUS));
    }
}

#[test]
fn minutes_on_a_bus() {
    let reports: Vec<Report> = (101..=110).map(|seed| lived(seed, 6 * MINUTE_MS, 1)).collect();
    for report in &reports {
        assert_accounted(report);
        assert_eq!(report.hours.bus_ms, report.hours.total_ms);
    }
    for recorder in 0..2 {
        assert_asked(&reports, recorder);
        let marks = reports.iter().map(|report| report.answers[recorder].marks).sum::<u64>();
        assert!(marks >= 10, "{marks}");
    }
    for reader in 0..3 {
        let tally = sum(&reports, reader);
        assert!(
            tally.delivered > 1000 && tally.overwritten > 0 && tally.restarts > 0,
            "{reader}: {tally:?}"
        );
    }
}

#[test]
fn each_seed_is_on_a_bus_for_a_while() {
    for seed in [1, 5] {
        let hours = lived(seed, 2 * HOUR_MS, u64::MAX).hours;
        assert!(hours.bus_ms >= 20_000 && hours.bus_ms < hours.total_ms, "seed {seed}: {hours:?}");
    }
}

#[test]
fn the_same_seed_gives_the_same_run() {
    for (seed, duration_ms, bus_one_in) in [(7, 12 * HOUR_MS, NO_BUS), (107, 2 * MINUTE_MS, 1)] {
        let report = lived(seed, duration_ms, bus_one_in);
        assert_eq!(report, lived(seed, duration_ms, bus_one_in));
        assert_ne!(report.digest, lived(seed + 1, duration_ms, bus_one_in).digest);
    }
}

/// Checks that a time in which all inputs toggle in every millisecond is accounted for, and that
/// both ports were busy in it.
fn all_inputs_toggle_for(duration_ms: u64) {
    let options = Options { seed: 1, duration_ms, bus_one_in: 1 };
    let (report, _) = run_flat_out(options).unwrap_or_else(|failure| panic!("{failure}"));
    assert_accounted(&report);
    for (edges, &events) in report.edges.iter().zip(&report.recorded) {
        assert_eq!(events, duration_ms, "{report}");
        assert!(
            edges.recorded == edges.applied && (edges.applied / events).is_multiple_of(16),
            "{report}"
        );
    }
    assert!(
        report.tallies.iter().all(|(_, tally)| tally.delivered > 0 && tally.overwritten > 0),
        "{report}"
    );
    // The line carries nine replies a second, every other one of them short, beside some three
    // printed lines. The bus carries some twenty datagrams to each host.
    let at_least = |count: u64, per_second: u64| count > per_second * duration_ms / 1000;
    assert!(at_least(report.line.answered, 5) && at_least(report.line.lines, 2), "{report}");
    assert!(report.bus.iter().all(|talk| at_least(talk.answered, 10)), "{report}");
    assert!(at_least(report.bus[0].reports, 10), "{report}");
}

#[test]
fn all_inputs_toggle_in_every_millisecond_and_all_edges_are_counted() {
    all_inputs_toggle_for(2 * MINUTE_MS);
}

#[test]
#[ignore = "takes minutes: cargo xtask test"]
fn all_inputs_toggle_in_every_millisecond_of_an_hour() {
    all_inputs_toggle_for(HOUR_MS);
}
