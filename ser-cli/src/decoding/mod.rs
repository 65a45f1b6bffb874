//! Turns a capture of the line back into messages, for `ser-cli decode`.

mod capture;
mod decoder;
mod explain;
mod extension;
mod hex;
mod lines;
mod listing;

pub use capture::CaptureOptions;
pub use decoder::CaptureFormat;
pub use explain::Side;
pub(crate) use explain::{Explanation, explain, hex_text};
pub use listing::{Listing, Tally};

use decoder::Decoder;
pub(crate) use hex::{HexText, HexToken};
use lines::LineAssembler;
use listing::{Kind, Place};
