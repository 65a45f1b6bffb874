//! See `ser_tests::fuzzing::geni_driver`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| ser_tests::fuzzing::geni_driver(data));
