//! From a capture of the line back to messages: the reading behind `ser-cli decode`.

mod decoder;
mod explain;
mod hex;
mod lines;
mod listing;

pub(crate) use decoder::{CaptureFormat, Decoder};
pub(crate) use explain::{Explanation, Side, explain, hex_text};
pub(crate) use listing::{Listing, Tally};

use hex::{HexText, HexToken};
use lines::LineAssembler;
use listing::{Kind, Place};
