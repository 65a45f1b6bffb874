//! The long runs. They need Python, which reckons the digests of the archives.

use crate::{Setting, wanted_rounds};

#[test]
#[ignore = "needs python-readers: cargo xtask test"]
fn nothing_is_lost_nothing_is_twice_and_nothing_is_wrong() {
    wanted_rounds(25, Setting::default());
}

#[test]
#[ignore = "needs python-readers: cargo xtask test"]
fn two_collectors_of_one_archive_hide_nothing_of_each_other() {
    wanted_rounds(5, Setting { has_two: true, ..Setting::default() });
}

#[test]
#[ignore = "needs python-readers: cargo xtask test"]
fn what_two_collectors_read_of_original_recorders_is_filed_once() {
    wanted_rounds(5, Setting { has_two: true, are_original: true, ..Setting::default() });
}
