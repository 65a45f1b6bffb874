//! What is exported, and the programs that read it. A test that runs without its program fails;
//! `cargo xtask test` leaves it out, and says so, where the program is missing.

mod plant;
mod tables;
mod vcd;

mod needs_python_readers;
mod needs_soffice;
mod needs_vcd2fst;
