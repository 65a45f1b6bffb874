//! One timeline of all recorders, as a table, as CSV or as JSON lines.

mod csv;
mod dialect;
mod jsonl;
mod table;

pub use csv::{CsvStyle, HEADER, write as write_csv, write_chosen as write_chosen_csv};
pub use dialect::Dialect;
pub use jsonl::write as write_jsonl;
pub use table::{write as write_table, write_chosen as write_chosen_table};

pub(crate) use csv::write_items as write_csv_items;
pub(crate) use dialect::{field, without_apostrophe};
pub(crate) use jsonl::write_items as write_jsonl_items;
