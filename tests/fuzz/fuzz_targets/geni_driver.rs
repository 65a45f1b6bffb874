//! See `ser_trial::fuzzing::geni_driver`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| ser_trial::fuzzing::geni_driver(data));
