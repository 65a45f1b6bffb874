//! Lists of other recorders and relays, made records of ours.
//!
//! A reader for each format (`sel`, `cytime`, `comtrade`, `prc002`) takes a file of any
//! origin apart into lists of rows (`list`). What follows is the same for all: times become UTC
//! (`zone`, `timed`), words become states (`states`), points get inputs (`inputs`), and rows
//! become entries (`entries`). An [`Importer`] does that for any number of files. Records of our own
//! files are handed on as they are read, however many there are; lists of others are held in memory,
//! because their rows are put in order and joined.
//!
//! Files come from outside. Whatever is in them, reading ends, memory is bounded, and what was not
//! understood is told with its line and reason while the rest is read.

mod calendar;
mod comtrade;
mod cytime;
mod entries;
mod format;
mod importer;
mod inputs;
mod list;
mod map;
mod notes;
mod output;
mod prc002;
mod sel;
mod states;
mod text;
mod timed;
mod zone;

pub use calendar::DateOrder;
pub use comtrade::Extent;
pub use cytime::Epoch;
pub use entries::is_doubt_of_time;
pub use format::Format;
pub use importer::{Imported, ImportedRecorder, Importer, Opened, Options, Own, Read};
pub use map::Map;
pub use notes::{Note, Notes, Refusal};
pub use output::Output;
pub use zone::zone_named;
