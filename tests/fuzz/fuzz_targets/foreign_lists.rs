//! See `ser_trial::fuzzing::foreign_lists`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| ser_trial::fuzzing::foreign_lists(data));
