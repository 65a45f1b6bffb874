//! See `ser_trial::fuzzing::site_files`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| ser_trial::fuzzing::site_files(data));
