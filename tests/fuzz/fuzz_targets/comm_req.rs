//! See `ser_trial::fuzzing::comm_req`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| ser_trial::fuzzing::comm_req(data));
