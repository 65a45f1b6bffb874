//! See `ser_trial::fuzzing::replies`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| ser_trial::fuzzing::replies(data));
