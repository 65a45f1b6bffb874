//! The narration of the demo: what has happened, and the command for doing it oneself.

use std::io::{self, Write};

use crate::error::Result;
use crate::output::Palette;

/// Tells on standard output.
pub(super) struct Story {
    out: io::Stdout,
    palette: Palette,
}

impl Story {
    pub(super) fn begin() -> Story {
        Story { out: io::stdout(), palette: Palette::of_stdout() }
    }

    /// What has happened, and the commands that one would type.
    pub(super) fn step(&mut self, text: &str, commands: &[&str]) -> Result<()> {
        let Palette { command: style, faint, .. } = self.palette;
        writeln!(self.out, "{text}")?;
        for command in commands {
            writeln!(self.out, "  {faint}${faint:#} {style}{command}{style:#}")?;
        }
        writeln!(self.out)?;
        Ok(self.out.flush()?)
    }

    /// The last lines of a file, and the command that shows them.
    pub(super) fn end_of_file(&mut self, said: &str, text: &str, lines: usize) -> Result<()> {
        let faint = self.palette.faint;
        self.step(said, &[&format!("tail -n {lines} north.toml")])?;
        let count = text.lines().count();
        for line in text.lines().skip(count.saturating_sub(lines)) {
            let line = if line.is_empty() { line.to_owned() } else { format!("    {line}") };
            writeln!(self.out, "{faint}{line}{faint:#}")?;
        }
        writeln!(self.out)?;
        Ok(self.out.flush()?)
    }
}
