//! What can be wrong with a site file: a file for each check.
//!
//! A check's file begins with what it finds, why that is wrong, and a bad and a good example. The
//! examples are tried by a test, with the lines that every site file has put around them. Its name
//! is in every diagnostic, and in `docs/site-file.md`.

pub(super) mod ambiguous_point;
pub(super) mod backward_shift;
pub(super) mod bad_baud;
pub(super) mod bad_clock;
pub(super) mod bad_edge;
pub(super) mod bad_time;
pub(super) mod duplicate_input;
pub(super) mod duplicate_name;
pub(super) mod duplicate_port;
pub(super) mod empty_group;
pub(super) mod empty_text;
pub(super) mod few_changes;
pub(super) mod hidden_character;
pub(super) mod input_beyond_model;
pub(super) mod long_text;
pub(super) mod missing_key;
pub(super) mod no_recorder;
pub(super) mod out_of_range;
pub(super) mod overlapping_shifts;
pub(super) mod padded_text;
pub(super) mod same_as;
pub(super) mod same_edge;
pub(super) mod same_texts;
pub(super) mod slash_in_recorder;
pub(super) mod syntax;
pub(super) mod too_fine;
pub(super) mod too_large;
pub(super) mod unknown_group;
pub(super) mod unknown_key;
pub(super) mod unknown_point;
pub(super) mod unknown_recorder;
pub(super) mod unknown_word;
pub(super) mod unknown_zone;
pub(super) mod upside_down;
pub(super) mod wrong_type;

#[cfg(test)]
mod tests;
