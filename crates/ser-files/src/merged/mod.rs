//! One timeline of all recorders, as a table, as CSV or as JSON lines.

mod csv;
mod jsonl;
mod table;

pub use csv::{HEADER, write as write_csv};
pub use jsonl::write as write_jsonl;
pub use table::write as write_table;
