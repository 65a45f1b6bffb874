//! What the fault runs have found, each as small as it gets.

use crate::common::wait_until;
use crate::faults::Trial;
use crate::link::Wiring;
use crate::{Setting, trial};

/// A plant whose recorders have been read. The second and the third have small logs.
fn read() -> Trial {
    let mut trial = trial(1, Setting::default());
    trial.begin();
    trial
}

/// Exchanges the cables of the first two recorders, without a word to the collector.
fn exchange(trial: &Trial) {
    let links = &trial.plant.links[0];
    let (first, second) = (links[0].wiring(), links[1].wiring());
    links[0].wire(second);
    links[1].wire(first);
}

fn tells(trial: &Trial, what: &str) {
    wait_until(what, || trial.collectors[0].all_told().contains(what));
}

/// Erases a recorder, while the client of its link hears nothing, and waits until the collector has
/// met the empty log.
fn empty(trial: &mut Trial, place: usize) {
    let before = trial.plant.links[0][place].wiring();
    trial.plant.links[0][place].wire(Wiring { to: None, ..before });
    trial.plant.recorders[place].erase();
    trial.plant.links[0][place].wire(before);
    let name = trial.plant.recorders[place].name.clone();
    wait_until("the empty log is met", || {
        let tables = crate::tables::Tables::of_file(trial.collectors[0].archive());
        tables.is_ok_and(|tables| {
            let of_ours = tables.bookmarks.iter().find(|bookmark| bookmark.recorder == name);
            of_ours.is_some_and(|bookmark| bookmark.sequence == 0)
        })
    });
}

#[test]
fn entries_of_another_recorder_do_not_fill_an_empty_log() {
    let mut trial = read();
    empty(&mut trial, 0);
    empty(&mut trial, 1);
    exchange(&trial);
    trial.play(0, 5, 2);
    trial.play(1, 5, 2);
    tells(&trial, "the recorder at its port is");
    trial.settle_all();
}

#[test]
fn an_empty_log_that_begins_anew_is_another_one() {
    let mut trial = read();
    empty(&mut trial, 0);
    trial.plant.recorders[0].power_cycle();
    trial.play(0, 5, 2);
    trial.settle_all();
    // Who is met again has not begun anew since.
    trial.collectors[0].kill();
    trial.collectors[0].start(false);
    trial.settle_all();
}

#[test]
fn a_log_that_began_anew_and_is_overwritten_is_another_one() {
    let mut trial = read();
    let before = trial.plant.links[0][2].wiring();
    trial.plant.links[0][2].wire(Wiring { to: None, ..before });
    trial.plant.recorders[2].power_cycle();
    trial.play(2, 100, 2);
    trial.plant.recorders[2].wait();
    trial.plant.links[0][2].wire(before);
    trial.settle_all();
}

#[test]
fn a_recorder_that_was_elsewhere_for_a_while_has_not_begun_anew() {
    let mut trial = read();
    exchange(&trial);
    tells(&trial, "the recorder at its port is");
    exchange(&trial);
    trial.settle_all();
}

#[test]
fn a_recorder_that_has_said_which_it_is_does_not_become_an_original_one() {
    let mut trial = read();
    trial.collectors[0].kill();
    let links = &trial.plant.links[0];
    let (first, second) = (links[0].wiring(), links[1].wiring());
    links[0].wire(Wiring { is_original: true, ..second });
    links[1].wire(Wiring { is_original: true, ..first });
    trial.collectors[0].start(false);
    tells(&trial, "does not say which it is, as it did before");
    trial.settle_all();
}

#[test]
fn two_collectors_make_an_archive_at_once() {
    for seed in 0..5 {
        let mut trial = trial(seed, Setting { has_two: true, ..Setting::default() });
        trial.begin();
    }
}
