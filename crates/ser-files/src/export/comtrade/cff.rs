//! All parts in one file.

use std::io::{self, Write};

use super::options::Data;
use super::record::Record;
use super::{cfg, dat, header};
use crate::export::statement::Origin;

pub(super) fn write(
    out: &mut dyn Write,
    record: &Record<'_>,
    origin: &Origin<'_>,
) -> io::Result<()> {
    part(out, "CFG")?;
    cfg::write(out, record)?;
    part(out, "INF")?;
    part(out, "HDR")?;
    header::write(out, record, origin)?;
    match record.options.data {
        Data::Ascii => part(out, "DAT ASCII")?,
        Data::Binary => {
            let len = record.rows * dat::binary_row_len(record.channels.len());
            part(out, &format!("DAT BINARY: {len}"))?;
        }
    }
    dat::write(out, record)
}

fn part(out: &mut dyn Write, name: &str) -> io::Result<()> {
    write!(out, "--- file type: {name} ---\r\n")
}
