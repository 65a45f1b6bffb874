//! See `ser_trial::fuzzing::records`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| ser_trial::fuzzing::records(data));
