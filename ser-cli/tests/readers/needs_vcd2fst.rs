//! `GTKWave`'s own readers.

use std::fs;
use std::path::Path;
use std::process::Command;

use super::plant::{Desk, Log, hostile_names, thirty_hours};
use super::vcd::{self, Signals};
use crate::common::bench::text;

/// What is left of a file that went through `GTKWave`'s format.
fn through_gtkwave(vcd: &Path) -> Signals {
    let fst = vcd.with_extension("fst");
    let to_fst = Command::new("vcd2fst").arg(vcd).arg(&fst).output();
    let to_fst = to_fst.expect("vcd2fst runs: cargo xtask test --all installs it");
    assert!(to_fst.status.success(), "{}", text(&to_fst.stderr));
    let back = Command::new("fst2vcd").arg(&fst).output().expect("fst2vcd comes with vcd2fst");
    assert!(back.status.success(), "{}", text(&back.stderr));
    vcd::read(&text(&back.stdout))
}

#[test]
#[ignore = "needs vcd2fst: cargo xtask test"]
fn thirty_hours_of_two_recorders_go_through_gtkwave_unchanged() {
    let logs = thirty_hours();
    let desk = Desk::of(&[&logs[0], &logs[1]]);
    desk.export("--format vcd", "a.vcd");
    let ours = vcd::read(&fs::read_to_string(desk.path("a.vcd")).expect("text"));
    assert_eq!(ours.len(), 1 + 2 * (32 + 3));
    let theirs = through_gtkwave(&desk.path("a.vcd"));
    assert_eq!(ours, theirs);
    let both: Vec<&String> = ours.keys().filter(|name| name.ends_with(".both")).collect();
    assert_eq!(both, ["Northfield.U1.both", "Northfield.U2.both"]);
}

#[test]
#[ignore = "needs vcd2fst: cargo xtask test"]
fn more_signals_than_signs_and_a_clock_that_was_set_back() {
    let names = hostile_names();
    let logs = ["U1", "U2", "U3", "U4"].map(|name| {
        let mut log = Log::new(name, &names);
        // The clock goes back by five seconds after the second entry.
        log.moves = vec![(0, 1), (9000, u32::MAX), (4000, 2), (4001, 3), (10_000, 1 << 31)];
        log
    });
    let desk = Desk::of(&logs.each_ref());
    desk.export("--format vcd", "a.vcd");
    let ours = vcd::read(&fs::read_to_string(desk.path("a.vcd")).expect("text"));
    assert_eq!(ours.len(), 1 + 4 * (32 + 3));
    let last = |signals: &Signals| signals["Northfield.U4.input_no__32"].last().cloned();
    assert_eq!(last(&ours).map(|(_, value)| value), Some("0".to_owned()));
    assert_eq!(ours, through_gtkwave(&desk.path("a.vcd")));
}
