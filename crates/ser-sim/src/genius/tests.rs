//! The model against the manual's chapters, one file each. Every test is a host that does what the
//! chapter says, and checks in the shared RAM what the chapter promises.

mod bus;
mod ch03_log_in;
mod ch03_start_up;
mod ch04_setup;
mod ch05_status;
mod ch06_interrupts;
mod ch08_io_tables;
mod ch09_lockout;
mod ch10_configuration_change;
mod ch10_read_datagram;
mod ch10_transmit;
mod ch10_transmit_with_reply;
mod ch11_global_data;
mod ch12_directed_data;
mod ch13_request_queue;
mod faults;
mod file_between;
mod rig;
