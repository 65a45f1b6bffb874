//! A timeline in the formats of other programs.
//!
//! Each writer takes a [`Timeline`](ser_evidence::timeline::Timeline) and the [`Selection`] of it
//! that is wanted, and writes to whatever it is given, row by row. What the files say of time, order
//! and losses is in `docs/formats.md`, with a table of what each format cannot say.
//!
//! CSV, PRC-002 and JSON lines hold entries and losses as they are. A waveform (VCD, COMTRADE) has
//! one axis of time and a state for each input at each instant: `steps` makes that of the entries,
//! and both formats are made from it.

mod anchors;
mod axis;
mod channels;
mod comname;
pub mod comtrade;
mod counted;
mod csv;
mod jsonl;
mod local;
#[cfg(feature = "parquet")]
mod parquet;
mod prc002;
mod refused;
mod selection;
mod statement;
mod steps;
mod survey;
mod vcd;

pub use comname::{FileName, file_name};
pub use counted::Counted;
pub use csv::write as write_csv;
pub use jsonl::write as write_jsonl;
#[cfg(feature = "parquet")]
pub use parquet::write as write_parquet;
pub use prc002::write as write_prc002;
pub use refused::Refused;
pub use selection::Selection;
pub use statement::Origin;
pub use survey::begins_us;
pub use vcd::write as write_vcd;
