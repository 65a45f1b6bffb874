//! What all boards of the recorder share except registers. Everything here is tested on a desktop,
//! with mocks.
//!
//! A board brings up its chip and reports, in its interrupts, which byte came and which pin is
//! high. It leaves the rest to `ser_node` (what a recorder does) and to this crate (what a board
//! does):
//!
//! | module             | what it holds                                                                          |
//! |--------------------|----------------------------------------------------------------------------------------|
//! | [`start`]          | what every board's recorder consists of, once its chip is up                           |
//! | [`budget`]         | ring lengths and interrupt priorities, each with its derivation                        |
//! | [`ring`]           | a ring between an interrupt and the main loop that has no panicking path               |
//! | [`serial_line`]    | the rings of the RS-232 line, and when the line is quiet enough for another rate       |
//! | [`uart_line`]      | the main loop's end of the RS-232 line, over any UART                                  |
//! | [`main_loop`]      | one pass of the main loop between the ports and the node                               |
//! | [`genius`]         | the Genius port, with the lines of its GENI board                                      |
//! | [`inputs`]         | the word of inputs: ports, wiring, and samples that could not be taken                 |
//! | [`serialiser`]     | inputs behind industrial digital-input serialisers on SPI                              |
//! | [`flash_log`]      | the configuration in flash memory                                                      |
//! | [`clock_chip`]     | the battery-backed clock, with its faults                                              |
//! | [`stm32_rtc`]      | the calendar registers of STM32 clocks as date and time, and when to believe them      |
//! | [`health`]         | the faults of a board's parts, for the log and the fault lamp                           |
//! | [`leds`]           | what the four lamps mean                                                               |
//! | [`fault`]          | what a hard fault was, from what the processor shows                                   |
//! | [`last_words`]     | what outlives a reset: its cause, the panic's text, the number of boots                |
//! | [`log_writer`]     | frames of the log, one writer at a time, without a critical section                    |
//! | `report`           | tells the log which counters have moved (feature `defmt`)                             |
//! | [`counter`]        | counts that one context keeps and another reads                                        |
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

pub mod budget;
pub mod clock_chip;
pub mod counter;
pub mod fault;
pub mod flash_log;
pub mod genius;
pub mod health;
pub mod inputs;
pub mod last_words;
pub mod leds;
pub mod log_writer;
pub mod main_loop;
#[cfg(feature = "defmt")]
pub mod report;
pub mod serial_line;
pub mod serialiser;
pub mod start;
pub mod stm32_rtc;
pub mod uart_line;

pub use ser_node::ring;
