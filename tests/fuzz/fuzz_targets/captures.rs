//! See `ser_tests::fuzzing::captures`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| ser_tests::fuzzing::captures(data));
