//! `genius forces`: what is forced in a device.

use std::io::{self, Write};

use ser_proto::genius::ForceTable;

use crate::connection::{self, ConnectionArgs};
use crate::decoding::hex_text;
use crate::error::Result;

pub(super) fn run(connection: &ConnectionArgs, node: u8, table: ForceTable) -> Result<()> {
    let forces = connection::open_bus(connection)?.read_forces(node, table)?;
    let mut out = io::stdout().lock();
    writeln!(out, "{}", text(table, &forces.contents))?;
    out.flush()?;
    Ok(())
}

/// The bytes in order, and the points that are set in them, in case they are discrete ones.
fn text(table: ForceTable, contents: &[u8]) -> String {
    if contents.is_empty() {
        return format!("{table}: the device has no such points");
    }
    let bits = (1_usize..)
        .zip(contents.iter().flat_map(|byte| (0..8).map(move |bit| byte >> bit & 1 != 0)));
    let points: Vec<_> =
        bits.filter(|(_, set)| *set).map(|(number, _)| number.to_string()).collect();
    let points = match &points[..] {
        [] => "no point is on".to_owned(),
        [point] => format!("point {point} is on"),
        points => format!("points {} are on", points.join(" ")),
    };
    format!("{table}: {} ({points})", hex_text(contents))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_shown_as_bytes_and_as_points() {
        assert_eq!(
            text(ForceTable::InputValues, &[0x05, 0x80]),
            "input values: 05 80 (points 1 3 16 are on)"
        );
        assert_eq!(text(ForceTable::InputEnable, &[0, 0]), "input enable: 00 00 (no point is on)");
        assert_eq!(
            text(ForceTable::OutputEnable, &[]),
            "output enable: the device has no such points"
        );
    }
}
