//! See `ser_tests::fuzzing::comm_req`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| ser_tests::fuzzing::comm_req(data));
