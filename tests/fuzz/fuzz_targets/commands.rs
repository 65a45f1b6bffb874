//! See `ser_tests::fuzzing::commands`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| ser_tests::fuzzing::commands(data));
