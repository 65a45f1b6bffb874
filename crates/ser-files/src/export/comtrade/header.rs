//! What people have to know, as text.

use std::io::{self, Write};

use super::record::Record;
use crate::export::channels::recorder_name;
use crate::export::statement::{self, Origin};
use crate::names::harmless;

const END: &str = "\r\n";

pub(super) fn write(
    out: &mut dyn Write,
    record: &Record<'_>,
    origin: &Origin<'_>,
) -> io::Result<()> {
    let Record { timeline, selection, survey, channels, .. } = record;
    let mut lines = OneLine { out, is_new: true };
    statement::write(&mut lines, timeline, selection, survey, origin, END)?;
    let mut line = |text: &str| write!(lines, "{text}{END}");
    line("")?;
    line(
        "Times are in UTC. An entry is where its sample was taken, in the middle of what is known.",
    )?;
    line("The first row is the sample before the first entry. The trigger is the first entry.")?;
    line(
        "A state that is not known is shown as it was last, from a line with MISSING on until the",
    )?;
    line("next entry of the recorder; before its first entry, as that entry says it was.")?;
    if record.hidden > 0 {
        let count = record.hidden;
        line(&format!("LEFT OUT: {count} changes that were followed by another in the same row"))?;
    }
    line("")?;
    for (channel, text) in survey.channels.all().iter().zip(channels) {
        let name = recorder_name(timeline, channel.recorder);
        let states = channel.named(timeline).map_or_else(String::new, |point| {
            let [point, on, off] = [&point.name, &point.on, &point.off].map(|text| harmless(text));
            format!(" ({point}): 1 is {on}, 0 is {off}")
        });
        line(&format!("{}: {name}, input {}{states}", text.name, channel.input))?;
    }
    Ok(())
}

/// Lets no line pass for the beginning of the next part of a file.
struct OneLine<'o> {
    out: &'o mut dyn Write,
    is_new: bool,
}

impl Write for OneLine<'_> {
    fn write(&mut self, text: &[u8]) -> io::Result<usize> {
        for &byte in text {
            if std::mem::replace(&mut self.is_new, byte == b'\n') && byte == b'-' {
                self.out.write_all(b" ")?;
            }
            self.out.write_all(&[byte])?;
        }
        Ok(text.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}
