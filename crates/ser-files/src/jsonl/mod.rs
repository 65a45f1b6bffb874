//! JSON lines: one object per line, each a record of one recorder.
//!
//! The field `record` says what a line is; `docs/formats.md` lists the fields of every kind. The
//! first line says which version of this layout was written. Versions change when an old program
//! would misunderstand or overlook something: a new kind of record, or a field with a new meaning.
//! A field that merely adds something is passed over by programs that do not know it.
//!
//! Lines from before records had names (`{"entry":…}` and `{"lost":…}`) are read, too.

mod lines;
mod reader;
mod texts;
mod writer;

use ser_evidence::record::SiteRecord;

pub use reader::Reader;
pub use writer::Writer;

/// The version of this layout.
pub const SCHEMA: u32 = 1;

/// The longest line that is read, in bytes. Most have a few hundred; a site file is in one, and its
/// letters may be written with up to three times as many bytes.
pub const MAX_LINE_LEN: usize = 4 * SiteRecord::LONGEST;
